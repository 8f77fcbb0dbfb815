"""The time of a log: which variable it is, its unit, rate, jitter, gaps; and signals with clocks of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, Meaning
from robid.logs.inspection.contents import Column
from robid.logs.inspection.names import read_name, time_unit, unit_of_name
from robid.logs.inspection.vocabulary import tokens
from robid.logs.pace import GAP, Pace, longest_piece, measure_pace
from robid.logs.parts import limits_of
from robid.logs.timing import UNSURE
from robid.signals.log_options import TIME_UNITS

_TIME = {
    "stamp": 4,
    **dict.fromkeys(("time", "timestamp", "zeit", "zeitstempel", "temps", "horodatage"), 3),
    **dict.fromkeys(("t", "seconds", "clock"), 2),
    **dict.fromkeys(("sec", "log", "ms"), 1),
}
"""Words of a name, and how surely each says that it is a time's."""

_REGULAR = 0.5  # share of usual steps from which a variable can be a time
_AGREES = 0.01
_EVEN = 0.01  # deviation of steps up to which a signal that says nothing of itself is a clock: rounded stamps have it
LIKELY = 2  # score from which a name or unit says that a variable is a time
_SURELY = 3  # score from which a variable is a time, whatever else is
_REPEATED = 0.02  # share of samples with the stamp of the one before from which stamps are no times of single samples
LEAST = 100
_USUAL_HZ = (10.0, 40e3)  # rates at which robots are recorded
_FASTEST_HZ = 1e6  # rate at which nothing here is recorded
_UNSTATED = ("s", "ms", "us", "ns")  # units that a time may have without saying so
_SLOWEST_HZ = 2.0  # rate from which a time with fractions may be in seconds
_LEAST_APART = 0.1  # steps from which two times of a row differ
_MOST_APART = 0.5  # share of the log up to which two times of a row are of one clock
_STRAIGHT = 1.0  # steps by which a ramp may be off a straight line: it is rounded


@dataclass(frozen=True)
class Sampling:
    """How a log was sampled."""

    variable: Annotated[str, Meaning("The variable of the time; empty where there is none.")]
    unit: Annotated[str, Meaning("Unit of that variable.")]
    is_stated: Annotated[bool, Meaning("Whether name or unit say so, or a number of the log agrees.")]
    step_s: Annotated[float | None, Meaning("Time step, those across gaps left out; null where nothing tells it [s].")]
    jitter: Annotated[float, Meaning("Largest deviation of a step from the usual one, relative, without gaps.")] = 0.0
    gaps: Annotated[int, Meaning("Gaps in the time.")] = 0
    missing: Annotated[int, Meaning("Samples that they lack.")] = 0
    first_gap: Annotated[int, Meaning("Index, from 0, of the sample before the first of them.")] = 0
    longest_step: Annotated[float, Meaning("Longest step, in usual ones.")] = 1.0
    longest: Annotated[
        tuple[int, int],
        Meaning("Index, from 0, of the first sample of the longest part without a gap, and of that after its last."),
    ] = (0, 0)
    longest_s: Annotated[
        tuple[float, float], Meaning("From where to where that part lasts, since the first sample [s].")
    ] = (0.0, 0.0)
    backward: Annotated[int, Meaning("Steps at which time stands still or goes back.")] = 0
    told_by: Annotated[str, Meaning("What else tells the time step, as a number of the log.")] = ""
    others: Annotated[tuple[str, ...], Meaning("Further times, as of the moment of writing.")] = ()
    later_s: Annotated[
        tuple[float, ...],
        Meaning(
            "By how much each of these is later than the time, in the median; 0 where it is no time of its kind [s]."
        ),
    ] = ()
    doubt: Annotated[str, Meaning("Why a time that there is does not tell the time step.")] = ""
    likely: Annotated[
        tuple[str, ...], Meaning("Units that its time may have, where several are as likely and nothing tells which.")
    ] = ()


def find_sampling(columns: Sequence[Column], scalars: Mapping[str, float], stated_s: float | None = None) -> Sampling:
    """Finds the time among signals of one length, else what tells the sampling period: the user [s], or a number."""
    known, told_by = (stated_s, "the command line") if stated_s else _from_scalars(scalars)
    coarse, doubt = _from_coarse(columns, known)
    if known is None and coarse is not None:
        known, told_by = coarse.step_s, coarse.told_by
    rated = [(rate_of_time(column, known), -index) for index, column in enumerate(columns)]
    best, index = max(rated, default=(0, 0))
    if best <= 0:
        return coarse or Sampling("", "s", bool(stated_s), known, told_by=told_by, doubt=doubt)
    column = columns[-index]
    unit, raw = time_unit(column)
    if raw and not unit and known is None:
        doubt = f"`{column.key}` is in `{raw}`, which is none of {', '.join(TIME_UNITS)}"
        return Sampling("", "s", is_stated=False, step_s=None, doubt=doubt)
    pace = measure_pace(column.values)
    usual = float(np.median(np.diff(column.values))) if pace is None else pace.step
    likely, is_stated = _units(column, usual, known)
    if not likely:
        doubt = f"the steps of `{column.key}` are {usual:.3g}, in whatever unit it is"
        return Sampling("", "s", bool(stated_s), known, told_by=told_by, doubt=doubt)
    unit = likely[0]
    found = _measure(column.name, column.values if pace is None else pace.times, pace, TIME_UNITS[unit])
    others = tuple(
        columns[-place]
        for score, place in rated
        if columns[-place] is not column
        and (score >= _SURELY or (score and np.array_equal(columns[-place].values, column.values)))
    )
    agrees = known is not None and found.step_s is not None and abs(found.step_s / known - 1) < _AGREES
    told_by = told_by if agrees else ""
    later = tuple(_later(column, one, unit) for one in others)
    found = replace(
        found,
        unit=unit,
        is_stated=is_stated or agrees,
        told_by=told_by,
        others=tuple(one.key for one in others),
        later_s=later,
    )
    return found if len(likely) == 1 else replace(found, step_s=None, likely=likely)


def _later(time: Column, other: Column, unit: str) -> float:
    """How much later another time of a log is than its own one [s]; 0 where they are alike or of different clocks."""
    to_s = TIME_UNITS[unit]
    steps = np.diff(time.values), np.diff(other.values)
    usual = float(np.median(steps[0]))
    apart = float(np.median(other.values - time.values))
    alike = abs(float(np.median(steps[1])) / usual - 1) < _AGREES and abs(apart) < _MOST_APART * float(
        np.ptp(time.values)
    )
    return apart * to_s if alike and abs(apart) > _LEAST_APART * usual else 0.0


def _from_coarse(columns: Sequence[Column], known_s: float | None) -> tuple[Sampling | None, str]:
    """The sampling by a time whose stamps several samples share, or why that does not tell it.

    A sampling period that is known otherwise has to agree with it.
    """
    doubt = ""
    for column in columns:
        unit, values = unit_of_name(column), column.values
        if unit not in TIME_UNITS or len(values) < LEAST or not np.all(np.isfinite(values)):
            continue
        to_s, pace = TIME_UNITS[unit], None
        if np.mean(np.diff(values) == 0) > _REPEATED:
            pace = measure_pace(values, None if known_s is None else known_s / to_s)
        if pace is None or not pace.rounding:
            continue
        told = f"rounded to {pace.rounding * to_s:.4g} s, it tells the rate"
        if pace.unsure > UNSURE:
            sure = f"to {100 * min(pace.unsure, 1.0):.2g} % only"
            doubt = f"`{column.key}` does not tell the sampling period: {told} {sure}"
        elif known_s is None or abs(pace.step * to_s / known_s - 1) <= pace.unsure:
            found, told_by = _measure(column.name, pace.times, pace, to_s), f"{told} to {100 * pace.unsure:.1g} %"
            return replace(found, unit=unit, is_stated=True, told_by=f"`{column.key}` ({told_by})"), ""
    return None, doubt


def rate_of_time(column: Column, known_s: float | None) -> int:
    """Returns how much a signal looks like a time; nothing or less where it cannot be one."""
    values = column.values
    if not np.all(np.isfinite(values)):
        return 0
    steps = np.diff(values)
    usual = np.median(steps)
    if usual <= 0 or np.mean(steps <= 0) > _REPEATED or np.mean(np.abs(steps / usual - 1) < _REGULAR) < _REGULAR:
        return 0
    # The last part of a name says most: `header.stamp` is one, `time_constant` none.
    words = tokens(column.name.rpartition("/")[2])
    score = max((_TIME.get(word, 0) for word in words), default=0)
    score += 1 if known_s is not None and abs(usual / known_s - 1) < _AGREES else 0
    score += 3 if time_unit(column)[0] in TIME_UNITS else 0
    return score or int(known_s is None and _is_clock(column, steps, float(usual)))


def _is_clock(column: Column, steps: FloatArray, usual: float) -> bool:
    """Whether what says nothing, or a letter only, rises in equal steps, as only clocks do; counters by one."""
    hint = read_name(column)
    if (hint.role and hint.by != "short") or usual == 1 or np.abs(steps / usual - 1).max() > _EVEN:
        return False
    return _USUAL_HZ[0] <= 1 / usual <= _USUAL_HZ[1]


def is_ramp(values: FloatArray) -> bool:
    """Whether a signal (n_sample,) rises or falls evenly all along, as clocks and counters do and no motion."""
    steps = np.diff(values)
    if len(steps) == 0 or not np.all(np.isfinite(steps)) or steps.max() == steps.min() == 0:
        return False
    if steps.min() < 0 < steps.max():
        return False
    line = np.linspace(values[0], values[-1], len(values))
    return bool(np.abs(values - line).max() <= _STRAIGHT * np.abs(steps).max() and np.mean(steps == 0) < 1 - _REGULAR)


def _units(column: Column, usual: float, known_s: float | None) -> tuple[tuple[str, ...], bool]:
    stated, _ = time_unit(column)
    if stated in TIME_UNITS:
        return (stated,), True
    if known_s is not None:
        for unit, factor in TIME_UNITS.items():
            if abs(known_s / (usual * factor) - 1) < _AGREES:
                return (unit,), True
    # Units in which a time with such steps is that of a robot's log
    whole = bool(np.all(column.values == np.round(column.values)))
    rates = {unit: 1 / (usual * TIME_UNITS[unit]) for unit in _UNSTATED}
    within = [unit for unit, rate in rates.items() if _USUAL_HZ[0] <= rate <= _USUAL_HZ[1]]
    slow = not whole and _SLOWEST_HZ <= rates["s"] < _USUAL_HZ[0]
    if not within and not slow and rates["s"] > _FASTEST_HZ:
        return (), False
    return tuple(["s", *within] if slow else within or ["s"]), False


def _measure(variable: str, times: FloatArray, pace: Pace | None, to_s: float) -> Sampling:
    """Measures the steps of a time; its gaps and step as its pace has them, where it has one."""
    steps = np.diff(times)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) if pace is None else pace.gaps
    inside = np.delete(steps, gaps)
    inside = inside[inside > 0]
    mean = float(inside.mean()) if pace is None else pace.step
    begin, end = longest_piece(gaps, len(times))
    return Sampling(
        variable,
        "s",
        is_stated=False,
        step_s=_short(mean * to_s),
        jitter=float(np.abs(inside / mean - 1).max()),
        gaps=len(gaps),
        missing=round(float(np.sum(steps[gaps] / mean - 1))),
        first_gap=int(gaps[0]) if len(gaps) else 0,
        longest_step=float(steps.max() / mean),
        longest=(begin, end),
        longest_s=limits_of(to_s * (times - times[0]), begin, max(end - 1, begin + 1)),
        backward=int(np.count_nonzero(steps <= 0)),
    )


def _short(step_s: float) -> float:
    """A step with no more digits than it needs."""
    for digits, allowed in ((3, 5e-5), (6, 1e-7)):
        short = float(f"{step_s:.{digits}g}")
        if abs(short / step_s - 1) < allowed:
            return short
    return float(f"{step_s:.9g}")


def _from_scalars(scalars: Mapping[str, float]) -> tuple[float | None, str]:
    """A sampling period that a number of the log tells by its name, and that name [s]."""
    for name, value in scalars.items():
        words = tokens(name.rpartition(".")[2])
        if not value > 0:
            continue
        if words == ("fs",) or words in (("sample", "rate"), ("sampling", "rate"), ("sampling", "frequency")):
            return 1 / value, f"`{name}`"
        if words in (("ts",), ("dt",), ("sampling", "period"), ("sample", "time"), ("sampling", "time")):
            return value, f"`{name}`"
    return None, ""
