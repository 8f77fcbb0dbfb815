"""Resampling of logs whose clock is not the stated one or lost samples, with the error of that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.arrival import bunched
from robid.logs.bridging import DEGREE, UNEVEN_DEGREE, interpolation_error
from robid.logs.losses import Part, part_losses
from robid.logs.mapping import Columns, LogMapping, Stated
from robid.logs.period import measure_repetition
from robid.logs.timing import ALONE, RESAMPLED_RATE, Clock

_UNEVEN = 2.0  # longest time step over the shortest from which a spline of a high degree would amplify noise many times
_SAME = 1e-6  # distance of a moment from a sample, in steps, up to which it is that sample's
# Deviation of the time stamps from a straight line, in their own steps, up to which they are only rounded
_COARSE = 2.0


def resample_to_time(
    mapping: LogMapping, columns: Columns, clock: Clock, period_s: float | None = None
) -> tuple[dict[str, NDArray[Any]], Clock, list[str]]:
    """Resamples all columns to the stated sampling period of the log's own time.

    A stated period [s] stays whole samples.

    Returns:
        The columns, their new time, and what to say about it.

    Raises:
        DataError: If the log has gaps or hardly any samples, or its rate is too far from the stated one.
    """
    stated = mapping.sampling_period_s
    if not clock.is_bridged:
        raise _too_far(clock, period_s)
    time = _unrounded(clock)
    clock, bridged = _interpolable(clock, time)
    steps = np.diff(time)
    degree = DEGREE if not bridged and steps.max() < _UNEVEN * steps.min() else UNEVEN_DEGREE
    wanted = time[0] + stated * np.arange(int((time[-1] - time[0]) / stated * (1 + 1e-12)) + 1)
    made, error = _interpolated(mapping, columns, time / stated, wanted / stated, degree)
    told = f"Resampled from time steps of {clock.told_step_s:.9g} s to {stated:g} s{bridged}"
    resampled = Clock(clock.where, wanted, stated, stated, np.zeros(0, int))
    return made, resampled, [_error_note(mapping, told, error)]


def _interpolable(clock: Clock, time: FloatArray) -> tuple[Clock, str]:
    """The clock without the gaps across which its channels are followed, and what to say about these.

    Raises:
        DataError: If it has further gaps, bursts or hardly any samples.
    """
    if len(time) <= DEGREE:
        what = f"D108 It has {len(time)} samples, and resampling needs {DEGREE + 1} at least."
        raise DataError(what, where=clock.where, remedy="Check that it was copied completely, or record longer.")
    told = bunched(time, clock.step_s, clock.first)
    if told:
        mean = f"{np.ptp(time) / (len(time) - 1):.6g}"
        remedy = f"Leave out `time` and `resample` if no sample was lost, and set sampling_period_s to {mean}"
        raise DataError(told, where=clock.where, remedy=f"{remedy}; else log the time at which samples are taken.")
    steps = np.diff(clock.time_s)
    left = clock.gaps[steps[clock.gaps] > clock.followed_s]
    if len(left):
        at, count = clock.first + left[0], "1 gap" if len(left) == 1 else f"{len(left)} gaps, the first"
        what = (
            f"D109 {count} after sample {at}, at {clock.time_s[left[0]]:.6g} s: resampling cannot fill"
            f" {'it' if len(left) == 1 else 'them'}."
        )
        remedy = clock.whole or "Cut the log to a part without a gap."
        raise DataError(what, where=f"{clock.where}, sample {at}", remedy=remedy)
    if not len(clock.gaps):
        return clock, ""
    count = "1 gap" if len(clock.gaps) == 1 else f"{len(clock.gaps)} gaps"
    longest = f"{steps[clock.gaps].max():.4g} s"
    return replace(clock, gaps=np.zeros(0, int)), f", across {count} of up to {longest}"


def resample_to_period(
    mapping: LogMapping, columns: Columns, steady: FloatArray, stated: Stated
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Resamples all columns so that the measured period of an excited channel has its stated number of samples.

    `steady` (n_sample,) is that channel without its dropped periods.

    Returns:
        The columns, and what to say about it; unchanged where the period cannot be measured, is too far from the
        stated one, or samples are lost within what is used: the checks of the period then say so.
    """
    part = Part(stated.dropped * stated.samples, mapping.take == "last")
    losses, steady = ([], steady) if mapping.references else part_losses(steady, stated, part)
    if losses:
        return dict(columns), []
    found = measure_repetition(steady, stated.samples, stated.lines)
    if found.samples is None:
        return dict(columns), []
    ratio = found.multiple(stated.samples) * found.samples / stated.samples
    if abs(1 / ratio - 1) > RESAMPLED_RATE:
        return dict(columns), []
    count = min(len(column) for column in columns.values())
    have = np.arange(count, dtype=float)
    wanted = ratio * np.arange(int((count - 1) / ratio) + 1)
    made, error = _interpolated(mapping, columns, have, wanted)
    deviation = 1e6 * found.std_samples / found.samples
    told = (
        f"Resampled so that a period of {ratio * stated.samples:.4f} samples has {stated.samples}"
        f" ({1e6 * (ratio - 1):+.4g} ppm, known to {deviation:.2g} ppm)"
    )
    return made, [_error_note(mapping, told, error)]


def _interpolated(
    mapping: LogMapping,
    columns: Columns,
    have: FloatArray,
    wanted: FloatArray,
    degree: int = DEGREE,
) -> tuple[dict[str, NDArray[Any]], float]:
    """The columns at other moments (in samples) by a spline, and the largest error of a channel."""
    steps, shares = _spread(have, wanted) if degree < DEGREE else ([1.0], [1.0])
    made: dict[str, NDArray[Any]] = {}
    error = 0.0
    for name, column in columns.items():
        values = column[: len(have)].astype(float)
        if mapping.time is not None and name == mapping.time.variable:
            made[name] = np.interp(wanted, have, values)
            continue
        if np.ptp(values) > 0:
            error = max(error, interpolation_error(values, degree, steps, shares))
        made[name] = np.asarray(make_interp_spline(have, values, k=degree)(wanted))
    return made, error


def _spread(have: FloatArray, wanted: FloatArray) -> tuple[list[float], list[float]]:
    """Lengths of the steps between samples, rounded up to halves, and the share of all wanted moments within each."""
    after = np.clip(np.searchsorted(have, wanted), 1, len(have) - 1)
    between = np.minimum(np.abs(wanted - have[after]), np.abs(wanted - have[after - 1])) > _SAME
    lengths = np.ceil(2 * (have[after] - have[after - 1])[between] - _SAME) / 2
    steps, counts = np.unique(lengths, return_counts=True)
    return steps.tolist(), (counts / len(wanted)).tolist()


def _unrounded(clock: Clock) -> FloatArray:
    """The time, on a straight line where it is only rounded off that; samples that are missing have their place on it.

    [s]
    """
    steps = np.diff(clock.time_s)
    index = np.concatenate([[0], np.cumsum(np.maximum(np.round(steps / clock.step_s), 1))])
    line = np.polynomial.Polynomial.fit(index, clock.time_s, 1)(index)
    differences = np.abs(np.diff(np.unique(np.round(np.delete(steps, clock.gaps), 12))))
    rounding = float(differences.min()) if len(differences) else 0.0
    return np.asarray(line) if np.abs(clock.time_s - line).max() <= _COARSE * rounding else clock.time_s


def _too_far(clock: Clock, period_s: float | None) -> DataError:
    """Says that the steps of a log's own time are too far from the stated ones, and which are near."""
    what = (
        f"D110 Its time steps are {clock.told_step_s:.9g} s, {clock.step_s / clock.stated_s:.4g} times the stated"
        f" {clock.stated_s:g} s: resampling bridges {RESAMPLED_RATE:.0%} at most."
    )
    if clock.differs:
        return DataError(what, where=clock.where, remedy=ALONE)
    step_s = f"{clock.told_step_s:.9g}"
    if period_s is not None:
        step_s = f"{period_s / max(round(period_s / clock.step_s), 1):.12g}"
    return DataError(what, where=clock.where, remedy=f"Set sampling_period_s to {step_s}.")


def _error_note(mapping: LogMapping, told: str, error: float) -> str:
    return f"{mapping.file.name}: {told}; interpolation makes errors of {100 * error:.2g} % of a channel at most."
