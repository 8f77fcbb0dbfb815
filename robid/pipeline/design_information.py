"""The information of a design's candidates: assumed or measured, one task for a few of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, read_outline
from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.information import halves
from robid.design.configurations.measured import fitted_information, measured_information
from robid.design.configurations.options import DesignWeights, InformationOptions
from robid.design.configurations.visits import FittedInformation
from robid.errors import DataError
from robid.frf.covariance import by_realizations
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import fitted_delay_s, fitted_robot
from robid.models.elastic.fit.weights import assumed_error, make_weights, make_whitening
from robid.pipeline.configurations import campaign_lines, campaign_sampling_s, configurations_of
from robid.pipeline.plans import about_options, fit_options
from robid.pipeline.stage import Job
from robid.robot.description import Robot
from robid.settings.experiment import Design
from robid.settings.robot_parts import delay_s
from robid.simulate.options import Truth
from robid.simulate.truth import true_robot

UNREAD = (
    "coherence",
    "silent_level",
    "silent_noise",
    "silent_interpolation",
    "uncompensated_response",
    "input_amplitude",
)
"""What no design reads of a response."""
_WEIGHED = (
    "configurations",
    "response",
    "input_factor",
    "element_scale",
    "total_covariance",
    "noise_covariance",
    "dropped",
)


def fit_weights(path: Path, options: ElasticOptions) -> FloatArray:
    """Weights (n_conf, n_freq, n_out, n_in) that the fit's own function gives all candidates together."""
    rows = []
    for row in range(read_outline(path, FRF).n_rows):
        frf = frf_from_artifact(read_artifact(path, FRF, row=row, leave_out=(*UNREAD, "realization_error")))
        rows.append({name: getattr(frf, name) for name in _WEIGHED})
    whole: dict[str, Any] = {
        name: None if rows[0][name] is None else np.concatenate([row[name] for row in rows]) for name in _WEIGHED
    }
    return make_weights(replace(frf, **whole), options.weights, options.residual)[0]


_CHUNK = 20


@dataclass(frozen=True)
class CandidateInformation:
    """What a choice is made of."""

    matrices: FloatArray  # (n_draw, n_conf, n_param, n_param): information of one visit to each candidate
    names: tuple[str, ...]  # names of the parameters
    configurations: FloatArray  # (n_conf, n_joint): the candidates [rad]
    halves: FloatArray  # (n_way, 2, n_conf, n_param, n_param): the same by half the realizations each; n_way may be 0
    fitted: FittedInformation | None  # what a fit with weights of its own makes of them, under each draw, or None
    prior: FloatArray | None = None  # (n_param, n_param): what an earlier fit knows, or None
    # (n_param,): deviation of each log-parameter between configurations.
    between: FloatArray = field(default_factory=lambda: np.zeros(0))

    def take(self, candidates: IntArray) -> CandidateInformation:
        """The same of some candidates."""
        return replace(
            self,
            matrices=self.matrices[:, candidates],
            configurations=self.configurations[candidates],
            halves=self.halves[:, :, candidates],
            fitted=None if self.fitted is None else self.fitted.take(candidates),
        )


@dataclass(frozen=True)
class _Task:
    robots: tuple[Robot, ...]
    about: InformationOptions
    delay_s: float


@dataclass(frozen=True)
class AssumedTask(_Task):
    """Some candidates, by assumed errors."""

    configurations: FloatArray
    frequency_hz: FloatArray
    sampling_period_s: float


@dataclass(frozen=True)
class MeasuredTask(_Task):
    """One candidate, by its response."""

    frf: Path
    row: int
    pooled: int
    fit: ElasticOptions | None
    weights: FloatArray | None


def gather_information(job: Job) -> CandidateInformation:
    """Computes the information of all candidates, in parallel and with little memory.

    Raises:
        SettingsError: If the parameters or candidates cannot be had.
        DataError: If a covariance has no inverse.
    """
    design = job.loaded.experiment.designs[job.owner]
    knowledge = _point(job, design)[2]
    tasks, measured = design_tasks(job), design.information == "measured"
    job.progress.expect(len(tasks), "configurations" if measured else "parts")
    made: Callable[[Any], CandidateInformation] = _measured_information if measured else _assumed_information
    found = job.map(made, tasks, lambda _index, _result: job.progress.advance())
    names = found[0].names
    return CandidateInformation(
        matrices=np.concatenate([each.matrices for each in found], axis=1),
        names=names,
        configurations=np.concatenate([each.configurations for each in found]),
        halves=np.concatenate([each.halves for each in found], axis=2),
        fitted=_joined([each.fitted for each in found if each.fitted is not None], axis=1),
        prior=None if knowledge is None else knowledge.about(names),
        between=between_std(job, design, names),
    )


def design_tasks(job: Job, candidates: IntArray | None = None) -> Sequence[AssumedTask | MeasuredTask]:
    """Tasks of all candidates of a design, or of some."""
    design = job.loaded.experiment.designs[job.owner]
    robot, delay, _ = _point(job, design)
    robots = tuple(_drawn(robot, about_options(job.loaded.experiment, design)))
    if design.information == "measured":
        return _measured(job, robots, delay, candidates)
    return _assumed(job, robots, delay, candidates)


def between_std(job: Job, design: Design, names: tuple[str, ...]) -> FloatArray:
    """Deviation (n_param,) of each log-parameter between configurations: an earlier fit's, else the settings'."""
    stated = design.between_relative_std.of(names)
    if design.between is None:
        return stated
    solution = solution_from_artifact(read_artifact(job.inputs["between"], MODEL))
    if solution.effective is None:
        message = f"D194 Fit `{design.between}` does not tell how far parameters differ between configurations"
        remedy = "Name a fit of four configurations or more, or state `between_relative_std`."
        raise DataError(f"{message}: it has fewer than four.", where="between", remedy=remedy)
    found = dict(zip(solution.estimate.names, solution.effective.between_std.tolist(), strict=True))
    return np.array([found.get(name, own) for name, own in zip(names, stated.tolist(), strict=True)])


@dataclass(frozen=True)
class _Knowledge:
    """What an earlier fit found of log-parameters."""

    names: tuple[str, ...]
    covariance: FloatArray

    def about(self, names: tuple[str, ...]) -> FloatArray:
        """Information about some of them, whatever the others are."""
        chosen = [self.names.index(name) for name in names]
        return np.asarray(np.linalg.inv(self.covariance[np.ix_(chosen, chosen)]))


def _point(job: Job, design: Design) -> tuple[Robot, float, _Knowledge | None]:
    """Robot and delay at which derivatives are taken, and what is known beforehand."""
    campaign = job.loaded.experiment.campaigns[design.campaign]
    robot, delay = job.loaded.robot.to_robot(campaign.payload_kg), delay_s(job.loaded, campaign)
    if design.prior is None:
        return robot, delay, None
    solution = solution_from_artifact(read_artifact(job.inputs["model"], MODEL))
    # Its covariance is as wide as its intervals: a misfit is in it already.
    knowledge = _Knowledge(solution.estimate.names, solution.internal.covariance)
    return fitted_robot(robot, solution.estimate), fitted_delay_s(solution.estimate, delay), knowledge


def _drawn(robot: Robot, about: InformationOptions) -> Iterable[Robot]:
    """Robots whose wanted springs and dampers deviate; the robot alone when there is one draw."""
    if about.draws == 1:
        return [robot]
    damper_factor = about.draw_factor if "damping" in about.free else 1.0
    known = tuple(spring.name for spring in robot.springs if f"{spring.name}.stiffness" in about.fixed)
    draw = Truth(spring_factor=about.draw_factor, damper_factor=damper_factor, friction_relative=0.0, keep=known)
    seeds = np.random.SeedSequence(about.draw_seed).generate_state(about.draws)
    return (true_robot(robot, replace(draw, seed=int(seed))) for seed in seeds)


def _assumed(job: Job, robots: tuple[Robot, ...], delay: float, some: IntArray | None) -> list[AssumedTask]:
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    every = configurations_of(job.loaded, campaign, job.inputs)
    return _assumed_at(job, robots, delay, every if some is None else every[some])


def tasks_at(job: Job, configurations: FloatArray) -> Sequence[AssumedTask]:
    """Tasks of other configurations (n_conf, n_joint) [rad] than a design's own, by assumed errors."""
    robot, delay, _ = _point(job, job.loaded.experiment.designs[job.owner])
    return _assumed_at(job, (robot,), delay, configurations)


def _assumed_at(job: Job, robots: tuple[Robot, ...], delay: float, candidates: FloatArray) -> list[AssumedTask]:
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    period = campaign_sampling_s(job.loaded, campaign)
    frequency_hz = campaign_lines(job.loaded, campaign)[0] / campaign.excitation.period_s
    parts = [candidates[begin : begin + _CHUNK] for begin in range(0, len(candidates), _CHUNK)]
    about = about_options(job.loaded.experiment, design)
    return [AssumedTask(robots, about, delay, part, frequency_hz, period) for part in parts]


def _measured(job: Job, robots: tuple[Robot, ...], delay: float, some: IntArray | None) -> list[MeasuredTask]:
    experiment = job.loaded.experiment
    design = experiment.designs[job.owner]
    pooled = experiment.campaigns[design.campaign].estimate.pooled_lines
    path, fit = job.inputs["frf"], fit_options(experiment, design)
    rows = range(read_outline(path, FRF).n_rows) if some is None else some.tolist()
    weights = None if fit is None else fit_weights(path, fit)
    about = about_options(experiment, design)
    return [
        MeasuredTask(robots, about, delay, path, row, pooled, fit, None if weights is None else weights[row : row + 1])
        for row in rows
    ]


def _joined(parts: Sequence[FittedInformation], axis: int) -> FittedInformation | None:
    """The parts of sums over more draws (axis 0) or configurations (axis 1)."""
    if not parts:
        return None
    bread, meat, best = (
        np.concatenate([getattr(each, name) for each in parts], axis=axis) for name in ("bread", "meat", "best")
    )
    return FittedInformation(bread, meat, best, parts[0].precision)


def _assumed_information(task: AssumedTask) -> CandidateInformation:
    about, size = task.about, len(task.robots[0].joints)
    weights = element_weights(about.weights, task.frequency_hz, size, size)
    found = [
        candidate_information(
            robot,
            task.configurations,
            task.frequency_hz,
            task.sampling_period_s,
            task.delay_s,
            about.assumed_relative_error,
            kinds=about.free,
            nuisance=about.along(),
            fixed=about.fixed,
            weights=weights,
        )
        for robot in task.robots
    ]
    matrices, names = np.array([each for each, _ in found]), found[0][1]
    return CandidateInformation(matrices, names, task.configurations, np.zeros((0, 2, *matrices.shape[1:])), None)


def _measured_information(task: MeasuredTask) -> CandidateInformation:
    about = task.about
    left_out = UNREAD if task.fit is None else (*UNREAD, "realization_error")
    frf = frf_from_artifact(read_artifact(task.frf, FRF, row=task.row, leave_out=left_out))
    importance = None if task.fit else element_weights(about.weights, frf.frequency_hz, *frf.response.shape[2:])[None]

    def information(robot: Robot, response: Frf) -> tuple[FloatArray, tuple[str, ...]]:
        return measured_information(
            robot,
            response,
            task.delay_s,
            kinds=about.free,
            nuisance=about.along(),
            fixed=about.fixed,
            weights=importance,
            model_error=about.model_error,
            prior_decades=prior_decades(task.fit),
        )

    found = [information(robot, frf) for robot in task.robots]
    matrices, names = np.array([each for each, _ in found]), found[0][1]
    n_real = 0 if frf.realization_error is None else frf.realization_error.shape[1]
    ways = [
        [information(task.robots[0], by_realizations(frf, half, task.pooled))[0] for half in way]
        for way in halves(n_real)
    ]
    shape = (len(ways), 2, *matrices.shape[1:])
    return CandidateInformation(matrices, names, frf.configurations, np.array(ways).reshape(shape), _fitted(task, frf))


def _fitted(task: MeasuredTask, frf: Frf) -> FittedInformation | None:
    """What the fit that the design is for makes of one candidate, under each draw."""
    about, options, weights = task.about, task.fit, task.weights
    if options is None or weights is None:
        return None
    if not options.correct_torques:
        frf = without_torques(frf)
    correlated = options.weights.kind == "optimal_full"
    found = [
        fitted_information(
            robot,
            frf,
            task.delay_s,
            weights,
            whitening=make_whitening(frf, weights > 0, options.residual) if correlated else None,
            residual=options.residual,
            kinds=about.free,
            nuisance=about.along(),
            fixed=about.fixed,
            model_error=max(about.model_error, float(assumed_error(options.weights))),
            prior_decades=prior_decades(options),
        )[0]
        for robot in task.robots
    ]
    return _joined(found, axis=0)


def without_torques(frf: Frf) -> Frf:
    """A response whose compensated torques are taken for granted."""
    return replace(frf, sensitivity=frf.sensitivity[:, :0], coefficient_relative_std=np.zeros(0))


def element_weights(weights: DesignWeights, frequency_hz: FloatArray, n_out: int, n_in: int) -> FloatArray:
    """Weights (n_freq, n_out, n_in)."""
    element = np.where(np.eye(n_out, n_in) > 0, 1.0, weights.off_diagonal)
    return np.asarray(element * (frequency_hz >= weights.low_cut_hz)[:, None, None])


def prior_decades(fit: ElasticOptions | None) -> float:
    """What the fit takes as known of springs, dampers and link inertias; nothing without one [decades]."""
    return math.inf if fit is None else fit.prior_decades
