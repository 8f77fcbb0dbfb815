"""Which part of a log is used, and its resampling where its clock is not the stated one, with the error of that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft
from scipy.interpolate import make_interp_spline
from scipy.signal.windows import hann

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.formats.variables import measurable
from robid.logs.losses import Part, part_losses
from robid.logs.mapping import Columns, LogMapping, Stated, set_all
from robid.logs.pace import GAP, longest_piece
from robid.logs.period import measure_repetition
from robid.logs.timing import ALONE, RESAMPLED_RATE, Clock, since_first

_DEGREE = 7  # degree of the interpolating spline
_UNEVEN = 2.0  # longest time step over the shortest from which a spline of that degree would amplify noise many times
_UNEVEN_DEGREE = 3  # degree of the spline between uneven samples
# Lengths of time steps, in usual ones, of which the longest that can be followed across is looked for
_BRIDGES = (10.5, 8.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.75, 1.5)
_FOLLOWED = 0.03  # error of a channel up to which a spline follows it across a longer step
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
    if len(clock.time_s) <= _DEGREE:
        what = f"D108 It has {len(clock.time_s)} samples, and resampling needs {_DEGREE + 1} at least."
        raise DataError(what, where=clock.where, remedy="Check that it was copied completely, or record longer.")
    clock, bridged = _bridged(mapping, columns, clock)
    if len(clock.gaps):
        at, count = clock.first + clock.gaps[0], len(clock.gaps)
        told = "1 gap" if count == 1 else f"{count} gaps, the first"
        what = f"D109 {told} after sample {at}: resampling cannot fill {'it' if count == 1 else 'them'}."
        remedy = clock.whole or "Cut the log to a part without a gap."
        raise DataError(what, where=f"{clock.where}, sample {at}", remedy=remedy)
    time = _unrounded(clock.time_s)
    steps = np.diff(time)
    degree = _DEGREE if steps.max() < _UNEVEN * steps.min() else _UNEVEN_DEGREE
    wanted = time[0] + stated * np.arange(int((time[-1] - time[0]) / stated * (1 + 1e-12)) + 1)
    made, error = _interpolated(mapping, columns, time / stated, wanted / stated, degree)
    told = f"Resampled from time steps of {clock.told_step_s:.9g} s to {stated:g} s{bridged}"
    resampled = Clock(clock.where, wanted, stated, stated, np.zeros(0, int))
    return made, resampled, [_error_note(mapping, told, error)]


def _bridged(mapping: LogMapping, columns: Columns, clock: Clock) -> tuple[Clock, str]:
    """The clock without the gaps across which its channels are followed, and what to say about these."""
    if not len(clock.gaps):
        return clock, ""
    steps = np.diff(clock.time_s)
    time = mapping.time.variable if mapping.time is not None else ""
    channels = [np.asarray(one[: len(clock.time_s)], float) for name, one in columns.items() if name != time]
    longest = longest_bridged(clock.time_s, channels, clock.step_s)
    left = clock.gaps[steps[clock.gaps] > longest]
    if len(left) == len(clock.gaps):
        return clock, ""
    short = steps[np.setdiff1d(clock.gaps, left)]
    told = f", {len(short)} longer ones, up to {short.max():.4g} s, bridged as the channels move little in them"
    return replace(clock, gaps=left), told


def longest_bridged(time_s: FloatArray, channels: Sequence[FloatArray], step_s: float) -> float:
    """Returns the longest step of a time (n_sample,) across which a spline follows some channels (n_sample,) [s]."""
    # What nothing bridges says nothing of the channels.
    part = slice(*longest_piece(np.flatnonzero(np.diff(time_s) > _BRIDGES[0] * step_s), len(time_s)))
    if part.stop - part.start <= _UNEVEN_DEGREE:
        return step_s
    even = np.arange(time_s[part][0], time_s[part][-1], step_s)
    moving = [make_interp_spline(time_s[part], one[part], k=_UNEVEN_DEGREE)(even) for one in channels]
    moving = [one for one in moving if np.ptp(one) > 0]
    for count in _BRIDGES:
        if all(interpolation_error(one, _UNEVEN_DEGREE, count) < _FOLLOWED for one in moving):
            return count * step_s
    return step_s


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


def interpolation_error(values: FloatArray, degree: int = _DEGREE, step: float = 1.0) -> float:
    """Error that the spline makes between samples at worst, root mean square over that of the signal.

    A wave of `w` rad per sample leaks into its images, first of all that at `2 pi - w`, by `(w / (2 pi - w))^(d+1)`
    on either side. Noise counts as signal.

    Args:
        values (n_sample,): The signal.
        degree: Degree of the spline.
        step: Distance of the samples between which it goes, in those of the signal.

    Source:
        Unser, Splines: a perfect fit for signal and image processing (1999), frequency response of the cardinal spline.
    """
    power = np.abs(rfft((values - values.mean()) * hann(len(values)))) ** 2
    omega = np.pi * np.arange(len(power)) / max(len(power) - 1, 1)
    omega = np.minimum(step * omega, np.pi)
    leaked = np.minimum(2 * (omega / (2 * np.pi - omega)) ** (degree + 1), 2.0)
    return float(np.sqrt((leaked**2 * power).sum() / max(float(power.sum()), np.finfo(float).tiny)))


def _interpolated(
    mapping: LogMapping,
    columns: Columns,
    have: FloatArray,
    wanted: FloatArray,
    degree: int = _DEGREE,
) -> tuple[dict[str, NDArray[Any]], float]:
    """The columns at other moments (in samples) by a spline, and the largest error of a channel."""
    step = float(np.diff(have).max()) if degree < _DEGREE else 1.0
    made: dict[str, NDArray[Any]] = {}
    error = 0.0
    for name, column in columns.items():
        values = column[: len(have)].astype(float)
        if mapping.time is not None and name == mapping.time.variable:
            made[name] = np.interp(wanted, have, values)
            continue
        if np.ptp(values) > 0:
            error = max(error, interpolation_error(values, degree, step))
        made[name] = np.asarray(make_interp_spline(have, values, k=degree)(wanted))
    return made, error


def _unrounded(time_s: FloatArray) -> FloatArray:
    """The time, on a straight line where it is only rounded off that."""
    index = np.arange(len(time_s))
    line = np.polynomial.Polynomial.fit(index, time_s, 1)(index)
    differences = np.abs(np.diff(np.unique(np.round(np.diff(time_s), 12))))
    rounding = float(differences.min()) if len(differences) else 0.0
    return np.asarray(line) if np.abs(time_s - line).max() <= _COARSE * rounding else time_s


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


_ROUNDING = 1e-3  # time steps by which a limit may miss a sample and still holds it
_MARGIN = 0.4  # share of a time step by which the limits of a part may lie beyond it
_FEWEST = 8  # samples from which a piece is worth naming


def chosen_part(mapping: LogMapping, columns: Columns) -> slice:
    """Returns the samples from `from_s` to `to_s`, all of them where neither is stated.

    Raises:
        DataError: If hardly any sample lies there.
    """
    time = _seconds(mapping, columns) if mapping.is_cut else np.zeros(0)
    if not len(time):
        return slice(None)
    rounding = _ROUNDING * mapping.sampling_period_s
    stop = len(time) if mapping.to_s is None else int(np.searchsorted(time, mapping.to_s + rounding))
    start = int(np.searchsorted(time, mapping.from_s - rounding))
    if stop - start >= 2:
        return slice(start, stop)
    end = "its end" if mapping.to_s is None else f"{mapping.to_s:g} s"
    what = f"D111 It lasts {time[-1]:.6g} s: from {mapping.from_s:g} s to {end} it has {max(stop - start, 0)} samples."
    raise DataError(what, where=str(mapping.file), remedy=f"State from_s and to_s within 0 and {time[-1]:.6g}.")


def whole_piece(mapping: LogMapping, columns: Columns, part: slice, stated: Stated | None = None) -> str:
    """Says what to set for the longest part of a log, within one, that has no gap and no missing value.

    Returns:
        The remedy, with the periods that it then holds; empty where no part is long enough, or nothing is missing.
    """
    time = _seconds(mapping, columns)
    first, stop, _ = part.indices(len(time))
    if stop - first < _FEWEST:
        return ""
    steps = np.diff(time)
    told = [measurable(column[: len(time)]) for column in columns.values() if column.dtype.kind == "f"]
    sound = np.logical_and.reduce([np.isfinite(time), *told])
    whole = np.concatenate([sound[1:] & sound[:-1] & ~(steps > GAP * np.nanmedian(steps)), [False]])
    whole[:first], whole[max(stop - 1, 0) :] = False, False
    edges = np.diff(np.concatenate([[0], whole.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(starts):
        return ""
    longest = int(np.argmax(stops - starts))
    begin, end = int(starts[longest]), int(stops[longest])
    if end - begin < _FEWEST or (begin <= first and end >= stop - 1):
        return ""
    low, high = limits_of(time, begin, end)
    ends = {"from_s": f"{low:.12g}", "to_s": f"{high:.12g}"}
    # Where references say where periods begin, these say how many there are.
    settings: dict[str, str] | None = ends
    if stated is not None and not mapping.references:
        settings = _with_periods(ends, end + 1 - begin, stated, from_start=begin <= first)
    if settings is None:
        return "Record again: no whole period lies where nothing is missing."
    return f"{set_all(settings)[:-1]}: the longest part in which nothing is missing."


def _with_periods(ends: dict[str, str], n_sample: int, stated: Stated, *, from_start: bool) -> dict[str, str] | None:
    """Adds how many periods a part of a log holds, where that differs from what was said; None if it holds none."""
    held = n_sample // stated.samples
    dropped = stated.dropped if from_start and held > stated.dropped else 0
    if held - dropped < 1:
        return None
    other = {"drop_periods": f"{dropped}"} if dropped != stated.dropped else {}
    fewer = {"periods": f"{held - dropped}"} if held - dropped < stated.periods else {}
    return ends | other | fewer


def limits_of(time: FloatArray, first: int, last: int) -> tuple[float, float]:
    """Returns numbers with few digits between which samples of a time (n_sample,) lie, from one to a later one [s]."""
    low = _between(time[first] - _MARGIN * (time[first + 1] - time[first]), time[first])
    return low, _between(time[last], time[last] + _MARGIN * (time[last] - time[last - 1]))


def _seconds(mapping: LogMapping, columns: Columns) -> FloatArray:
    """Time of each sample since the first one: the log's own, filled where it is missing, or by the sampling period."""
    count = min((len(column) for column in columns.values()), default=0)
    index = np.arange(count)
    if mapping.time is None or mapping.time.variable not in columns:
        return mapping.sampling_period_s * index
    stamps = columns[mapping.time.variable][:count]
    known = np.isfinite(stamps)
    if not known.any():
        return mapping.sampling_period_s * index
    return np.interp(index, index[known], since_first(stamps[known])) * mapping.time.to_seconds


def _between(low: float, high: float) -> float:
    """The number from one to another that has the fewest digits, not below zero."""
    low = max(low, 0.0)
    for digits in range(12):
        found: float = math.ceil(low * 10**digits) / 10**digits
        if found <= high:
            return found
    return high
