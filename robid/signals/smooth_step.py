"""A smooth step: a ramp of bounded speed whose first six derivatives are continuous."""

from __future__ import annotations

from math import comb

import numpy as np

from robid.arrays import FloatArray

PEAK_ACCELERATION = 3.3
"""Largest acceleration over `speed / ramp_s`."""

PEAK_SNAP = 216.0
"""Largest second derivative of the acceleration over `speed / ramp_s^3`."""

_BOXES = 6


def smooth_step(time_s: FloatArray, size: float, speed: float, ramp_s: float) -> FloatArray:
    """Samples a step that moves at a constant speed between two ramps.

    The speed is a rectangle of the step's size smoothed by six equal boxes, so that an inverse that
    differentiates the acceleration four times stays continuous.

    Args:
        time_s (n_time,): Times; the step begins at 0 [s].
        size: Size of the step, with its sign.
        speed: Largest speed, positive; reached where the step lasts longer than its ramps [1/s].
        ramp_s: Duration of each ramp [s].

    Returns:
        Position, speed and acceleration (3, n_time).
    """
    start, stop = (_ramp(np.asarray(time_s, float) - shift, ramp_s) for shift in (0.0, abs(size) / speed))
    return np.asarray(np.sign(size) * speed * (start - stop))


def step_duration_s(size: float, speed: float, ramp_s: float) -> float:
    """Returns how long the step lasts [s]."""
    return abs(size) / speed + ramp_s


def _ramp(time_s: FloatArray, ramp_s: float) -> FloatArray:
    """Position, speed and acceleration (3, n_time) of a ramp to the speed 1."""
    width = ramp_s / _BOXES
    within = np.clip(time_s / width, 0.0, _BOXES)
    late = np.maximum(time_s - ramp_s, 0.0)
    result = np.zeros((3, within.size))
    for box in range(_BOXES + 1):
        part, sign = np.maximum(within - box, 0.0), (-1) ** box * comb(_BOXES, box)
        result += sign * np.array([width * part**7 / 5040, part**6 / 720, part**5 / (120 * width)])
    result[0] += late
    return result
