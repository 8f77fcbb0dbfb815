"""Fastest steps of one axis at a time: the true robot under control that each model designs, and its prediction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
from scipy.optimize import brentq

from robid.arrays import FloatArray, Quantity, check_shape
from robid.artifacts.kinds import TASK, to_datasets
from robid.artifacts.store import read_artifact
from robid.errors import SettingsError
from robid.models.elastic.fit.solution import with_estimates
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.robot.inverse import inverse_motion
from robid.robot.linearize import Equilibrium, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.settings.experiment import RandomConfigurations
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.settings.sources import true_robot_of
from robid.signals.waveforms import PEAK_ACCELERATION, PEAK_SNAP, smooth_step, step_duration_s
from robid.simulate.engine import true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.playback import Playback, play, turned_tool, with_tool_point
from robid.studies.settings.study import StepOptions, ZimmermannStudy
from robid.studies.simulated import simulate_options
from robid.studies.study import Content, Earlier, Task, study_of

_AFTER_S = 0.1
_LONGEST_RAMP_S = 10.0


@dataclass(frozen=True)
class StepProfile:
    """The commanded step of one axis."""

    size_rad: float  # Size with its sign, arm side [rad]
    speed_rad_s: float  # Largest speed, arm side [rad/s]
    ramp_s: float  # Duration of each ramp [s]

    @property
    def duration_s(self) -> float:
        """How long the move lasts [s]."""
        return step_duration_s(self.size_rad, self.speed_rad_s, self.ramp_s)


def step_profiles(
    robot: Robot, controller: Controller, simulation: SimulateOptions, configurations: FloatArray, options: StepOptions
) -> list[list[StepProfile]]:
    """Finds the fastest step of every axis in every configuration (n_conf, n_joint) [rad] of a robot that must follow.

    Returns:
        Profiles by configuration and axis; downwards where the upper joint limit is too near.

    Raises:
        SettingsError: If a motor cannot hold the robot at rest, or a step outlasts the time that is compared.
    """
    at_rest = replace(simulation, steps_per_sample=1)
    model = true_model(robot, controller, at_rest, sensors=False)
    rest = solve_statics(model, configurations)
    limit = options.torque_share * np.array([joint.motor.max_torque_nm for joint in robot.joints])
    problems, profiles = [], []
    for index, configuration in enumerate(configurations):
        spare = limit - np.abs(rest.motor_torque[index])
        if not (spare > 0).all():
            motor = robot.joints[int(spare.argmin())].name
            problems.append(f"S344 configuration {index + 1}: gravity takes more than `torque_share` of motor {motor}")
            continue
        row = [
            _profile(robot, demand, spare, float(configuration[axis]), axis, options)
            for axis, demand in enumerate(_demands(model, rest, index))
        ]
        problems += [
            f"S345 configuration {index + 1}: the step of {joint.name} lasts {profile.duration_s:.2f} s"
            for joint, profile in zip(robot.joints, row, strict=True)
            if profile.duration_s + _AFTER_S > options.duration_s
        ]
        profiles.append(row)
    if problems:
        remedy = "choose smaller steps, a higher speed, a longer duration_s or other configurations"
        raise SettingsError("; ".join(problems), where="steps", remedy=remedy)
    return profiles


def _demands(model: ElasticModel, rest: Equilibrium, index: int) -> list[tuple[FloatArray, FloatArray]]:
    """Motor torques of each axis' acceleration [N m s^2/rad] and of its second derivative [N m s^4/rad]."""
    data = mujoco.MjData(model.mujoco)
    data.qpos[:] = rest.position[index]
    mujoco.mj_forward(model.mujoco, data)
    mass = np.zeros((model.mujoco.nv, model.mujoco.nv))
    mujoco.mj_fullM(model.mujoco, data, mass)
    arm = mass[np.ix_(model.arm, model.arm)]
    robot = model.robot
    inertia = robot.motor_inertia_kgm2[:, None] * robot.motor_per_arm
    slope = np.full(len(model.arm), np.inf)
    factors = model.varying.factors(rest.position[index]).tolist()
    for spring, deflection, factor in zip(robot.springs, rest.deflection[index].tolist(), factors, strict=True):
        if spring.place == "transmission":
            slope[spring.joint] = factor * (spring.stiffness + 3 * spring.cubic * deflection**2)
    rigid, elastic = inertia + robot.arm_per_motor.T @ arm, inertia @ (arm / slope[:, None])
    return list(zip(np.abs(rigid.T), np.abs(elastic.T), strict=True))


def _profile(
    robot: Robot,
    demand: tuple[FloatArray, FloatArray],
    spare: FloatArray,
    angle: float,
    axis: int,
    options: StepOptions,
) -> StepProfile:
    turns = robot.motor_per_arm[:, axis]
    allowed = np.minimum(options.peak_motor_speed_rad_s, [joint.motor.max_speed_rad_s for joint in robot.joints])
    speed = float((allowed / np.maximum(np.abs(turns), 1e-12)).min())
    size = options.step_m if robot.joints[axis].type == "prismatic" else float(np.deg2rad(options.step_deg))
    sign = -1.0 if angle + size > robot.upper[axis] else 1.0

    def excess(ramp_s: float) -> float:
        needed = demand[0] * (PEAK_ACCELERATION * speed / ramp_s) + demand[1] * (PEAK_SNAP * speed / ramp_s**3)
        return float((needed / spare).max()) - 1

    ramp = options.shortest_ramp_s
    if excess(ramp) > 0:
        ramp = float(brentq(excess, ramp, _LONGEST_RAMP_S)) if excess(_LONGEST_RAMP_S) < 0 else _LONGEST_RAMP_S
    return StepProfile(sign * size, speed, ramp)


_OVERSAMPLING = 4
_LEAD_SAMPLES = 20


@dataclass(frozen=True)
class StepBench:
    """What all configurations share."""

    true: Robot  # The true robot with its tool point, without the imperfections
    models: Mapping[str, Robot]  # The models by name, with the same tool point
    controller: Controller  # The controller of all of them
    simulation: SimulateOptions  # Imperfections of the true robot
    duration_s: float  # Time from the beginning of the steps [s]

    @property
    def time_s(self) -> FloatArray:
        """Times of the controller's samples (n_time,), 0 where the steps begin [s]."""
        period = self.controller.sampling_period_s
        return period * np.arange(-_LEAD_SAMPLES, round(self.duration_s / period) + 1)


@dataclass(frozen=True)
class StepTask:
    """One configuration."""

    index: int
    configuration: FloatArray  # (n_joint,) arm-side angles that the encoders show at rest [rad]
    profiles: Sequence[StepProfile]  # Step of each axis


def run_steps(bench: StepBench, task: StepTask) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Steps every axis of one configuration with every model.

    Returns:
        Commanded displacement of the tool point (n_axis, n_time, 3) [m]; displacement of that of the true robot and of
        the model (2, n_model, n_axis, n_time, 3) [m]; torque of the stepped axis of both (2, n_model, n_axis, n_time)
        [N m].
    """
    tools, torques = [], []
    friction = bench.simulation.imperfections.friction
    # A model knows its own springs and friction; noise, ripple and the rest are the true robot's alone.
    ideal = SimulateOptions(Imperfections(friction=friction), steps_per_sample=bench.simulation.steps_per_sample)
    for robot in bench.models.values():
        motion = step_control(robot, bench, task)
        sides = [
            play(each, bench.controller, options, task.configuration, task.index, motion)
            for each, options in ((bench.true, bench.simulation), (robot, ideal))
        ]
        tools.append([(side.tool - side.tool[0]).swapaxes(0, 1) for side in sides])
        axes = np.arange(len(task.profiles))
        torques.append([side.torque[:, axes, axes].T for side in sides])  # of each simulation's own axis
    model = true_model(bench.true, bench.controller, replace(bench.simulation, steps_per_sample=1), sensors=False)
    rest = solve_statics(model, task.configuration[None])
    steps = [smooth_step(bench.time_s, one.size_rad, one.speed_rad_s, one.ramp_s)[0] for one in task.profiles]
    paths = np.array([turned_tool(model, rest, axis, angle) for axis, angle in enumerate(steps)])
    return paths, np.array(tools).swapaxes(0, 1), np.array(torques).swapaxes(0, 1)


def step_control(robot: Robot, bench: StepBench, task: StepTask) -> Playback:
    """Designs motor motions and feed-forward torques with a model, one simulation per axis.

    Torque commands aim at the middle of the time for which they are held, after the controller's delay; the
    reference is known that far ahead.
    """
    model = build_model(robot, balanced=True)
    rest = solve_statics(model, task.configuration[None])
    period, delay, n_time = bench.controller.sampling_period_s, bench.controller.delay_samples, bench.time_s.size
    fine = bench.time_s[0] + period / _OVERSAMPLING * np.arange(_OVERSAMPLING * (n_time + delay) + 1)
    now = _OVERSAMPLING * np.arange(n_time)
    held = now + _OVERSAMPLING * delay + _OVERSAMPLING // 2
    law = [joint.motor.friction for joint in robot.joints]
    coulomb = np.array([each.coulomb_nm for each in law]) * (bench.simulation.imperfections.friction != "none")
    smooth = np.array([each.stribeck_rad_s for each in law])
    angles, torques = [], []
    for axis, profile in enumerate(task.profiles):
        arm = np.zeros((3, fine.size, len(robot.joints)))
        arm[..., axis] = smooth_step(fine, profile.size_rad, profile.speed_rad_s, profile.ramp_s)
        found = inverse_motion(model, rest, arm, period / _OVERSAMPLING, _OVERSAMPLING)
        rate = np.gradient(found.angle, period / _OVERSAMPLING, axis=0)
        angles.append(found.angle[now])
        torques.append((found.torque + coulomb * np.tanh(rate / smooth))[held])
    return Playback(np.stack(angles, axis=1), np.stack(torques, axis=1))


_PATH, _STEPPED = "configuration axis time xyz", "model configuration axis time"
_MOVED = f"model {_PATH}"
_TREND = 3  # degree; the feedback's slow settling is no vibration

Map = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]


@dataclass(frozen=True)
class StepResponses:
    """What the tool point and the stepped axis' motor did; arrays begin with (n_model, n_conf, n_axis)."""

    time_s: Annotated[FloatArray, Quantity("s", "time", "Time from the beginning of the step")]
    models: Annotated[tuple[str, ...], Quantity("1", "model", "Name of each model")]
    axes: Annotated[tuple[str, ...], Quantity("1", "axis", "Name of each stepped axis")]
    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side angles at rest")]
    move_s: Annotated[FloatArray, Quantity("s", "configuration axis", "How long the commanded move lasts")]
    path: Annotated[FloatArray, Quantity("m", _PATH, "Displacement of the tool point of a rigid robot")]
    tool_true: Annotated[FloatArray, Quantity("m", _MOVED, "Displacement of the true tool point", compact=True)]
    tool_model: Annotated[FloatArray, Quantity("m", _MOVED, "What the model predicts", compact=True)]
    torque_true: Annotated[FloatArray, Quantity("N m", _STEPPED, "Torque of the stepped axis", compact=True)]
    torque_model: Annotated[FloatArray, Quantity("N m", _STEPPED, "What the model predicts", compact=True)]

    @property
    def size_m(self) -> FloatArray:
        """How far each step (n_conf, n_axis) moves the tool point [m]."""
        return np.asarray(np.linalg.norm(self.path[..., -1, :], axis=-1))

    @property
    def tool_error_m(self) -> FloatArray:
        """Distance (n_model, n_conf, n_axis, n_time) of the predicted from the true tool point [m]."""
        return np.asarray(np.linalg.norm(self.tool_true - self.tool_model, axis=-1))

    @property
    def path_error_m(self) -> FloatArray:
        """Distance (n_model, n_conf, n_axis, n_time) of the true tool point from the commanded path in time [m]."""
        return np.asarray(np.linalg.norm(self.tool_true - self.path, axis=-1))

    @property
    def vibration_m(self) -> FloatArray:
        """Root mean square vibration (n_model, n_conf, n_axis) of the true tool point after the move [m]."""
        result = np.empty(self.tool_true.shape[:3])
        for configuration, axis in np.ndindex(self.move_s.shape):
            after = self.time_s >= self.move_s[configuration, axis]
            shown = self.tool_true[:, configuration, axis, after]
            basis = np.linalg.qr(np.vander(self.time_s[after], _TREND + 1))[0]
            left = shown - basis @ (basis.T @ shown)
            result[:, configuration, axis] = np.sqrt((left**2).sum(axis=-1).mean(axis=-1))
        return result


def step_responses(
    true: Robot,
    models: Mapping[str, Robot],
    controller: Controller,
    simulation: SimulateOptions,
    configurations: FloatArray,
    options: StepOptions,
    tool_m: FloatArray | None = None,
    parallel_map: Map | None = None,
) -> StepResponses:
    """Steps every axis in turn in every configuration, on the true robot and on the models.

    Each model turns the commanded motion, the same for all, into motor motion and feed-forward torque by inverting
    its flexible joints: gravity, inertia, viscous and, where the simulated robot has it, Coulomb friction. The true
    robot and the model itself then run under this feed-forward and the same feedback.

    The true robot is given without the imperfections of its simulation. Encoders show arm-side configurations (n_conf,
    n_joint) at rest [rad]; the tool point (3,) in the last joint's frame is the payload's centre of mass by default
    [m]. An ordered map runs the configurations.

    Raises:
        SettingsError: If a step outlasts the time that is compared, or a motor cannot hold the robot at rest.
        DataError: If a robot finds no equilibrium or a simulation blows up.

    Source:
        Zimmermann et al. (2023), sec. V-E; docs/methods, sec. 10.
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(true.joints))
    point = true.payload.com_m if tool_m is None else tool_m
    robots = {name: with_tool_point(robot, point) for name, robot in models.items()}
    robot = with_tool_point(true, point)
    profiles = step_profiles(robot, controller, simulation, configurations, options)
    bench = StepBench(robot, robots, controller, simulation, options.duration_s)
    tasks = [StepTask(index, *pair) for index, pair in enumerate(zip(configurations, profiles, strict=True))]
    run = partial(run_steps, bench)
    parts = parallel_map(run, tasks) if parallel_map else [run(task) for task in tasks]
    path, tool, torque = zip(*parts, strict=True)
    tool_true, tool_model = np.stack(tool, axis=2)
    torque_true, torque_model = np.stack(torque, axis=2)
    return StepResponses(
        time_s=bench.time_s,
        models=tuple(models),
        axes=tuple(joint.name for joint in true.joints),
        configurations=configurations,
        move_s=np.array([[profile.duration_s for profile in row] for row in profiles]),
        path=np.array(path),
        tool_true=tool_true,
        tool_model=tool_model,
        torque_true=torque_true,
        torque_model=torque_model,
    )


def step_figures(responses: StepResponses) -> dict[str, dict[str, float]]:
    """Sums up the errors of every model over configurations and axes: root mean squares and largest ones.

    Returns:
        By model and name: errors of the predicted displacement of the tool, `tool_*`, and deviations of the true tool
        from the commanded path, `path_*` [m]; errors of the predicted torque of the stepped axis, `torque_*` [N m];
        vibration of the true tool after the moves [m]. What is `relative` is over the size of its step, or over the
        root mean square of the torque's change from rest.
    """

    def rms(values: FloatArray) -> float:
        return float(np.sqrt(np.mean(values**2)))

    size, errors = responses.size_m, responses.torque_model - responses.torque_true
    moved = responses.torque_true - responses.torque_true[..., :1]
    every = zip(responses.tool_error_m, responses.path_error_m, responses.vibration_m, errors, moved, strict=True)
    return {
        name: {
            "tool_rms_m": rms(tool),
            "tool_max_m": float(tool.max()),
            "tool_relative": rms(tool / size[..., None]),
            "torque_rms_nm": rms(torque),
            "torque_max_nm": float(np.abs(torque).max()),
            "torque_relative": rms(torque) / rms(change),
            "path_rms_m": rms(path),
            "path_max_m": float(path.max()),
            "vibration_m": rms(vibration),
            "vibration_relative": rms(vibration / size),
        }
        for name, (tool, path, vibration, torque, change) in zip(responses.models, every, strict=True)
    }


NOMINAL = "robot file"


def step_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual; none where the study steps no model."""
    study = study_of(run.loaded, ZimmermannStudy)
    if not study.stepped:
        return []
    found, names = [], list(study.models)
    for number, campaign_name in enumerate(study.estimation):
        campaign = run.loaded.experiment.campaigns[campaign_name]
        robot = run.loaded.robot.to_robot(campaign.payload_kg)
        simulation = simulate_options(campaign)
        paths = dict(zip(names, earlier[1].paths[number * len(names) :], strict=False))
        used = {name: paths[name] for name in study.stepped}
        true = true_robot_of(run.loaded.robot, campaign.payload_kg, simulation.truth)
        wanted = RandomConfigurations(count=study.steps.configurations, seed=study.steps.seed)
        drawn, controller = draw_in_reach(run.loaded, robot, wanted), require_controller(run.loaded)
        decides = {
            "models": {name: path.name for name, path in used.items()},
            "source": plain_settings(campaign.source),
            "steps": plain_settings(study.steps),
            "payload_kg": campaign.payload_kg,
            **robot_settings(run.loaded, "mechanics", "range", "motor_limits", "friction", "controller"),
        }
        arguments = robot, true, used, controller, simulation, drawn, study.steps
        found.append(Task(f"steps_{number + 1}", decides, arguments))
    return found


def step(
    robot: Robot,
    truth: Robot,
    models: Mapping[str, Path],
    controller: Controller,
    simulation: SimulateOptions,
    configurations: FloatArray,
    options: StepOptions,
) -> Content:
    """Steps every axis in every configuration under control that each model designs, the robot file's beside."""
    robots = {}
    for name, path in models.items():
        held = read_artifact(path, TASK).datasets
        names, *values = (held[key].values.tolist() for key in ("names", "estimate", "nominal"))
        robots[name] = with_estimates(robot, *(dict(zip(names, each, strict=True)) for each in values))
    robots[NOMINAL] = robot
    return Content(*to_datasets(step_responses(truth, robots, controller, simulation, configurations, options)))
