"""Compares the period and the clock that a log shows with those that were said, and says what to set instead."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.logs.losses import Part, lost_samples, part_losses
from robid.logs.mapping import Stated, set_all
from robid.logs.period import Repetition, band_of, check_lines, measure_repetition, measure_share
from robid.logs.timing import ALONE, EVERY_LOG, RESAMPLED_RATE, Clock, clock_problems

_WHOLE = 5e-7  # largest relative distance of a period from whole samples that settings accept, a margin kept
_OTHER_PERIODS = "other logs of the campaign repeat otherwise, and a period of each is made"
_LISTED = 40  # lines up to which all are listed in a remedy
_SURE = 0.05  # standard deviation of a measured period up to which it says what to resample to [samples]


class OtherPeriodError(DataError):
    """A log that repeats with another period than was stated; by that one no gap lies between its periods."""


def check_period(
    where: str, steady: FloatArray, stated: Stated, clock: Clock | None = None, part: Part | None = None
) -> tuple[list[DataError], list[str]]:
    """Measures the period of an excited channel and compares it, and the log's clock, with what was said.

    Period and clock are judged together, so that what is advised for one does not spoil the other. Lost samples are no
    other period: they are named where they are used. Then the excited lines are checked.

    `steady` (n_sample,) is the channel without its dropped periods; `part` says which part of the log, its first
    periods by default. Returns problems and notes.
    """
    part = Part() if part is None else part
    used = part.used(len(steady), stated)
    gaps = np.zeros(0, int) if clock is None else clock.gaps[(clock.gaps >= used[0]) & (clock.gaps < used[1] - 1)]
    if clock is not None and np.any((gaps + 1 - used[0]) % stated.samples):
        return _across_gaps(where, steady, stated, clock, gaps), []
    losses, whole = ([], steady) if clock is not None and clock.is_off else part_losses(steady, stated, part)
    if losses:
        return lost_samples(where, losses, len(steady), stated, part, clock), []
    problems, notes = _check_whole(where, whole, stated, clock)
    if len(whole) < len(steady) and not problems:
        notes.append("Samples are lost beside the periods that are used.")
    return problems, notes


def _across_gaps(where: str, steady: FloatArray, stated: Stated, clock: Clock, gaps: IntArray) -> list[DataError]:
    """Says the period of a channel whose gaps break the stated one, where whole periods of another one are missing.

    Else nothing repeats across them, and the time names them.
    """
    found = measure_repetition(steady, stated.samples, stated.lines)
    if clock.is_off or found.samples is None or found.agrees(stated.samples, stated.lines):
        return []
    missing = np.round((clock.time_s[gaps + 1] - clock.time_s[gaps]) / clock.step_s - 1)
    beside = np.abs(missing - found.samples * np.round(missing / found.samples))
    if _shares_no_clock(found, stated) or np.any(beside > 0.5):
        return []
    return [_other_period(where, steady, stated, found)]


def _check_whole(
    where: str, steady: FloatArray, stated: Stated, clock: Clock | None
) -> tuple[list[DataError], list[str]]:
    found = measure_repetition(steady, stated.samples, stated.lines)
    notes = [] if found.reachable else ["The log contains one period: its length could not be checked by repetition."]
    if found.samples is None and found.reachable:
        what = f"D098 It does not repeat with a period of {stated.samples} samples, nor with any other."
        remedy = "Check that the excitation is periodic and that this is the excited channel."
        return [*(() if clock is None else clock_problems(clock)), DataError(what, where=where, remedy=remedy)], notes
    if clock is not None and clock.is_off:
        return [_other_clock(where, steady, stated, clock, found)], notes
    if _shares_no_clock(found, stated):
        return [_two_clocks(where, stated, found)], notes
    if not found.agrees(stated.samples, stated.lines):
        return [_other_period(where, steady, stated, found)], notes
    if found.std_samples > 0.2:
        notes.append(f"The noise lets the period be checked to +-{4 * found.std_samples:.1g} samples only.")
    whole_periods = len(steady) // stated.samples
    blocks = steady[: whole_periods * stated.samples].reshape(whole_periods, stated.samples)
    return [] if stated.find else check_lines(where, blocks[: stated.periods], stated.lines), notes


def _shares_no_clock(found: Repetition, stated: Stated) -> bool:
    """Whether a period near the stated one is no whole number of samples, by enough to spoil its average."""
    if found.samples is None or found.std_samples > _SURE:
        return False
    count = found.multiple(stated.samples)
    near = abs(count * found.samples / stated.samples - 1) < RESAMPLED_RATE and not np.any(stated.lines % count)
    proposed = found.proposed(stated.samples, stated.lines)
    return bool(near and found.drifts(stated.periods, proposed, stated.lines))


def _two_clocks(where: str, stated: Stated, found: Repetition) -> DataError:
    length = (found.samples or 0.0) * found.multiple(stated.samples)
    what = f"D099 Its period is {length:.4f} samples, not a whole number: generator and log have different clocks."
    remedy = f"Set resample to period, which makes {stated.samples} samples of a period of {stated.period_s:.9g} s."
    return DataError(what, where=where, remedy=remedy)


def _other_clock(where: str, steady: FloatArray, stated: Stated, clock: Clock, found: Repetition) -> DataError:
    """A sampling period that the log's own time contradicts; the period may be as stated, or another one too."""
    step = clock.told_step_s
    real = found.proposed(stated.samples, stated.lines)
    lasts = real * step
    if clock.differs and not clock.is_bridged:
        return DataError(f"D100 {clock.told}.", where=clock.where, remedy=ALONE)
    if abs(lasts / stated.period_s - 1) < max(_WHOLE, 0.5 * step / stated.period_s):
        return DataError(f"D101 {clock.told}.", where=clock.where, remedy=_same_period(stated, clock))
    what = (
        f"D102 {clock.told}; and {where.partition('variable ')[2] or 'it'} repeats every {real} samples ({lasts:.9g}"
        f" s), not every {stated.samples} ({stated.period_s:.9g} s)."
    )
    changed = {"sampling_period_s": _number(step), **_period_settings(steady, stated, real, step)}
    # Once the clock is right, a fraction of a sample would be the next message's reason.
    split = found.std_samples <= _SURE and found.drifts(stated.periods, real, stated.lines)
    remedy = set_all({**changed, **({"resample": "period"} if split else {})})
    if clock.is_bridged and not split and clock.differs:
        settings = set_all({"resample": "time", "excitation.period_s": f"{lasts:.9g}"})
        remedy = f"{settings[:-1]}: {EVERY_LOG} of {stated.sampling_period_s:g} s."
    elif clock.is_bridged and not split:
        remedy += f" Or, where logs have different clocks: set resample to time and excitation.period_s to {lasts:.9g}."
    return DataError(what, where=clock.where, remedy=remedy)


def _same_period(stated: Stated, clock: Clock) -> str:
    """What to set where the log's own time contradicts the sampling period alone; a period stays whole samples."""
    counted = max(round(stated.period_s / clock.told_step_s), 1)
    if clock.differs:
        return f"Set resample to time: {EVERY_LOG} of {clock.stated_s:g} s."
    if abs(stated.period_s / clock.told_step_s / counted - 1) < _WHOLE:
        return f"{set_all({'sampling_period_s': _number(clock.told_step_s)})[:-1]}; the period stays as it is."
    if clock.is_bridged:
        return f"Set resample to time, which keeps the period of {stated.period_s:.9g} s."
    settings = {"sampling_period_s": f"{stated.period_s / counted:.12g}", "resample": "time"}
    return f"{set_all(settings)[:-1]}: a period of {stated.period_s:.9g} s is then {counted} samples."


def _other_period(where: str, steady: FloatArray, stated: Stated, found: Repetition) -> OtherPeriodError:
    real = found.proposed(stated.samples, stated.lines)
    step = stated.sampling_period_s
    what = (
        f"D103 It repeats every {real} samples ({real * step:.9g} s), not every {stated.samples} "
        f"({stated.period_s:.9g} s)."
    )
    if real == stated.samples:
        real = round(found.samples or real)
        what = (
            f"D104 It repeats every {real} samples ({real * step:.9g} s), and not all of the excited lines of"
            f" {stated.samples} samples ({stated.period_s:.9g} s) are lines of that."
        )
    if stated.differs and abs(real / stated.samples - 1) < RESAMPLED_RATE:
        remedy = f"Set resample to period: {_OTHER_PERIODS} {stated.samples} samples of {stated.period_s:.9g} s."
        return OtherPeriodError(what, where=where, remedy=remedy)
    settings = set_all(_period_settings(steady, stated, real, step))
    return OtherPeriodError(what, where=where, remedy=f"{settings[:-1]}, or correct sampling_period_s.")


def _period_settings(steady: FloatArray, stated: Stated, real: int, step_s: float) -> dict[str, str]:
    """Settings that a period needs: its length, the band and number of its lines, and no more periods than it has.

    The band follows the period where the lines keep their numbers, as with another clock. Else the frequencies stay.
    """
    lasts = real * step_s
    found = {"excitation.period_s": _number(lasts)}
    periods = len(steady) // real
    blocks = steady[: periods * real].reshape(periods, real)
    lines, band = stated.lines, stated.lines[[0, -1]] * lasts / stated.period_s
    grid = np.arange(int(np.ceil(band[0] - 1e-6)), int(np.floor(band[1] + 1e-6)) + 1)
    kept = _fit_of(blocks, grid)
    if abs(lasts / stated.period_s - 1) < _WHOLE:
        pass
    elif _fit_of(blocks, lines) > kept:
        if not stated.listed:
            low, high = band_of(float(lines[0]) - 0.5, float(lines[-1]) + 0.5, lasts)
            found |= {"excitation.low_hz": _number(low), "excitation.high_hz": _number(high)}
    elif kept > 0:
        inside = np.intersect1d(measure_share(blocks, grid)[1], grid)
        if stated.listed:
            found["excitation.lines"] = f"[{', '.join(map(str, inside))}]" if len(inside) <= _LISTED else "found"
        elif 0 < len(inside) < len(lines) and not stated.find:
            found["excitation.count"] = str(len(inside))
        if np.all(lines % 2) and np.any(inside % 2 == 0) and not stated.listed:
            found["excitation.grid"] = "full"
    return {**found, **_counts(len(steady), stated, real)}


def _counts(n_steady: int, stated: Stated, real: int) -> dict[str, str]:
    """Settings of how many periods are dropped and used, where the real period asks for others."""
    found = {}
    # What is dropped stays about the time that it was.
    dropped = round(stated.dropped * stated.samples / real) if stated.dropped else 0
    dropped = max(dropped, 1) if stated.dropped else 0
    total = (n_steady + stated.dropped * stated.samples) // real
    if stated.dropped and dropped != stated.dropped:
        found["drop_periods"] = str(dropped)
    if dropped + stated.periods > total and total > dropped:
        found["periods"] = str(total - dropped)
    return found


def _fit_of(blocks: FloatArray, lines: IntArray) -> float:
    """How well lines are those that carry a signal: their share of its energy times the share of them that carry."""
    if not len(blocks) or not len(lines) or 2 * lines[-1] >= blocks.shape[1]:
        return 0.0
    share, carrying = measure_share(blocks, lines)
    return share * len(np.intersect1d(carrying, lines)) / len(lines)


def _number(value: float) -> str:
    return f"{value:.9g}"
