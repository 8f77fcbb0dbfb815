"""Across which gaps of a log its channels are followed, by their spectra, and the error of a spline between samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import rfft
from scipy.interpolate import make_interp_spline
from scipy.signal.windows import hann

from robid.arrays import FloatArray, IntArray
from robid.logs.pace import GAP, longest_piece

DEGREE = 7
"""Degree of the spline between even samples."""

UNEVEN_DEGREE = 3
"""Degree of the spline between uneven samples, where a higher one would amplify noise many times."""

# Lengths of time steps, in usual ones, of which the longest that can be followed across is looked for
_BRIDGES = (10.5, 8.0, 6.0, 5.0, 4.0, 3.5, 2.5, 2.0, 1.75, GAP)
_FOLLOWED = 0.03  # error of a channel up to which a spline follows it across a longer step
# Longer steps, in usual ones, that need not be followed so far where they are few: noise that one or two samples would
# have had is no motion
_SHORT = 3.5
_LOOKED = 2**18  # samples by which the channels are judged
_SPOILT = 0.03  # error of a channel over all samples, with those put into such steps, up to which these are few


def interpolation_error(
    values: FloatArray, degree: int = DEGREE, steps: Sequence[float] = (1.0,), shares: Sequence[float] = (1.0,)
) -> float:
    """Error that the spline makes between samples at worst, root mean square over that of the signal.

    A wave of `w` rad per sample leaks into its images, first of all that at `2 pi - w`, by `(w / (2 pi - w))^(d+1)`
    on either side. Noise counts as signal.

    Args:
        values (n_sample,): The signal.
        degree: Degree of the spline.
        steps: Distances of the samples between which it goes, in those of the signal.
        shares: Share of all moments that lie within steps of each of these lengths.

    Source:
        Unser, Splines: a perfect fit for signal and image processing (1999), frequency response of the cardinal spline.
    """
    power = np.abs(rfft((values - values.mean()) * hann(len(values)))) ** 2
    omega = np.pi * np.arange(len(power)) / max(len(power) - 1, 1)
    lost = 0.0
    for step, share in zip(steps, shares, strict=True):
        wave = np.minimum(step * omega, np.pi)
        leaked = np.minimum(2 * (wave / (2 * np.pi - wave)) ** (degree + 1), 2.0)
        lost += share * float((leaked**2 * power).sum())
    return float(np.sqrt(lost / max(float(power.sum()), np.finfo(float).tiny)))


def longest_bridged(time_s: FloatArray, channels: Sequence[FloatArray], step_s: float) -> float:
    """Returns the longest step of a time (n_sample,) across which a spline follows some channels (n_sample,) [s].

    Either it follows them within each such step, or the steps are short and few.
    """
    steps = np.diff(time_s) / step_s
    # What nothing bridges says nothing of the channels.
    start, stop = longest_piece(np.flatnonzero(steps > _BRIDGES[0]), len(time_s))
    part = slice(start, min(stop, start + _LOOKED))
    if part.stop - part.start <= UNEVEN_DEGREE:
        return step_s
    even = np.arange(time_s[part][0], time_s[part][-1], step_s)
    moving = [make_interp_spline(time_s[part], one[part], k=UNEVEN_DEGREE)(even) for one in channels]
    moving = [one for one in moving if np.ptp(one) > 0]
    for length in _BRIDGES:
        bridged = steps[(steps > GAP) & (steps <= length)]
        share = float((bridged - 1).sum()) / max(len(steps), 1) if length <= _SHORT else 1.0
        # What is put into each step has the error of the longest one.
        limit = max(_FOLLOWED, _SPOILT / np.sqrt(share)) if share else np.inf
        if all(interpolation_error(one, UNEVEN_DEGREE, (length,)) < limit for one in moving):
            return length * step_s
    return step_s


def fill_gaps(
    times: FloatArray, values: FloatArray, step: float, gaps: IntArray
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Puts samples into those gaps of a variable across which a spline follows it.

    Args:
        times (n_sample,): When it was sampled.
        values (n_sample,): Its samples.
        step: The usual step of these times.
        gaps (n_gap,): Samples after which others are missing.

    Returns:
        Times and values (n_filled,) with those between, and the gaps that are left.
    """
    longest = longest_bridged(times, [values], step) if len(gaps) else 0.0
    steps = np.diff(times)
    filled = gaps[steps[gaps] <= longest]
    counts = np.maximum(np.round(steps[filled] / step).astype(int) - 1, 0)
    if not counts.sum():
        return times, values, gaps
    shares = np.concatenate([np.arange(1, count + 1) / (count + 1) for count in counts])
    after = np.repeat(filled, counts)
    between = times[after] + shares * steps[after]
    made = make_interp_spline(times, values, k=UNEVEN_DEGREE)(between)
    left = np.setdiff1d(gaps, filled)
    moved = np.array([counts[filled < gap].sum() for gap in left], int)
    return np.insert(times, after + 1, between), np.insert(values, after + 1, made), left + moved
