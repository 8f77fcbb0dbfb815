"""The information of a design's candidates: assumed or measured, one task for a few of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.measured import fitted_information, measured_information
from robid.design.configurations.stability import halves
from robid.design.configurations.visits import FittedInformation
from robid.errors import DataError
from robid.frf.covariance import by_realizations
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.weights import assumed_error, make_whitening
from robid.pipeline.design_tasks import (
    UNREAD,
    AssumedTask,
    MeasuredTask,
    design_point,
    design_tasks,
    element_weights,
    prior_decades,
    without_torques,
)
from robid.pipeline.stage import Job
from robid.robot.description import Robot
from robid.settings.experiment import Design


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


def gather_information(job: Job) -> CandidateInformation:
    """Computes the information of all candidates, in parallel and with little memory.

    Raises:
        SettingsError: If the parameters or candidates cannot be had.
        DataError: If a covariance has no inverse.
    """
    design = job.loaded.experiment.designs[job.owner]
    knowledge = design_point(job, design)[2]
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
