"""Spectra of a record at its excited lines, and of the torque nonlinearities in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.signals.friction import TorqueLaw, torque_regressors
from robid.signals.record import Record

_NOISE_CUT = 2.5  # times the highest excited line


@dataclass(frozen=True)
class Spectra:
    """Spectra of one configuration at the excited lines.

    Attributes:
        torque (n_real, n_exp, n_period, n_freq, n_in): Torque [N m].
        acceleration (n_real, n_exp, n_period, n_freq, n_out): Acceleration [rad/s^2 or m/s^2].
        disturbance (n_kind, n_real, n_exp, n_period, n_freq, n_in): Torque per coefficient of `KINDS`, as held
            torque at the controller's output [N m]; n_kind is 0 without compensation.
    """

    torque: ComplexArray
    acceleration: ComplexArray
    disturbance: ComplexArray

    @property
    def nominal(self) -> ComplexArray:
        """Nominal friction, of the shape of `torque` [N m]."""
        return self.disturbance[0] if self.disturbance.size else np.zeros_like(self.torque)


def record_spectra(record: Record, laws: tuple[TorqueLaw, ...] | None, delay_s: float) -> Spectra:
    """Transforms one configuration's record.

    Args:
        record: Record of a single configuration.
        laws: Friction per input, or None for no compensation; outputs must then start with the inputs' motors.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Returns:
        The spectra, drift of the angles removed.
    """
    lines, n_sample = record.excited_lines, record.torque.shape[4]
    omega = 2 * np.pi * lines / record.period_s
    angle = remove_drift(record.position[0])
    torque = np.fft.rfft(record.torque[0], axis=3)[:, :, :, lines] / n_sample
    is_acceleration = np.array([name in record.accelerations for name in record.output_names])
    rate = np.where(is_acceleration, 1.0, -(omega**2)[:, None])
    acceleration = rate * np.fft.rfft(angle, axis=3)[:, :, :, lines] / n_sample
    if laws is None:
        return Spectra(torque, acceleration, np.zeros((0, *torque.shape), complex))
    n_in = torque.shape[-1]
    angle = angle[..., :n_in] + record.position_offset_rad[0, :n_in]
    highest = lines[-1] / record.period_s
    torques = torque_regressors(np.moveaxis(angle, 3, 0), record.sampling_period_s, laws, _NOISE_CUT * highest)
    spectra = np.moveaxis(np.fft.rfft(torques, axis=1)[:, lines], 1, 4) / torques.shape[1]
    half = 0.5 * omega * record.sampling_period_s * (record.torque_hold == "zoh")
    hold = np.sinc(half / np.pi) * np.exp(-1j * (half + omega * delay_s))
    return Spectra(torque, acceleration, spectra / hold[:, None])


def remove_drift(angle: FloatArray) -> FloatArray:
    """Removes the ramp between the means of successive periods.

    Args:
        angle (n_real, n_exp, n_period, n_sample, n_out): Angles [rad].

    Returns:
        The angles without drift, of the same shape; unchanged when there is only one period.
    """
    if angle.shape[2] < 2:
        return angle
    per_period = np.gradient(angle.mean(axis=3), axis=2)
    ramp = (np.arange(angle.shape[3]) + 0.5) / angle.shape[3] - 0.5
    return np.asarray(angle - per_period[:, :, :, None] * ramp[:, None])
