"""The robot controller: position P, speed PI, torque limit; and its frequency response."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.simulate.options import Controller


def speed_gains(controller: Controller, motor_inertia_kgm2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the speed loop's proportional [N m s/rad] and integral gains [N m/rad], one per motor."""
    proportional = 2 * np.pi * controller.speed_bandwidth_hz * motor_inertia_kgm2
    return np.asarray(proportional), np.asarray(proportional / controller.integral_time_s)


def frequency_response(
    controller: Controller, motor_inertia_kgm2: FloatArray, omega: FloatArray, inject: str = "speed_reference"
) -> tuple[ComplexArray, ComplexArray]:
    """Sampled controller `U = C_r R - C_q Q`: `C_r` and `C_q` (n_freq, n_motor), its delay left to the plant.

    Args:
        controller: Controller settings.
        motor_inertia_kgm2 (n_motor,): Rotor inertias [kg m^2].
        omega (n_freq,): Angular frequency [rad/s].
        inject: Where the excitation enters.
    """
    proportional, integral = speed_gains(controller, motor_inertia_kgm2)
    period = controller.sampling_period_s
    difference = (1 - np.exp(-1j * omega * period))[:, None]
    loop = proportional + integral * period / difference
    angle = loop * (controller.position_gain_1_s + difference / period)
    if inject == "torque":
        return np.ones_like(angle), angle
    if inject == "position_reference":
        return loop * controller.position_gain_1_s, angle
    return loop * (1 + controller.position_gain_1_s * 0.5 * period * (2 - difference) / difference), angle


class Cascade:
    """Vectorised controller of many simulations, one row each.

    Args:
        controller: Controller settings.
        motor_inertia_kgm2 (n_motor,): Rotor inertias [kg m^2].
        max_torque_nm (n_motor,): Torque limits [N m].
        angle_rad (n_sim, n_motor): Motor angles at rest [rad].
        torque_nm (n_motor,) or (n_sim, n_motor): Torque of the integrators at rest [N m].
    """

    def __init__(
        self,
        controller: Controller,
        motor_inertia_kgm2: FloatArray,
        max_torque_nm: FloatArray,
        angle_rad: FloatArray,
        torque_nm: FloatArray,
    ) -> None:
        self._proportional, integral = speed_gains(controller, motor_inertia_kgm2)
        self._step = integral * controller.sampling_period_s
        self._position_gain = controller.position_gain_1_s
        self._rate = 1.0 / controller.sampling_period_s
        self._limit = max_torque_nm
        self.last = angle_rad.copy()  # (n_sim, n_motor) Angles of the sample before [rad]
        self.integral = np.broadcast_to(torque_nm, angle_rad.shape).copy()  # (n_sim, n_motor) Integrators [N m]

    def command(self, angle: FloatArray, angle_reference: FloatArray, speed_reference: FloatArray) -> FloatArray:
        """Returns the torque command (n_sim, n_motor) [N m] and moves on by one sample."""
        error = speed_reference + self._position_gain * (angle_reference - angle) - self._rate * (angle - self.last)
        self.last[:] = angle
        self.integral += self._step * error
        # Minimum and maximum take half the time of a clip.
        np.minimum(np.maximum(self.integral, -self._limit, out=self.integral), self._limit, out=self.integral)
        return np.asarray(np.minimum(np.maximum(self._proportional * error + self.integral, -self._limit), self._limit))


def angle_reference(speed_reference: FloatArray, sampling_period_s: float) -> FloatArray:
    """Integrates a periodic speed reference to a periodic angle of its shape and zero mean, by trapezoids [rad].

    Args:
        speed_reference (..., n_sample, n_motor): One period [rad/s].
        sampling_period_s: Sampling period [s].
    """
    previous = np.roll(speed_reference, 1, axis=-2)
    angle = np.cumsum(0.5 * sampling_period_s * (speed_reference + previous), axis=-2)
    return np.asarray(angle - angle.mean(axis=-2, keepdims=True))
