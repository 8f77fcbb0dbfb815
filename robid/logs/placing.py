"""Which samples of a log are its periods: after those dropped, or where its references match what was played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.logs.clocks import Log
from robid.logs.losses import Part
from robid.logs.mapping import LogMapping, Stated
from robid.logs.period import measure_repetition
from robid.logs.period_checks import check_period
from robid.logs.timing import check_count
from robid.signals.log_channels import LogChannel

ALIKE = 0.9
"""Correlation from which a stretch of a log counts as a played period."""

_MISSING = 1e-3  # correlation that a period may lack beyond noise: half the share of its energy that is missing
_BESIDE = 16  # part of a period about its first sample in which a better one is looked for
_SILENT = 1e-6  # energy of a period, relative to the strongest one, below which nothing was played
_SIZE_TOLERANCE = 0.1  # relative error of a reference's size that is refused; a tenth of it is noted
_UNITS = {180 / np.pi: "deg for rad", np.pi / 180: "rad for deg", 30 / np.pi: "rpm for rad/s", 1e3: "a factor of 1000"}


@dataclass(frozen=True)
class PlayedExcitation:
    """What was designed for a campaign, and which part of it a log should hold."""

    reference: FloatArray  # (n_real, n_exp, n_sample, n_motor) One period of the excitation
    kind: str  # What it is: `speed_reference`, `position_reference` or `torque`
    realization: int  # Index of the realization that was played
    experiment: int  # Index of the experiment that was played

    @property
    def expected(self) -> FloatArray:
        """The period (n_sample, n_motor) that the log should hold."""
        return np.asarray(self.reference[self.realization, self.experiment])


@dataclass(frozen=True)
class Match:
    """Where a log holds the periods of an excitation."""

    start: int  # First sample of the first period that matches
    count: int  # Periods in succession that match, from `start`
    correlation: float  # Largest correlation anywhere in the log, mean over the motors
    gain: FloatArray  # (n_motor,) Size of the logged references relative to the excitation, over these periods


def find_periods(logged: FloatArray, period: FloatArray) -> Match:
    """Finds the periods of an excitation in a log that begins and ends anywhere.

    Args:
        logged (n_log, n_motor): Logged references; an offset does not matter.
        period (n_sample, n_motor): One period of the excitation.

    Returns:
        The match; no period where the correlation stays below `ALIKE`.
    """
    n_sample = len(period)
    each = correlation(logged, period)
    mean = each.mean(axis=1)
    best = int(np.argmax(mean))
    if mean[best] < ALIKE:
        return Match(best, 0, float(mean[best]), np.zeros(period.shape[1]))
    # A period of which a few samples are missing, where play began or ended, is none.
    counts, start = _longest(mean, n_sample, max(ALIKE, 1 - 2 * (1 - float(mean[best])) - _MISSING))
    start = _aligned(mean, counts, start, n_sample)
    count = int(counts[start])
    blocks = logged[start : start + count * n_sample].reshape(count, n_sample, -1).mean(axis=0)
    gain = np.sum(blocks * period, axis=0) / np.sum(period**2, axis=0)
    return Match(start, count, float(mean[best]), np.asarray(gain))


def _longest(mean: FloatArray, n_sample: int, limit: float) -> tuple[IntArray, int]:
    """Periods in succession from each sample on, and the first one of the most; of as many, those most alike.

    Lost samples move what follows, so that other periods may begin at other samples.
    """
    count = (mean >= limit).astype(int)
    total = np.where(count > 0, mean, 0.0)
    for begin in reversed(range(0, len(mean) - n_sample, n_sample)):
        following = slice(begin + n_sample, min(begin + 2 * n_sample, len(mean)))
        here = slice(begin, begin + following.stop - following.start)
        total[here] += np.where(count[here] > 0, total[following], 0.0)
        count[here] *= 1 + count[following]
    longest = np.flatnonzero(count == count.max())
    return count, int(longest[np.argmax(total[longest])])


def _aligned(mean: FloatArray, counts: IntArray, start: int, n_sample: int) -> int:
    """First sample of the same periods where they are most alike.

    A slow signal is nearly so a sample beside them, where a log that begins a little late seems to hold one more.
    """
    near = n_sample // _BESIDE
    begins = start + n_sample * np.arange(counts[start])
    inner = begins[(begins >= near) & (begins + near < len(mean))]
    if not len(inner):
        return start
    beside = np.arange(-near, near + 1)
    moved = start + int(beside[np.argmax(mean[inner[:, None] + beside].mean(axis=0))])
    if moved < 0 or not counts[moved]:
        moved += n_sample
    return moved if moved < len(counts) and counts[moved] >= max(counts[start] - 1, 1) else start


def correlation(logged: FloatArray, period: FloatArray) -> FloatArray:
    """Correlation coefficient (n_log - n_sample + 1, n_motor) of a period with each stretch of a log."""
    n_log, n_sample = len(logged), len(period)
    length = next_fast_len(n_log, real=True)
    flat, wanted = logged - logged.mean(axis=0), period - period.mean(axis=0)
    spectrum = rfft(flat, length, axis=0) * np.conj(rfft(wanted, length, axis=0))
    product = irfft(spectrum, length, axis=0)[: n_log - n_sample + 1]
    zero = np.zeros((1, flat.shape[1]))
    total, square = (np.concatenate([zero, np.cumsum(values, axis=0)]) for values in (flat, flat**2))
    energy = square[n_sample:] - square[:-n_sample] - (total[n_sample:] - total[:-n_sample]) ** 2 / n_sample
    moving = energy > _SILENT * energy.max(axis=0)
    scale = np.sqrt(np.where(moving, energy, 1.0) * np.sum(wanted**2, axis=0))
    return np.asarray(np.where(moving, product / scale, 0.0))


def explain_mismatch(logged: FloatArray, played: PlayedExcitation, names: tuple[str, ...]) -> tuple[str, str]:
    """Says what logged references (n_log, n_motor) hold instead of the expected period, and what to do."""
    n_real, n_exp = played.reference.shape[:2]
    each = correlation(logged, played.expected)
    at = int(np.argmax(np.abs(each).mean(axis=1)))
    reversed_ = [name for name, value in zip(names, each[at], strict=True) if value < 0]
    foreign = [name for name, value in zip(names, np.abs(each[at]), strict=True) if value < ALIKE]
    remedy = "Check `file`, and that this excitation was played: the artifact's export, unchanged."
    scores = {
        (r, e): float(correlation(logged, played.reference[r, e]).mean(axis=1).max())
        for r, e in np.ndindex(n_real, n_exp)
    }
    found = max(scores, key=lambda key: scores[key])
    if scores[found] >= ALIKE:
        what = f"D235 It contains realization {found[0] + 1}, experiment {found[1] + 1} of the excitation, not"
        sign = f"; or correct the sign of {', '.join(reversed_)}" if not foreign and reversed_ else ""
        wanted = f"realization {played.realization + 1}, experiment {played.experiment + 1}"
        return f"{what} {wanted}.", f"Name the log files as they were played{sign}."
    if not foreign:
        what = f"D237 The references of {', '.join(reversed_)} count the other way than those of the other motors."
        return what, "Set `sign: -1` for these references, or for the others."
    if 0 < len(foreign) < len(names):
        what = f"D238 The references of {', '.join(foreign)} are not those of the excitation; the other motors' are."
        return what, "Check the variables of these references."
    what = f"D239 It contains no period of the excitation: the correlation is {scores[found]:.2f} at most,"
    return f"{what} over all {n_real} realizations of {n_exp} experiments.", remedy


def check_size(gain: FloatArray, names: tuple[str, ...], rms: FloatArray) -> tuple[list[str], list[str]]:
    """Finds problems and notes of the sizes (n_motor,) of references over the excitation's, whose RMS is (n_motor,)."""
    problems, notes = [], []
    for name, value, size in zip(names, gain.tolist(), rms.tolist(), strict=True):
        if abs(value - 1) > _SIZE_TOLERANCE:
            unit = next((text for factor, text in _UNITS.items() if abs(value / factor - 1) < _SIZE_TOLERANCE), "")
            told = f", as {unit}" if unit else f" (RMS {value * size:.4g}, designed {size:.4g})"
            problems.append(f"{name} {value:.4g} times{told}")
        elif abs(value - 1) > 0.1 * _SIZE_TOLERANCE:
            notes.append(f"The logged reference of {name} has {value:.4g} times the designed size.")
    return problems, notes


_STILL = 1e-3  # distance from its last sample, relative to its span, within which a reference rests


def check_band(mapping: LogMapping, log: Log, frequencies_hz: FloatArray) -> list[DataError]:
    """Refuses lines [Hz] of which a channel that was sampled more slowly than the others tells nothing."""
    if not log.slow or frequencies_hz.max(initial=0.0) < 0.5 / log.slow_s:
        return []
    below = frequencies_hz[frequencies_hz < 0.5 / log.slow_s]
    what = (
        f"D105 `{log.slow}` was sampled every {log.slow_s:.6g} s: it shows nothing above {0.5 / log.slow_s:.6g} Hz, and"
        f" the lines go up to {frequencies_hz.max():.6g} Hz."
    )
    remedy = f"Set excitation.high_hz to {below.max():.6g}, or leave out lines above." if len(below) else "Log faster."
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
    gaps = np.zeros(0, int) if problems or log.clock is None else log.clock.gaps
    # What comes after the first gap at or behind the end of what is used need not fit it.
    stop = next((int(gap) + 1 for gap in gaps if gap >= start + stated.periods * stated.samples - 1), None)
    strongest = strongest_channel(mapping, log, mapping.inputs, part.start, stop)
    if strongest is None:
        return start, problems, []
    found, notes = check_period(*strongest, stated, log.clock, part)
    # A wrong period is why a log holds too few of it.
    return start, found or problems, notes


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
    what = f"D106 The references differ in size from the excitation: {'; '.join(sizes)}."
    remedy = "Correct their unit or scale, or set excitation.rms to what was played and design again."
    return [DataError(what, where=f"{mapping.file}: references", remedy=remedy)], notes


def _unmatched(
    mapping: LogMapping, logged: FloatArray, played: PlayedExcitation, stated: Stated, log: Log
) -> list[DataError]:
    names = tuple(channel.name for channel in mapping.references)
    where, n_sample = f"{mapping.file}: references", len(played.expected)
    match = find_periods(logged, played.expected)
    if match.count == 0:
        what, remedy = explain_mismatch(logged, played, names)
        return [DataError(what, where=where, remedy=remedy)]
    steady = logged[match.start :, int(np.argmax(np.ptp(logged, axis=0)))]
    moving = np.flatnonzero(np.abs(steady - steady[-1]) > _STILL * np.ptp(steady))
    steady = steady[: moving[-1] + 2] if len(moving) else steady  # without the rest at its end
    # Where samples were lost on the way nothing repeats, and the count says more.
    if measure_repetition(steady, n_sample, stated.lines).samples is not None:
        problems, _ = check_period(where, steady, stated, log.clock, Part(match.start, matched=True))
        if problems:
            return problems
    stop = match.start + match.count * n_sample
    what = (
        f"D107 The excitation is there from sample {match.start} to {stop}, {match.count} whole"
        f" period{'' if match.count == 1 else 's'}, fewer than the {stated.dropped + stated.periods} that were said"
        f" ({stated.dropped} dropped and {stated.periods} used).{log.ends and f' {log.ends}'}"
    )
    fewer = match.count - stated.dropped
    shorter = f"set periods to {fewer}" if fewer > 0 else "record longer"
    before = f"before sample {match.start} and " if match.start else ""
    remedy = f"Look for lost samples {before}after sample {stop}, or {shorter}."
    # A wrong size would only come up once the count is right.
    return [DataError(what, where=where, remedy=remedy), *_sizes(mapping, match, played)[0]]
