"""How fast each axis can step: the shortest ramps that the motors' torque allows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.optimize import brentq

from robid.arrays import FloatArray
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.linearize import Equilibrium, solve_statics
from robid.robot.model import ElasticModel
from robid.signals.waveforms import PEAK_ACCELERATION, PEAK_SNAP, step_duration_s
from robid.simulate.engine import true_model
from robid.simulate.options import Controller, SimulateOptions
from robid.studies.settings.steps import StepOptions

_AFTER_S = 0.1
_LONGEST_RAMP_S = 10.0


@dataclass(frozen=True)
class StepProfile:
    """The commanded step of one axis.

    Attributes:
        size_rad: Size with its sign, arm side [rad].
        speed_rad_s: Largest speed, arm side [rad/s].
        ramp_s: Duration of each ramp [s].
    """

    size_rad: float
    speed_rad_s: float
    ramp_s: float

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
            problems.append(f"configuration {index + 1}: gravity takes more than `torque_share` of motor {motor}")
            continue
        row = [
            _profile(robot, demand, spare, float(configuration[axis]), axis, options)
            for axis, demand in enumerate(_demands(model, rest, index))
        ]
        problems += [
            f"configuration {index + 1}: the step of {joint.name} lasts {profile.duration_s:.2f} s"
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
