"""A cut-off chosen from the data: above what the motion excites, and low, for noise that colours the residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.regression import reduce_rows, residuals, weighted_least_squares
from robid.models.rigid.fit.residuals import check_whiteness, expected_correlation
from robid.models.rigid.fit.rows import Reading, Regressor, Remembered, prepare
from robid.signals.filters import central_differences, low_pass_reach

_ABOVE_FLOOR = 20.0
_SHARE = 0.99  # of the acceleration's power
_MARGIN = 1.5  # lowest cut-off over the excited band
_RATIO = 1.5
_HIGHEST = 0.2  # of the sampling rate
_LAGS = 10
_ROWS = 3.0  # at least, all joints together, over the parameters
_WHITE = 0.2


@dataclass(frozen=True)
class CutOffTrial:
    """What one cut-off leads to."""

    cut_hz: float  # the cut-off [Hz]
    # (n_joint,): largest autocorrelation of each joint's residuals, less what white noise would show.
    correlation: FloatArray
    deviation: FloatArray  # (n_joint,): deviation of each joint's residuals [N m, or N]


@dataclass(frozen=True)
class CutOffChoice:
    """A cut-off and why."""

    # The lowest cut-off above the excited band with white residuals; without one, that with the whitest [Hz].
    cut_hz: float
    white: bool  # whether its residuals are white
    excited_hz: FloatArray  # (n_joint,): frequency below which 99 % of each joint's acceleration lies [Hz]
    trials: tuple[CutOffTrial, ...]  # all cut-offs that were tried, ascending


def choose_cut_off(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    regressor: Regressor,
    options: PreprocessingOptions,
    candidates_hz: Sequence[float] = (),
    *,
    held: bool = False,
) -> CutOffChoice:
    """Tries cut-offs from the excited band upwards.

    Args:
        position (n_sample, n_joint): Measured positions [rad, or m].
        torque (n_sample, n_joint): Motor torques [N m, or N].
        sampling_period_s: Sampling period [s].
        regressor: The inverse dynamics, of base parameters.
        options: The filters; rows are decimated to twice each cut-off.
        candidates_hz: Cut-offs to try; by default from 1.5 times the excited band in steps of one half.
        held: Whether each torque is a command held until the next sample.

    Raises:
        ValueError: If the record is too short for any of them.

    Source:
        docs/methods, sec. 7: residual whiteness against the excited band.
    """
    excited = excited_band(position, sampling_period_s)
    cuts = sorted(candidates_hz) or _ladder(float(excited.max()), sampling_period_s)
    every = [replace(options, position_cut_hz=cut, decimation=0) for cut in cuts]
    wanted = fewest_rows(len(regressor.names), position.shape[1])
    every = [tried for tried in every if row_count(len(position), tried, sampling_period_s) >= wanted]
    if not every:
        message = f"{len(position)} samples leave too few rows for {len(regressor.names)} parameters at any cut-off"
        raise ValueError(message)
    trials = tuple(_try(position, torque, sampling_period_s, regressor, tried, held) for tried in every)
    white = [trial for trial in trials if trial.correlation.max() <= _WHITE]
    best = white[0] if white else min(trials, key=lambda trial: float(trial.correlation.max()))
    return CutOffChoice(best.cut_hz, bool(white), excited, trials)


def excited_band(position: FloatArray, sampling_period_s: float) -> FloatArray:
    """Returns the frequency (n_joint,) below which 99 % of the acceleration above the noise floor lies [Hz]."""
    from scipy.signal import welch

    _, acceleration = central_differences(position, sampling_period_s)
    segment = min(len(acceleration), 1 << 13)
    hertz, power = welch(acceleration, 1 / sampling_period_s, nperseg=segment, axis=0)
    hertz, power = hertz[1:], power[1:]
    # White noise of an encoder is flat as a position; what stands far above its floor is motion.
    as_position = power / (2 * np.sin(np.pi * hertz * sampling_period_s)[:, None]) ** 4
    floor = np.median(as_position[len(as_position) // 2 :], axis=0)
    within = np.cumsum(np.where(as_position > _ABOVE_FLOOR * floor, power, 0.0), axis=0)
    return np.asarray(hertz[np.argmax(within >= _SHARE * within[-1], axis=0)])


def row_count(n_sample: int, options: PreprocessingOptions, sampling_period_s: float) -> int:
    """Returns how many rows of a joint the filters leave of a record."""
    inner = n_sample - 2 * low_pass_reach(sampling_period_s, options.cut_hz, options.position_order) - 2
    return len(options.decimator(sampling_period_s).kept(inner))


def fewest_rows(n_param: int, n_joint: int) -> int:
    """Returns how many rows of a joint a fit needs at least."""
    return math.ceil(_ROWS * n_param / n_joint)


def _ladder(excited_hz: float, sampling_period_s: float) -> list[float]:
    highest = _HIGHEST / sampling_period_s
    lowest = min(_MARGIN * max(excited_hz, 1e-3 * highest), highest)
    count = int(np.log(highest / lowest) / np.log(_RATIO)) + 1
    return [lowest * _RATIO**index for index in range(count)]


def _try(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    regressor: Regressor,
    options: PreprocessingOptions,
    held: bool,
) -> CutOffTrial:
    decimator = options.decimator(sampling_period_s)
    motion = prepare(position, torque, sampling_period_s, options, held=held)
    rows = Remembered(Reading([motion], regressor, decimator))
    reduction = reduce_rows(rows)
    estimate = weighted_least_squares(reduction)
    expected = expected_correlation(rows, reduction, estimate, decimator.autocorrelation(_LAGS))
    residual = residuals(rows, estimate.parameters)
    tested = [check_whiteness(joint, own) for joint, own in zip(residual.T, expected, strict=True)]
    return CutOffTrial(options.cut_hz, np.array([one.largest for one in tested]), estimate.deviation)
