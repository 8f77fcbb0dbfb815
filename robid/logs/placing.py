"""Which samples of a log are its periods: after those dropped, or where its references match what was played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.loss_checks import Part
from robid.logs.mapping import LogMapping
from robid.logs.match import Match, PlayedExcitation, check_size, explain_mismatch, find_periods
from robid.logs.period import measure_repetition
from robid.logs.period_checks import check_period
from robid.logs.stated import Stated
from robid.logs.timing import Clock, check_count
from robid.signals.log_channels import LogChannel

_STILL = 1e-3
"""Distance from its last sample, relative to its span, within which a reference rests."""


@dataclass(frozen=True)
class Log:
    """The columns of a log, and its own time where it has one that can be read.

    Attributes:
        columns: The columns, all of one clock.
        clock: The log's own time.
        slow: The variable with the longest sampling period of those that were brought to a shorter one; empty for none.
        slow_s: That sampling period [s].
        ends: What ends before the others, and when; empty for nothing.
    """

    columns: dict[str, NDArray[Any]]
    clock: Clock | None
    slow: str = ""
    slow_s: float = 0.0
    ends: str = ""

    @property
    def n_sample(self) -> int:
        """Samples of the shortest column."""
        return min((len(column) for column in self.columns.values()), default=0)


def check_band(mapping: LogMapping, log: Log, frequencies_hz: FloatArray) -> list[DataError]:
    """Refuses lines of which a channel that was sampled more slowly than the others tells nothing.

    Args:
        mapping: The log mapping.
        log: The log.
        frequencies_hz (n_freq,): The lines [Hz].
    """
    if not log.slow or frequencies_hz.max(initial=0.0) < 0.5 / log.slow_s:
        return []
    below = frequencies_hz[frequencies_hz < 0.5 / log.slow_s]
    what = (
        f"`{log.slow}` was sampled every {log.slow_s:.6g} s: it shows nothing above {0.5 / log.slow_s:.6g} Hz, and the"
        f" lines go up to {frequencies_hz.max():.6g} Hz."
    )
    remedy = (
        f"Set excitation.high_hz to {below.max():.6g}, or leave out the lines above." if len(below) else "Log faster."
    )
    return [DataError(what, where=str(mapping.file), remedy=remedy)]


def strongest_channel(
    mapping: LogMapping, log: Log, channels: Sequence[LogChannel], start: int, stop: int | None = None
) -> tuple[str, FloatArray] | None:
    """The channel that moves most from a sample on, up to another: where it comes from, and its samples there."""
    usable = [channel for channel in channels if channel.column in log.columns]
    signals = [channel.factor * log.columns[channel.column][start:stop].astype(float) for channel in usable]
    finite = [(np.ptp(values), index) for index, values in enumerate(signals) if len(values) > 2]
    finite = [(size, index) for size, index in finite if np.isfinite(size) and size > 0]
    if not finite:
        return None
    strongest = max(finite)[1]
    return mapping.place(usable[strongest].column), signals[strongest]


def place_periods(mapping: LogMapping, log: Log, stated: Stated) -> tuple[int, list[DataError], list[str]]:
    """First sample that is used where the log has no references; checks the period on the input that moves most."""
    start = stated.dropped * stated.samples
    problems = check_count(mapping, log.n_sample, stated.samples, stated.periods, log.ends) if log.n_sample else []
    if mapping.take == "last":
        start = max(log.n_sample - stated.periods * stated.samples, 0)
    part = Part(0 if problems else start, mapping.take == "last")
    stop = None if problems else _next_gap(log, start + stated.periods * stated.samples)
    strongest = strongest_channel(mapping, log, mapping.inputs, part.start, stop)
    if strongest is None:
        return start, problems, []
    found, notes = check_period(*strongest, stated, log.clock, part)
    # A wrong period is why a log holds too few of it.
    return start, found or problems, notes


def _next_gap(log: Log, used: int) -> int | None:
    """Where the first gap at or after the end of what is used begins: what comes later need not fit it."""
    if log.clock is None:
        return None
    gaps = log.clock.gaps[log.clock.gaps >= used - 1]
    return int(gaps[0]) + 1 if len(gaps) else None


def match_periods(
    mapping: LogMapping, log: Log, played: PlayedExcitation, stated: Stated
) -> tuple[int, list[DataError], list[str]]:
    """First sample that is used, where the logged references show which periods were played."""
    names = tuple(channel.name for channel in mapping.references)
    where = f"{mapping.file}: references"
    found = [log.columns.get(channel.column) for channel in mapping.references]
    kept = [column for column in found if column is not None and np.all(np.isfinite(column))]
    if len(kept) < len(names) or len({len(column) for column in kept}) > 1:
        return 0, [], []
    logged = np.stack(kept, axis=-1).astype(float) * [channel.factor for channel in mapping.references]
    n_sample = len(played.expected)
    wanted = stated.dropped + stated.periods
    if len(logged) < wanted * n_sample:
        return 0, check_count(mapping, len(logged), n_sample, stated.periods, log.ends), []
    match = find_periods(logged, played.expected)
    if match.count < wanted:
        return 0, _unmatched(mapping, logged, played, stated, log), []
    stop = match.start + match.count * n_sample
    steady = logged[match.start : stop, int(np.argmax(np.ptp(logged, axis=0)))]
    part = Part(match.start, mapping.take == "last", matched=True)
    problems, notes = check_period(where, steady, stated, log.clock, part)
    sizes, size_notes = _sizes(mapping, match, played)
    problems += sizes
    first = match.count - stated.periods if mapping.take == "last" else stated.dropped
    return match.start + first * n_sample, problems, [*notes, *size_notes]


def _sizes(mapping: LogMapping, match: Match, played: PlayedExcitation) -> tuple[list[DataError], list[str]]:
    """Says which logged references differ in size from the excitation, as a wrong unit or scale makes them."""
    names = tuple(channel.name for channel in mapping.references)
    sizes, notes = check_size(match.gain, names, np.sqrt(np.mean(played.expected**2, axis=0)))
    if not sizes:
        return [], notes
    what = f"The references differ in size from the excitation: {'; '.join(sizes)}."
    remedy = "Correct their unit or scale, or set excitation.rms to what was played and design again."
    return [DataError(what, where=f"{mapping.file}: references", remedy=remedy)], notes


def _unmatched(
    mapping: LogMapping, logged: FloatArray, played: PlayedExcitation, stated: Stated, log: Log
) -> list[DataError]:
    """Says why a log does not hold the periods that are needed."""
    names = tuple(channel.name for channel in mapping.references)
    where, n_sample = f"{mapping.file}: references", len(played.expected)
    match = find_periods(logged, played.expected)
    if match.count == 0:
        what, remedy = explain_mismatch(logged, played, names)
        return [DataError(what, where=where, remedy=remedy)]
    steady = _playing(logged[match.start :, int(np.argmax(np.ptp(logged, axis=0)))])
    # Where samples were lost on the way nothing repeats, and the count says more.
    if measure_repetition(steady, n_sample, stated.lines).samples is not None:
        problems, _ = check_period(where, steady, stated, log.clock, Part(match.start, matched=True))
        if problems:
            return problems
    stop = match.start + match.count * n_sample
    what = (
        f"The excitation is there from sample {match.start} to {stop}, {match.count} whole"
        f" period{'' if match.count == 1 else 's'}, fewer than the"
        f" {stated.dropped + stated.periods} that were said ({stated.dropped} dropped and {stated.periods} used)."
        f"{log.ends and f' {log.ends}'}"
    )
    fewer = match.count - stated.dropped
    shorter = f"set periods to {fewer}" if fewer > 0 else "record longer"
    before = f"before sample {match.start} and " if match.start else ""
    remedy = f"Look for lost samples {before}after sample {stop}, or {shorter}."
    # A wrong size would only come up once the count is right.
    return [DataError(what, where=where, remedy=remedy), *_sizes(mapping, match, played)[0]]


def _playing(signal: FloatArray) -> FloatArray:
    """A reference without the rest at its end."""
    moving = np.flatnonzero(np.abs(signal - signal[-1]) > _STILL * np.ptp(signal))
    return signal[: moving[-1] + 2] if len(moving) else signal
