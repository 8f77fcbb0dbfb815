"""The linearised Cartesian position loop: its exact sampled response around a home."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import ElasticModel, build_model, site_name
from robid.robot.response import nominal_parameters, response
from robid.signals.pose import POSE
from robid.simulate.controller import frequency_response, speed_gains
from robid.simulate.options import Controller, PoseInterface
from robid.simulate.pose_loop import tool_sensor
from robid.simulate.pose_path import channel_matrix, command_matrix

_IMAGES = (-2, -1, 0, 1, 2)


def pose_response(
    robot: Robot,
    arm: ToolArm,
    controller: Controller,
    interface: PoseInterface,
    configuration: FloatArray,
    frequency_hz: FloatArray,
    channels: Sequence[str] | None = None,
    measured: str = "motors",
) -> ComplexArray:
    """Response (n_freq, n_channel, n_channel) from commanded to measured pose for small commands around a home.

    The commands are a sequence at the interface's rate: delay, moving average and linear interpolation, the sampled
    cascade and the elastic arm turn it into a measured sequence at that rate. Friction and torque limits are left out.

    Args:
        robot: The elastic robot.
        arm: The rigid arm as the controller knows it.
        controller: Its controller.
        interface: How it takes commands.
        configuration (n_joint,): Home, arm side [rad, or m].
        frequency_hz (n_freq,): Frequencies [Hz].
        channels: Names of the channels; all of the arm by default.
        measured: `motors` or `tool`, see `SimulateOptions.measured_pose`.
    """
    names = arm.channels if channels is None else tuple(channels)
    period_s, count = interface.sampling_period_s, round(interface.sampling_period_s / controller.sampling_period_s)
    omega = 2 * np.pi * np.asarray(frequency_hz, float)
    total = np.zeros((omega.size, len(names), len(names)), complex)
    loop = _MotorLoop(robot, arm, controller, interface, configuration, names, measured)
    for image in _IMAGES:
        # What the sampling at the interface's rate folds back; the interpolation leaves little of it.
        there = omega + 2 * np.pi * image / period_s
        total += interpolated(there * controller.sampling_period_s, count)[:, None, None] * loop.response(there) / count
    late = np.exp(-1j * omega * period_s * interface.delay_samples)
    average = averaged(omega * period_s, interface.moving_average)
    return np.asarray((late * average)[:, None, None] * total)


def averaged(angle: FloatArray, count: int) -> ComplexArray:
    """Response (n,) of a moving average of some samples at angles [rad per sample]."""
    return np.asarray(np.exp(-1j * angle[:, None] * np.arange(count)).mean(axis=1))


def interpolated(angle: FloatArray, count: int) -> ComplexArray:
    """Response (n,) of samples that are held for `count` and averaged over as many: linear interpolation, one late."""
    return np.asarray(count * averaged(angle, count) ** 2)


class _MotorLoop:
    """The linearised closed loop at the controller's rate, from pose references to what is measured."""

    def __init__(
        self,
        robot: Robot,
        arm: ToolArm,
        controller: Controller,
        interface: PoseInterface,
        configuration: FloatArray,
        names: tuple[str, ...],
        measured: str,
    ) -> None:
        self._controller, self._feedforward = controller, interface.speed_feedforward
        self._robot = robot
        model = build_model(replace(robot, sensors=(*robot.sensors, tool_sensor(arm))), balanced=True)
        rest = solve_statics(model, configuration[None])
        linear = linearize(model, rest)
        self._told = robot.motor_per_arm @ command_matrix(arm, names, configuration)
        rows: FloatArray = channel_matrix(arm, names, configuration) @ robot.arm_per_motor @ model.motor_rows
        if measured == "tool":
            rows = _true_rows(model, arm, names, configuration, rest.position[0])
        # First the motors, which the loop is closed by, then what is measured.
        output = np.concatenate([linear.output[0], rows @ model.to_spring])
        self._linear = replace(linear, output=output[None], tilt=np.zeros_like(output)[None])
        delay_s = controller.delay_samples * controller.sampling_period_s
        self._parameters = nominal_parameters(robot, linear, delay_s)

    def response(self, omega: FloatArray) -> ComplexArray:
        """Response (n_freq, n_channel, n_channel) at angular frequencies of either sign [rad/s]."""
        period_s, n_motor = self._controller.sampling_period_s, self._linear.n_motor
        size = np.abs(omega)
        sampled = response(self._linear, self._parameters, size / (2 * np.pi), period_s).sampled[0]
        plant = -sampled / (size**2)[:, None, None]
        reference, feedback = frequency_response(
            self._controller, self._robot.motor_inertia_kgm2, size, "position_reference"
        )
        reference = reference + self._speed_share(size)
        identity = np.eye(n_motor)
        torque = np.linalg.solve(
            identity + feedback[:, :, None] * plant[:, :n_motor], reference[:, :, None] * self._told
        )
        found = plant[:, n_motor:] @ torque
        return np.asarray(np.where((omega < 0)[:, None, None], found.conj(), found))

    def _speed_share(self, omega: FloatArray) -> ComplexArray:
        """From motor references to torque (n_freq, n_motor) by way of the speed that the loops are told."""
        period_s = self._controller.sampling_period_s
        proportional, integral = speed_gains(self._controller, self._robot.motor_inertia_kgm2)
        difference = (1 - np.exp(-1j * omega * period_s))[:, None]
        return np.asarray(self._feedforward * (proportional * difference / period_s + integral))


def _true_rows(
    model: ElasticModel, arm: ToolArm, names: tuple[str, ...], configuration: FloatArray, rest: FloatArray
) -> FloatArray:
    """How coordinates move the channels of the tool itself (n_channel, n_dof), seen from the carriage."""
    data = mujoco.MjData(model.mujoco)
    data.qpos[:] = rest
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    shift, turn = np.zeros((2, 3, model.mujoco.nv))
    mujoco.mj_jacSite(model.mujoco, data, shift, turn, model.mujoco.site(site_name(model.robot.sensors[-1])).id)
    external = model.arm[: arm.external]
    carried = np.concatenate([shift, turn])
    carried[:, external] = 0.0
    base: FloatArray = np.eye(3)
    for joint in arm.robot.joints[: arm.external]:
        base = base @ joint.rotation
    home = (base @ arm.poses(configuration[arm.external :])[1]).T
    pose = np.concatenate([home @ carried[:3], (home @ carried[3:])[::-1]])
    own = arm.channels[3 : 3 + arm.external]
    identity = np.eye(model.mujoco.nv)
    return np.array([pose[POSE.index(name)] if name in POSE else identity[external[own.index(name)]] for name in names])
