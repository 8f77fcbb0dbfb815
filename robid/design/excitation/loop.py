"""The nominal closed loop: how the motors move and what torque they need for a reference."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.controller import frequency_response
from robid.simulate.options import Controller


@dataclass(frozen=True)
class NominalLoop:
    """The nominal robot under its controller, at the excited lines.

    Attributes:
        robot: Names, limits, gear ratios and rotor inertias.
        controller: The controller.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
        response (n_conf, n_freq, n_motor, n_motor): Sampled response from motor torque to motor acceleration, hold
            and computation delay inside [rad/(s^2 N m)].
        static_torque (n_conf, n_motor): Motor torque that holds the arm [N m].
        delay_s: Delay from recorded to applied torque, hold excluded [s].
        linear: The linearised robot, for derivatives of the response.
    """

    robot: Robot
    controller: Controller
    configurations: FloatArray
    frequency_hz: FloatArray
    response: ComplexArray
    static_torque: FloatArray
    delay_s: float = 0.0
    linear: LinearModel | None = None

    @property
    def omega(self) -> FloatArray:
        """Angular frequency (n_freq,) [rad/s]."""
        return np.asarray(2 * np.pi * self.frequency_hz)

    def gains(self, index: int, inject: str) -> tuple[ComplexArray, ComplexArray]:
        """From references to motor torque and to motor angle in one configuration.

        Args:
            index: The configuration.
            inject: Where the excitation enters.

        Returns:
            Two arrays (n_freq, n_motor, n_motor) [N m and rad per unit of the reference].
        """
        reference, angle = frequency_response(self.controller, self.robot.motor_inertia_kgm2, self.omega, inject)
        # U = C_r R - C_q Q with Q = -G U / w^2.
        plant = -self.response[index] / self.omega[:, None, None] ** 2
        identity = np.eye(plant.shape[-1])
        torque = np.linalg.solve(identity + angle[:, :, None] * plant, reference[:, :, None] * identity)
        return torque, plant @ torque

    def at(self, frequency_hz: FloatArray) -> NominalLoop:
        """Returns the same loop at other frequencies (n_freq,) [Hz].

        Raises:
            ValueError: If the linearised robot is not there.
        """
        if self.linear is None:
            raise ValueError("The linearised robot is needed at other frequencies.")
        nominal = nominal_parameters(self.robot, self.linear, self.delay_s)
        sampled = response(self.linear, nominal, frequency_hz, self.controller.sampling_period_s).sampled
        return replace(self, frequency_hz=frequency_hz, response=sampled)

    def central(self) -> int:
        """Index of the configuration nearest the mean of all."""
        distance = np.linalg.norm(self.configurations - self.configurations.mean(axis=0), axis=1)
        return int(np.argmin(distance))


def nominal_loop(
    robot: Robot, controller: Controller, configurations: FloatArray, frequency_hz: FloatArray
) -> NominalLoop:
    """Linearises the nominal robot in each configuration and closes the loop.

    Args:
        robot: The nominal robot.
        controller: Its controller.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
    """
    period_s = controller.sampling_period_s
    delay_s = controller.delay_samples * period_s
    model = build_model(robot)
    rest = solve_statics(model, configurations)
    linear = linearize(model, rest)
    sampled = response(linear, nominal_parameters(robot, linear, delay_s), frequency_hz, period_s).sampled
    return NominalLoop(
        robot, controller, configurations, frequency_hz, sampled, rest.motor_torque, delay_s=delay_s, linear=linear
    )
