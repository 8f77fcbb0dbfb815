"""Checks of a log's own time: unit, rate, order, gaps and jitter; and of how many periods it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.logs.formats.variables import measurable
from robid.logs.mapping import Columns, LogMapping, Stated
from robid.logs.pace import JITTER, longest_piece, measure_pace

RESAMPLED_RATE = 0.05
"""Largest relative difference of two clocks that resampling bridges: it has no filter against aliases."""

EVERY_LOG = "other logs of the campaign have other clocks, and all are brought to steps"
ALONE = (
    f"Import it by a campaign of its own: other logs of this one have other clocks, and resampling bridges"
    f" {RESAMPLED_RATE:.0%} at most."
)
"""What to say where the clocks of several logs differ."""

_SAME_CLOCK = 1e-4  # relative difference of the mean time step from the sampling period that is passed over

UNSURE = 0.01
"""Relative error of a rate from which stamps cannot tell it."""

_FACTOR_OF_1000 = 0.2  # relative error of a time step within which it is that of another unit
_COUNTERS = tuple(2.0**bits for bits in (8, 16, 24, 31, 32))
_PARTS = (1.0, 1e3, 1e6, 1e9)  # of a unit that a counter was divided by, or by which a day was multiplied
_CLOCKS = (3600.0, 86400.0)
_RANGES = (
    *(size / part for size in _COUNTERS for part in _PARTS),
    *(size * part for size in _CLOCKS for part in _PARTS),
)
"""After how much a time may begin again, in its unit: a counter's range, an hour, a day."""
_HELD_STEPS = 1.5  # usual steps up to which the step across the end of a range is one
_MANY = 100  # steps that a range has at least


@dataclass(frozen=True)
class Clock:
    """The log's own time."""

    where: str  # File and variable
    time_s: FloatArray  # (n_sample,) Time of each sample [s]
    stated_s: float  # The stated sampling period [s]
    step_s: float  # Mean time step, those across gaps left out [s]
    gaps: IntArray  # (n_gap,) Samples after which others are missing
    first: int = 0  # Sample of the log that is the first of these
    whole: str = ""  # What to set for the longest part in which nothing is missing; empty where there is none
    unsure: float = 0.0  # Relative error that the mean time step may have
    differs: bool = False  # Whether other logs that are read by the same settings have other clocks
    followed_s: float = 0.0  # Longest step between two samples across which interpolation follows the channels [s]

    @property
    def is_off(self) -> bool:
        """Whether the log was sampled with another period than the stated one, by more than its stamps wander."""
        return abs(self.step_s / self.stated_s - 1) > max(_SAME_CLOCK, self.unsure)

    @property
    def is_bridged(self) -> bool:
        """Whether resampling brings it to the stated one."""
        return abs(self.step_s / self.stated_s - 1) <= RESAMPLED_RATE

    @property
    def told(self) -> str:
        """What to say where it is off."""
        step = f"{self.told_step_s:.9g} s"
        return f"The mean time step is {step}, but a sampling period of {self.stated_s:g} s was stated"

    @property
    def usual_s(self) -> float:
        """The time step to name: the stated one, unless the log's is another [s]."""
        return self.told_step_s if self.is_off else self.stated_s

    @property
    def told_step_s(self) -> float:
        """The time step as a setting, with no more digits than it needs [s]."""
        short = float(f"{self.step_s:.6g}")
        return short if abs(short / self.step_s - 1) < 1e-7 else float(f"{self.step_s:.9g}")


def read_clock(mapping: LogMapping, stamps: FloatArray) -> tuple[Clock | None, list[DataError]]:
    """Reads the time stamps (n_sample,) of a log: unit, order and rate; a wrong rate alone is no problem here."""
    if mapping.time is None:
        return None, []
    where, stated = mapping.place(mapping.time.variable), mapping.sampling_period_s
    time = since_first(stamps) * mapping.time.to_seconds
    if np.ptp(time) == 0:
        # Messages have the time of their logging beside a stamp in their header that nobody set.
        topic, stamp, _ = mapping.time.variable.partition(".header.stamp")
        remedy = f"Set time.variable to {topic}.log_time" if stamp else "Correct time.variable"
        what = f"D121 Time does not advance: it is constant ({stamps[0]:g})."
        return None, [DataError(what, where=where, remedy=f"{remedy}, or leave out `time`.")]
    pace = measure_pace(time, stated)
    if pace is None:
        backward = np.flatnonzero(np.diff(time) <= 0)
        what = f"D122 Time does not advance after sample {backward[0]} ({len(backward)} such steps)."
        remedy = "Sort the log by time and drop repeated samples."
        if np.min(np.diff(time)) < -_MANY * float(np.median(np.abs(np.diff(time)))):
            remedy = "If it contains several recordings, make each a log of its own; if its clock was set back, leave"
            remedy += " out `time`; sort it only if its rows stand out of order."
        if not np.any(np.diff(time) < 0):  # stamps that go back are not only rounded
            remedy = "Where stamps are only rounded, leave out `time`; else drop repeated samples."
        return None, [DataError(what, where=f"{where}, sample {backward[0]}", remedy=remedy)]
    usual = pace.step
    exponent = round(np.log10(usual / stated))
    if exponent and exponent % 3 == 0 and abs(usual / stated / 10.0**exponent - 1) < _FACTOR_OF_1000:
        what = f"D123 The time unit is off by a factor of {10.0**exponent:g}: steps are {usual:g} s, not {stated:g} s."
        # The unit of the time that gives the stated steps, where there is one
        units = {0: "s", -3: "ms", -6: "us", -9: "ns"}
        own = {unit: power for power, unit in units.items()}.get(mapping.time.unit)
        fitting = None if own is None else units.get(own - exponent)
        remedy = f"Set time.unit to {fitting}." if fitting else "Correct the unit of `time`, or sampling_period_s."
        return None, [DataError(what, where=where, remedy=remedy)]
    unsure = min(pace.unsure, UNSURE)
    return Clock(where, time, stated, pace.step, pace.gaps, unsure=unsure, differs=mapping.differs), []


def even_stamps(mapping: LogMapping, columns: Columns) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Puts the times of evenly spaced samples in the place of their stamps where these are only rounded.

    Where they are so coarse that they cannot tell the rate, the stated sampling period stands.

    Returns the columns, and what to say about it.
    """
    if mapping.time is None or mapping.time.variable not in columns:
        return dict(columns), []
    name = mapping.time.variable
    if not np.all(np.isfinite(columns[name])):
        return dict(columns), []
    unit_s, stated = mapping.time.to_seconds, mapping.sampling_period_s
    time = since_first(columns[name])
    pace = measure_pace(time, stated / unit_s) if len(time) else None
    if pace is None or not pace.rounding:
        return dict(columns), []
    told = f"{mapping.file.name}: the stamps of `{name}` are rounded to {pace.rounding * unit_s:.4g} s:"
    if pace.unsure > UNSURE:
        times = np.arange(len(time)) * stated / unit_s
        return {**columns, name: times}, [f"{told} they cannot tell the sampling period, which was taken as stated."]
    sure = f"its samples were taken to be evenly spaced, their rate is known to {100 * pace.unsure:.1g} %."
    return {**columns, name: pace.times}, [f"{told} {sure}"]


def since_first(stamps: NDArray[Any]) -> FloatArray:
    """Time (n_sample,) since the first one, in its unit: nanoseconds since 1970 have more digits than a float holds."""
    # Unsigned ones that go back would come out far ahead.
    exact = stamps.astype(np.int64) if stamps.dtype.kind in "iu" else stamps.astype(float)
    return np.asarray((exact - exact[0]).astype(float))


def clock_problems(clock: Clock) -> list[DataError]:
    """Says what to set where a log without periods was sampled with another period than the stated one."""
    if not clock.is_off:
        return []
    remedy = f"Set sampling_period_s to {clock.told_step_s:.9g}."
    if clock.differs:
        remedy = f"Set resample to time: {EVERY_LOG} of {clock.stated_s:g} s." if clock.is_bridged else ALONE
    return [DataError(f"D124 {clock.told}.", where=clock.where, remedy=remedy)]


def check_steps(
    clock: Clock, used: slice, stated: Stated | None = None, *, counted: bool = True, named: bool = True
) -> list[DataError]:
    """Checks the part of a log that is used for gaps and jitter.

    A gap between two periods loses whole periods only: what follows is checked to repeat what was before.

    Periods are counted from the log's first sample where `counted`; gaps are named where `named`.
    """
    first, stop, _ = used.indices(len(clock.time_s))
    gaps = clock.gaps[(clock.gaps >= first) & (clock.gaps < stop - 1)]
    if stated is not None:
        gaps = gaps[(gaps + 1 - first) % stated.samples != 0]
    steps = np.diff(clock.time_s)
    inside = np.setdiff1d(np.arange(first, stop - 1), clock.gaps)
    deviation = float(np.abs(steps[inside] / clock.step_s - 1).max(initial=0.0))
    # What jitters or has another clock is resampled, which no gap may be in.
    by_periods = stated if counted and deviation <= JITTER and not clock.is_off else None
    problems = [_gaps(clock, gaps, steps, by_periods)] if named and len(gaps) else []
    if deviation > JITTER:
        what = f"D125 The time steps deviate from {clock.usual_s:g} s by up to {100 * deviation:.0f} %."
        remedy = "Set resample to time, or leave out `time` if only the stamps are coarse."
        problems.append(DataError(what, where=clock.where, remedy=remedy))
    return problems


def _gaps(clock: Clock, gaps: IntArray, steps: FloatArray, stated: Stated | None) -> DataError:
    missing = round(float(np.sum(steps[gaps] / clock.step_s - 1)))
    what = (
        f"D126 {len(gaps)} gap{'s' if len(gaps) > 1 else ''}, about {missing} missing samples; the first after sample"
        f" {clock.first + gaps[0]}: {steps[gaps[0]]:.6g} s instead of {clock.usual_s:g} s."
    )
    remedy = clock.whole or "Record again, or cut the log to a part without a gap."
    if stated is not None and steps[gaps].max() > clock.followed_s:
        begin, end = longest_piece(clock.gaps, len(clock.time_s))
        dropped = max(-(-begin // stated.samples), stated.dropped)
        whole = end // stated.samples - dropped
        if whole > 0:
            remedy = f"Set drop_periods to {dropped} and periods to {whole}: the longest part without a gap."
    return DataError(what, where=f"{clock.where}, sample {clock.first + gaps[0]}", remedy=remedy)


def check_count(
    mapping: LogMapping, n_sample: int, samples_per_period: int, periods: int, ends: str = ""
) -> list[DataError]:
    """Checks that the log holds the periods that were said; `ends` says what ends before the others."""
    held = n_sample / samples_per_period
    wanted = mapping.drop_periods + periods
    if held >= wanted:
        return []
    fewer = int(held) - mapping.drop_periods
    remedy = f"Set periods to {fewer} at most" if fewer > 0 else "Record longer"
    what = (
        f"D127 It contains {held:.4g} periods of {samples_per_period} samples, fewer than the {wanted} that were said"
        f" ({mapping.drop_periods} dropped and {periods} used).{ends and f' {ends}'}"
    )
    where = f"{mapping.file}: {n_sample} samples"
    return [DataError(what, where=where, remedy=f"{remedy}, or correct the period.")]


def check_segment(mapping: LogMapping, n_sample: int, segment_samples: int) -> list[DataError]:
    """Says what a log that is shorter than one segment of its resolution would need."""
    step_s = mapping.sampling_period_s
    # Rounded upwards to four digits, so that what is advised fits.
    least = 1 / (n_sample * step_s)
    scale = 10 ** (3 - int(np.floor(np.log10(least))))
    what = (
        f"D128 It lasts {n_sample * step_s:.4g} s, less than the {segment_samples * step_s:.4g} s that a resolution of"
        f" {1 / (segment_samples * step_s):.4g} Hz needs."
    )
    remedy = f"Set excitation.resolution_hz to {np.ceil(least * scale) / scale:.4g} or more, or record longer."
    return [DataError(what, where=f"{mapping.file}: {n_sample} samples", remedy=remedy)]


def going_on(stamps: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """Returns times (n_sample,) that go on where a counter or a time of day began again, and after how much it did.

    That is so where every step back and the range make a usual step. Two recordings in a row may do so by chance where
    the second one begins where the first one did: these, as all others, are returned as they are, with 0.
    """
    if len(stamps) < _MANY or stamps.dtype.kind not in "iuf" or not np.all(measurable(stamps)):
        return stamps, 0.0
    back = stamps[1:] < stamps[:-1]  # unsigned ones have no differences below zero
    if not back.any() or np.mean(back) > 1 / _MANY:
        return stamps, 0.0
    times = since_first(stamps)
    steps = np.diff(times)
    usual, jumps, again = float(np.median(steps)), steps[back], stamps[1:][back].astype(float)
    if np.any(np.abs(again - float(stamps[0])) < _HELD_STEPS * usual):
        return stamps, 0.0
    span = float(np.ptp(stamps.astype(float)))
    for size in sorted(one for one in _RANGES if span < one and one > _MANY * usual):
        if np.all((jumps + size > 0) & (jumps + size < _HELD_STEPS * usual)):
            return times + size * np.concatenate([[0.0], np.cumsum(back)]), size
    return stamps, 0.0
