"""Torque nonlinearities subtracted from the torque before the response is estimated."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.spectra import line_amplitudes, remove_drift
from robid.signals.friction import TorqueLaw, torque_regressors
from robid.signals.record import Record

_NOISE_CUT = 2.5  # times the highest excited line


def disturbance(record: Record, laws: tuple[TorqueLaw, ...], lines: IntArray, delay_s: float) -> ComplexArray:
    """Torque of each coefficient's unit error, as held torque at the controller's output.

    Args:
        record: Record of a single configuration; its outputs start with the inputs' motors.
        laws: One law per input.
        lines (n_freq,): DFT lines of one period.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Returns:
        Spectra (n_kind, n_real, n_freq, n_in, n_exp) of `robid.signals.friction.KINDS` [N m]; the first is the
        nominal friction itself.
    """
    omega = 2 * np.pi * lines / record.period_s
    half = 0.5 * omega * record.sampling_period_s * (record.torque_hold == "zoh")
    hold = np.sinc(half / np.pi) * np.exp(-1j * (half + omega * delay_s))
    torques = torque_regressors(
        _motor_angle(record, len(laws)), record.sampling_period_s, laws, _NOISE_CUT * record.frequency_hz[-1]
    )
    # (kind, sample, real, exp, in) to (kind, real, exp, sample, in) to (kind, real, freq, in, exp).
    spectra = line_amplitudes(np.moveaxis(torques, 1, 3), lines) / hold[:, None]
    return np.asarray(np.moveaxis(spectra, 2, -1))


def _motor_angle(record: Record, n_in: int) -> FloatArray:
    """One period of the motor angles (n_sample, n_real, n_exp, n_in), mean over the periods [rad]."""
    angle = remove_drift(record.position[0])[..., :n_in].mean(axis=2) + record.position_offset_rad[0, :n_in]
    return np.moveaxis(angle, 2, 0)
