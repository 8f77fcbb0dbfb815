"""The steps of one configuration: the fastest that the motors allow, on the true robot and on each model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.optimize import brentq

from robid.arrays import FloatArray
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.inverse import inverse_motion
from robid.robot.linearize import Equilibrium, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.signals.waveforms import PEAK_ACCELERATION, PEAK_SNAP, smooth_step, step_duration_s
from robid.simulate.engine import true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.playback import Playback, Played, play, turned_tool
from robid.studies.settings.elastic import StepOptions

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
    robot: Robot,
    controller: Controller,
    simulation: SimulateOptions,
    configurations: FloatArray,
    options: StepOptions,
) -> list[list[StepProfile]]:
    """Finds the fastest step of every axis in every configuration.

    Args:
        robot: The robot that must follow, without the imperfections.
        controller: Its controller.
        simulation: Its imperfections.
        configurations (n_conf, n_joint): Arm-side angles at rest [rad].
        options: Size, speed and share of the torque limits.

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


@dataclass(frozen=True)
class StepRun:
    """What happened in one configuration."""

    path: FloatArray  # (n_axis, n_time, 3) commanded displacement of the tool point [m]
    # (2, n_model, n_axis, n_time, 3) displacement of the tool point of the true robot and of the model [m]
    tool: FloatArray
    torque: FloatArray  # (2, n_model, n_axis, n_time) torque of the stepped axis of both [N m]


def run_steps(bench: StepBench, task: StepTask) -> StepRun:
    """Steps every axis of one configuration with every model."""
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
        torques.append([_own_torques(side) for side in sides])
    return StepRun(_paths(bench, task), np.array(tools).swapaxes(0, 1), np.array(torques).swapaxes(0, 1))


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


def _paths(bench: StepBench, task: StepTask) -> FloatArray:
    at_rest = replace(bench.simulation, steps_per_sample=1)
    model = true_model(bench.true, bench.controller, at_rest, sensors=False)
    rest = solve_statics(model, task.configuration[None])
    return np.array(
        [
            turned_tool(model, rest, axis, smooth_step(bench.time_s, p.size_rad, p.speed_rad_s, p.ramp_s)[0])
            for axis, p in enumerate(task.profiles)
        ]
    )


def _own_torques(played: Played) -> FloatArray:
    """Torque of each simulation's own axis (n_axis, n_time)."""
    axes = np.arange(played.torque.shape[1])
    return np.asarray(played.torque[:, axes, axes].T)
