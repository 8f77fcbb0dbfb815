"""The tasks of a design: some candidates by assumed errors, or one by its response, with what they read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, read_outline
from robid.design.configurations.options import DesignWeights, InformationOptions
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import fitted_delay_s, fitted_robot
from robid.models.elastic.fit.weights import make_weights
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
    fit: ElasticOptions | None = None
    drive_unit: str = "N m"  # Of the responses that a fit would have; without known torques, gains are nothing's error


@dataclass(frozen=True)
class MeasuredTask(_Task):
    """One candidate, by its response."""

    frf: Path
    row: int
    pooled: int
    fit: ElasticOptions | None
    weights: FloatArray | None


def design_tasks(job: Job, candidates: IntArray | None = None) -> Sequence[AssumedTask | MeasuredTask]:
    """Tasks of all candidates of a design, or of some."""
    design = job.loaded.experiment.designs[job.owner]
    robot, delay, _ = design_point(job, design)
    robots = tuple(_drawn(robot, about_options(job.loaded.experiment, design)))
    if design.information == "measured":
        return _measured(job, robots, delay, candidates)
    return _assumed(job, robots, delay, candidates)


@dataclass(frozen=True)
class Knowledge:
    """What an earlier fit found of log-parameters."""

    names: tuple[str, ...]
    covariance: FloatArray

    def about(self, names: tuple[str, ...]) -> FloatArray:
        """Information about some of them, whatever the others are."""
        chosen = [self.names.index(name) for name in names]
        return np.asarray(np.linalg.inv(self.covariance[np.ix_(chosen, chosen)]))


def design_point(job: Job, design: Design) -> tuple[Robot, float, Knowledge | None]:
    """Robot and delay at which derivatives are taken, and what is known beforehand."""
    campaign = job.loaded.experiment.campaigns[design.campaign]
    robot, delay = job.loaded.robot.to_robot(campaign.payload_kg), delay_s(job.loaded, campaign)
    if design.prior is None:
        return robot, delay, None
    solution = solution_from_artifact(read_artifact(job.inputs["model"], MODEL))
    # Its covariance is as wide as its intervals: a misfit is in it already.
    knowledge = Knowledge(solution.estimate.names, solution.internal.covariance)
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


def tasks_at(job: Job, configurations: FloatArray, size: int = _CHUNK) -> Sequence[AssumedTask]:
    """Tasks of other configurations (n_conf, n_joint) [rad] than a design's own, by assumed errors, `size` each."""
    design = job.loaded.experiment.designs[job.owner]
    robot, delay, _ = design_point(job, design)
    found = _assumed_at(job, (robot,), delay, configurations, size)
    if design.information == "assumed":
        return found
    unit = frf_from_artifact(read_artifact(job.inputs["frf"], FRF, row=0, leave_out=UNREAD)).input_unit
    return [replace(task, drive_unit=unit) for task in found]


def _assumed_at(
    job: Job, robots: tuple[Robot, ...], delay: float, candidates: FloatArray, size: int = _CHUNK
) -> list[AssumedTask]:
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    period = campaign_sampling_s(job.loaded, campaign)
    frequency_hz = campaign_lines(job.loaded, campaign)[0] / campaign.excitation.period_s
    parts = [candidates[begin : begin + size] for begin in range(0, len(candidates), size)]
    about, fit = about_options(job.loaded.experiment, design), fit_options(job.loaded.experiment, design)
    return [AssumedTask(robots, about, delay, part, frequency_hz, period, fit) for part in parts]


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
