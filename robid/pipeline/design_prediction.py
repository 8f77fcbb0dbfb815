"""What a design's candidates add to a fit whose model may lack something: one task for a few of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.configurations.candidates import choose_parameters
from robid.design.configurations.measured import Derivatives
from robid.design.configurations.predicted import Lacking, assumed_prediction, measured_prediction
from robid.design.configurations.prediction import PredictionParts, joined
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.linear import Basis, list_linearised
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.weights import assumed_error, make_whitening
from robid.pipeline.design_tasks import (
    UNREAD,
    AssumedTask,
    MeasuredTask,
    element_weights,
    prior_decades,
    without_torques,
)
from robid.pipeline.stage import Job
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.quantities import Channel, motor_channels


@dataclass(frozen=True)
class _Part:
    """A task, with what is known of the candidates' differences."""

    task: AssumedTask | MeasuredTask
    between: FloatArray  # (n_wanted,) Deviation of each wanted parameter between configurations


def gather_prediction(job: Job, tasks: Sequence[AssumedTask | MeasuredTask], between: FloatArray) -> PredictionParts:
    """Computes what candidates add to a fit, and how a model predicts all of them; parameters differ by (n_param,).

    Raises:
        DataError: If a covariance has no inverse.
    """
    parts = [_Part(task, between) for task in tasks]
    job.progress.expect(len(parts), "predictions")
    made: Callable[[Any], tuple[PredictionParts, int]] = _made
    found = job.map(made, parts, lambda _index, _result: job.progress.advance())
    return joined([each for each, _ in found], [count for _, count in found])


def _made(part: _Part) -> tuple[PredictionParts, int]:
    task = part.task
    if isinstance(task, MeasuredTask):
        return _measured(task, part.between), 1
    return assumed_parts(task, part.between), len(task.configurations)


_LINES = 20
"""Lines that are looked at, at least: errors of predictions are means over all of them."""


def thinned(task: AssumedTask) -> AssumedTask:
    """The same with fewer lines."""
    return replace(task, frequency_hz=task.frequency_hz[:: _step(task)])


def _step(task: AssumedTask) -> int:
    return max(1, task.frequency_hz.size // _LINES)


def assumed_parts(task: AssumedTask, between: FloatArray) -> PredictionParts:
    """Computes what some candidates add to a fit by assumed errors, and how a model predicts all of these."""
    about, robot = task.about, task.robots[0]
    step = _step(task)
    task = thinned(task)
    wanted = choose_parameters(robot, about.free, about.along(), about.fixed)
    frf = nominal_frf(robot, task)
    return assumed_prediction(
        robot,
        task.configurations,
        task.frequency_hz,
        task.sampling_period_s,
        task.delay_s,
        # Each line stands for its neighbours, too.
        about.assumed_relative_error / np.sqrt(step),
        wanted,
        element_weights(about.weights, task.frequency_hz, *frf.response.shape[2:]),
        lacking_at(robot, frf, options_of(task), task.delay_s),
        between,
    )


def _measured(task: MeasuredTask, between: FloatArray) -> PredictionParts:
    about, robot = task.about, task.robots[0]
    frf = frf_from_artifact(read_artifact(task.frf, FRF, row=task.row, leave_out=(*UNREAD, "realization_error")))
    options = options_of(task)
    frf = frf if options.correct_torques else without_torques(frf)
    importance = element_weights(about.weights, frf.frequency_hz, *frf.response.shape[2:])
    # Without a fit's own weights, those of independent errors.
    weights = importance * np.abs(frf.response) ** 2 / frf.element_variance() if task.weights is None else task.weights
    correlated = task.fit is not None and options.weights.kind == "optimal_full"
    model_error = (
        about.model_error if task.fit is None else max(about.model_error, float(assumed_error(options.weights)))
    )
    wanted = about.free, about.along(), about.fixed, prior_decades(task.fit)
    return measured_prediction(
        Derivatives(robot, frf, task.delay_s, model_error, *wanted),
        weights,
        importance,
        lacking_at(robot, frf, options, task.delay_s),
        between,
        residual=options.residual,
        whitening=make_whitening(frf, weights > 0, options.residual) if correlated else None,
    )


def options_of(task: AssumedTask | MeasuredTask) -> ElasticOptions:
    """Options of the fit that a design is for, about the design's own parameters."""
    about = task.about
    return replace(task.fit or ElasticOptions(), free=(*about.free, *about.along()), fixed=about.fixed)


def nominal_frf(robot: Robot, task: AssumedTask, tool: tuple[str, ...] = ()) -> Frf:
    """The response of the robot file in some candidates, without errors; at the tool by trackers, where named."""
    names = tuple(joint.name for joint in robot.joints)
    rest = solve_statics(build_model(robot), task.configurations)
    linear = linearize(build_model(robot), rest, tool or names)
    found = response(linear, nominal_parameters(robot, linear, task.delay_s), task.frequency_hz, task.sampling_period_s)
    n_conf, n_freq, n_out, n_in = found.sampled.shape
    return Frf(
        frequency_hz=task.frequency_hz,
        lines=np.arange(1, n_freq + 1),
        configurations=task.configurations,
        response=found.sampled,
        input_factor=np.broadcast_to(np.eye(n_in, dtype=complex), (n_conf, n_freq, n_in, n_in)),
        element_scale=np.ones((n_conf, n_out, n_in)),
        total_covariance=None,
        noise_covariance=None,
        total_degrees_of_freedom=0.0,
        noise_degrees_of_freedom=0.0,
        sensitivity=np.zeros((n_conf, 0, n_freq, n_out, n_in), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((n_conf, n_in)),
        sampling_period_s=task.sampling_period_s,
        input_channels=tuple(replace(each, unit=task.drive_unit) for each in motor_channels(names, "torque")),
        output_channels=tuple(Channel(name, "acceleration", "m/s^2", "tool") for name in tool)
        or motor_channels(names, "acceleration"),
    )


def lacking_at(robot: Robot, frf: Frf, options: ElasticOptions, delay: float) -> Lacking:
    """What the robot file may have wrong or lack, beside the parameters, by its own priors."""
    # Columns are those of the logarithm, and springs straight: how far they swing is not known yet.
    straight = replace(robot, springs=tuple(replace(spring, cubic=0.0) for spring in robot.springs))
    options = replace(options, estimator="lls", weights=replace(options.weights, kind="user"))
    problem, _ = set_up(straight, frf, options, delay)
    found = list_linearised(problem, [np.zeros(len(problem.parameters.names))], Basis(straight, options))
    if found is None:
        nothing = np.zeros(0)
        return Lacking(np.zeros((*frf.response.shape, 0), complex), nothing, nothing, nothing)
    least = np.array([each.least for each in found.nuisances])
    return Lacking(found.columns, found.common_std, found.cluster_std, least)
