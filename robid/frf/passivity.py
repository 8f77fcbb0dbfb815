"""What delay leaves motors passive: phases of the driving points, without any model of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf

FEW_SAMPLES = 3.0  # Delay beyond the declared one that controllers and logs usually have
_LONGEST_S = 0.25
_STEP = 1 / 72  # of a turn at the highest line
_OUTSIDE, _DEVIATIONS = 0.17, 3.0  # sine of the ten degrees, and of the noise, that may lead out of the half plane
_FARTHEST = 0.8
_ALLOWED, _CLEARLY = 0.02, 0.1  # share of a motor's lines outside
_LEAST_LINES = 10
_LEAST_BAND = 4.0  # highest over lowest frequency: below, a reversed sign passes for a delay


@dataclass(frozen=True)
class DrivingPoints:
    """Responses of motors to their own torques.

    Attributes:
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_conf, n_freq, n_motor): Acceleration per torque [rad/(s^2 N m)].
        signal_to_noise (n_conf, n_freq, n_motor): Its power over its variance; None where no variance is known.
        sampling_period_s: Sampling period of the experiment [s].
        hold_period_s: Period for which the torque is held; None where it is not [s].
    """

    frequency_hz: FloatArray
    response: ComplexArray
    signal_to_noise: FloatArray | None
    sampling_period_s: float
    hold_period_s: float | None


def driving_points(frf: Frf) -> DrivingPoints:
    """Takes the driving points from a response: of the motors whose torque and angle were both recorded."""
    names = [name for name in frf.input_names if name in frf.output_names]
    rows, columns = ([every.index(name) for name in names] for every in (frf.output_names, frf.input_names))
    ratio = frf.signal_to_noise
    return DrivingPoints(
        frequency_hz=frf.frequency_hz,
        response=frf.response[:, :, rows, columns],
        signal_to_noise=None if ratio is None else ratio[:, :, rows, columns],
        sampling_period_s=frf.sampling_period_s,
        hold_period_s=frf.hold_period_s,
    )


def undeclared_delay(points: DrivingPoints, declared_s: float) -> float | None:
    """Finds the least delay with which motors absorb energy at all lines, where the declared one falls far short.

    Whatever hangs on a motor, its speed and its torque have a phase between -90 and 90 degrees and its acceleration
    and torque one between 0 and 180, hold and delay apart. Below every antiresonance a motor moves as a mass, at 0
    degrees, so that the least delay is the true one but for what damping and friction add. Half of the motors decide:
    one with a reversed sign seems to make energy.

    Args:
        points: The driving points.
        declared_s: Delay that is known, hold excluded [s].

    Returns:
        The delay, hold excluded [s]; None where a few samples more than declared will do, where no delay within
        reach would, or where too little is seen.

    Source:
        A driving point of a passive structure is positive real.
    """
    ratio = np.full(points.response.shape, np.inf) if points.signal_to_noise is None else points.signal_to_noise
    margin = _OUTSIDE + _DEVIATIONS / np.sqrt(2 * np.maximum(ratio, 1e-3))
    used = margin < _FARTHEST
    enough = used.sum(axis=(0, 1)) >= _LEAST_LINES
    used, margin = used[:, :, enough], margin[:, :, enough]
    seen = points.frequency_hz[used.any(axis=(0, 2))]
    if seen.size < 2 or seen.max() < _LEAST_BAND * seen.min():
        return None
    omega = 2 * np.pi * points.frequency_hz[:, None]
    phase = np.angle(points.response[:, :, enough]) + 0.5 * (points.hold_period_s or 0.0) * omega

    def share_outside(delay_s: float) -> float:
        outside = (np.sin(phase + delay_s * omega) < -margin) & used
        shares = np.sort(outside.sum(axis=(0, 1)) / used.sum(axis=(0, 1)))
        return float(shares[(shares.size - 1) // 2])

    usual = declared_s + FEW_SAMPLES * points.sampling_period_s
    if share_outside(usual) < _CLEARLY or share_outside(declared_s) < _CLEARLY:
        return None
    reach = min(_LONGEST_S, 0.25 / float(np.median(np.diff(np.sort(seen)))))
    tried = np.arange(declared_s, declared_s + reach, _STEP / float(seen.max())).tolist()
    found = next((delay for delay in tried if share_outside(delay) <= _ALLOWED), None)
    return found if found is not None and found > usual else None
