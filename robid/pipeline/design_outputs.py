"""What a design's model is to predict: which output, and in which configurations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.design.configurations.candidates import choose_parameters, relative_derivatives
from robid.design.configurations.options import OutputName
from robid.design.configurations.outputs import ResonanceLines, output_errors
from robid.design.configurations.predicted import Lacking
from robid.design.configurations.prediction import PredictionParts, predicted_means
from robid.errors import DataError
from robid.pipeline.configurations import configurations_of
from robid.pipeline.design_prediction import gather_prediction, lacking_at, nominal_frf, options_of, thinned
from robid.pipeline.design_tasks import AssumedTask, element_weights, tasks_at
from robid.pipeline.stage import Job
from robid.robot.description import Robot, Sensor
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters

_PLACES = 100  # In which outputs other than the response are predicted, at most
_FEW_PLACES = 20  # The same of resonances beside another output
_CHUNK = 5  # Configurations whose resonances have lines in common
_SEED = 1
_LIGHTLY = 1e-5  # Of the dampers: a resonance as sharp as this is its pole

Means: TypeAlias = tuple[FloatArray, FloatArray, float]


def predicted_there(job: Job, parts: PredictionParts, between: FloatArray, candidates: FloatArray) -> PredictionParts:
    """Parts with the means over what a design's model is to predict, where it says so.

    Raises:
        DataError: If resonances are to be predicted, and none lies in the band.
    """
    design, places = job.loaded.experiment.designs[job.owner], _places(job, candidates)
    if design.predict != "response":
        found = with_output(job, parts, design.predict, _some(places, _PLACES))
        if found is None:
            low, high = (float(each) for each in _band_hz(tasks_at(job, places[:1])[0]))
            message = f"D605 `predict: resonances`, but the robot file has no resonance from {low:.3g} to {high:.3g} Hz"
            remedy = "Excite a band with the robot's resonances, or predict the response."
            raise DataError(message, remedy=remedy)
        return found
    if design.predict_at is None:
        return parts
    there = gather_prediction(job, tasks_at(job, places), between)
    return parts.predicting(there.own, there.mixed, there.whole)


def with_resonances(job: Job, parts: PredictionParts, candidates: FloatArray) -> PredictionParts | None:
    """Parts with means over the resonances in some places, whatever is to be predicted; None where there are none."""
    return with_output(job, parts, "resonances", _some(_places(job, candidates), _FEW_PLACES))


def with_output(job: Job, parts: PredictionParts, output: OutputName, places: FloatArray) -> PredictionParts | None:
    """Parts with means over an output in places (n_place, n_joint) [rad]; None where there is no resonance."""
    # Resonances have lines of their own in each place: fewer at once.
    parted = tasks_at(job, places, _CHUNK) if output == "resonances" else tasks_at(job, places)
    tasks = [_Part(task, output) for task in parted]
    made: Callable[[Any], list[Means]] = _made
    rows = [row for found in job.map(made, tasks, lambda _index, _result: None) for row in found]
    if not rows:
        return None
    own, mixed, whole = (np.mean(each, axis=0)[None] for each in zip(*rows, strict=True))
    return parts.predicting(own, mixed, whole)


def _places(job: Job, candidates: FloatArray) -> FloatArray:
    """Configurations in which a design's model is to predict."""
    name = job.loaded.experiment.designs[job.owner].predict_at
    return candidates if name is None else configurations_of(job.loaded, job.loaded.experiment.campaigns[name], {})


def _some(places: FloatArray, most: int) -> FloatArray:
    """Some of them at random, where they are more."""
    if len(places) <= most:
        return places
    return places[np.sort(np.random.default_rng(_SEED).choice(len(places), most, replace=False))]


@dataclass(frozen=True)
class _Part:
    """A task by its output."""

    task: AssumedTask
    output: OutputName


def _made(part: _Part) -> list[Means]:
    return output_means(part.task, part.output)


def output_means(task: AssumedTask, output: OutputName) -> list[Means]:
    """Means over an output in each configuration that has any: `own`, `mixed`, `whole` of `PredictionParts`."""
    robot, about = task.robots[0], task.about
    if output == "resonances":
        return _resonance_means(task)
    task = thinned(task)
    tool = _trackers(robot.payload.com_m) if output == "tool_displacement" else ()
    names = tuple(sensor.name for sensor in tool)
    seen = replace(robot, sensors=tool)
    frf = nominal_frf(seen, task, names)
    where = task.configurations, task.frequency_hz, task.sampling_period_s, task.delay_s
    wanted = choose_parameters(robot, about.free, about.along(), about.fixed)
    own = relative_derivatives(seen, *where, wanted, names or None)
    lacking = lacking_at(seen, frf, options_of(task), task.delay_s)
    heard = element_weights(about.weights, task.frequency_hz, 1, 1)[:, 0]
    found = []
    for response, j, h in zip(frf.response, own, lacking.columns, strict=True):
        moved, off = (output_errors(output, response, columns) for columns in (j, h))
        found.append(_of_one(moved, off, lacking, heard))
    return found


def _of_one(own: ComplexArray, further: ComplexArray, lacking: Lacking, weights: FloatArray) -> Means:
    # An output that may be off by more than its size says nothing, see `Lacking.share`.
    share = 1 / (1 + np.abs(further) ** 2 @ (lacking.std**2 + lacking.cluster_std**2))
    return predicted_means(own, further, weights * share, lacking.root)


def _resonance_means(task: AssumedTask) -> list[Means]:
    about, robot = task.about, task.robots[0]
    bare = undamped(robot)
    wanted = choose_parameters(robot, about.free, about.along(), about.fixed)
    lines = _resonance_lines(bare, task)
    if not any(each.omega.size for each in lines):
        return []
    # Configurations have their lines in common, each looks at its own.
    task = replace(task, frequency_hz=np.concatenate([each.frequency_hz for each in lines]))
    where = task.configurations, task.frequency_hz, task.sampling_period_s, task.delay_s
    own = relative_derivatives(bare, *where, wanted)
    lacking = lacking_at(bare, nominal_frf(bare, task), options_of(task), task.delay_s)
    found, begin = [], 0
    for each, j, h in zip(lines, own, lacking.columns, strict=True):
        here = slice(begin, begin + 2 * each.omega.size)
        begin = here.stop
        if each.omega.size:
            moved, off = (each.errors(columns[here]).astype(complex) for columns in (j, h))
            found.append(_of_one(moved, off, lacking, np.ones((each.omega.size, 1))))
    return found


def _resonance_lines(robot: Robot, task: AssumedTask) -> list[ResonanceLines]:
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, task.configurations))
    parameters, band = nominal_parameters(robot, linear, task.delay_s), _band_hz(task)
    return [ResonanceLines.of(linear, parameters, index, band) for index in range(len(task.configurations))]


def _band_hz(task: AssumedTask) -> FloatArray:
    """Lowest and highest line [Hz]."""
    return np.array([task.frequency_hz.min(), task.frequency_hz.max()])


def undamped(robot: Robot) -> Robot:
    """The robot with hardly any dampers and no viscous friction."""
    joints = (
        replace(
            joint,
            arm_viscous=0.0,
            motor=replace(joint.motor, friction=replace(joint.motor.friction, viscous_nms_rad=0.0)),
        )
        for joint in robot.joints
    )
    springs = tuple(replace(spring, damping=_LIGHTLY * spring.damping) for spring in robot.springs)
    return replace(robot, joints=tuple(joints), springs=springs)


def _trackers(point_m: FloatArray) -> tuple[Sensor, ...]:
    """Sensors of the motion of the payload's point (3,) [m] along the world's axes."""
    axes = zip("xyz", np.eye(3), strict=True)
    return tuple(Sensor(f"tool_{name}", "tracker", None, point_m, axis) for name, axis in axes)
