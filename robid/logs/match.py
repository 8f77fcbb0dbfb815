"""Matches a log's references to the excitation that was played: where its periods begin, its signs and sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from robid.arrays import FloatArray, IntArray

ALIKE = 0.9
"""Correlation from which a stretch of a log counts as a played period."""

_MISSING = 1e-3
"""Correlation that a period may lack beyond noise: half the share of its energy that is missing."""

_BESIDE = 16
"""Part of a period about its first sample in which a better one is looked for."""

_SILENT = 1e-6
"""Energy of a period, relative to the strongest one, below which nothing was played."""

_SIZE_TOLERANCE = 0.1
"""Relative error of a reference's size that is refused; a tenth of it is noted."""

_UNITS = {180 / np.pi: "deg for rad", np.pi / 180: "rad for deg", 30 / np.pi: "rpm for rad/s", 1e3: "a factor of 1000"}


@dataclass(frozen=True)
class PlayedExcitation:
    """What was designed for a campaign, and which part of it a log should hold.

    Attributes:
        reference (n_real, n_exp, n_sample, n_motor): One period of the excitation.
        kind: What it is: `speed_reference`, `position_reference` or `torque`.
        realization: Index of the realization that was played.
        experiment: Index of the experiment that was played.
    """

    reference: FloatArray
    kind: str
    realization: int
    experiment: int

    @property
    def expected(self) -> FloatArray:
        """The period (n_sample, n_motor) that the log should hold."""
        return np.asarray(self.reference[self.realization, self.experiment])


@dataclass(frozen=True)
class Match:
    """Where a log holds the periods of an excitation.

    Attributes:
        start: First sample of the first period that matches.
        count: Periods in succession that match, from `start`.
        correlation: Largest correlation anywhere in the log, mean over the motors.
        gain (n_motor,): Size of the logged references relative to the excitation, over these periods.
    """

    start: int
    count: int
    correlation: float
    gain: FloatArray


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
    """Says what a log holds instead of the expected period, and what to do.

    Args:
        logged (n_log, n_motor): Logged references.
        played: The excitation.
        names: Names of the motors.
    """
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
        what = f"It holds realization {found[0] + 1}, experiment {found[1] + 1} of the excitation, not"
        sign = f"; or correct the sign of {', '.join(reversed_)}" if not foreign and reversed_ else ""
        wanted = f"realization {played.realization + 1}, experiment {played.experiment + 1}"
        return f"{what} {wanted}.", f"Name the log files as they were played{sign}."
    if not foreign:
        what = f"The references of {', '.join(reversed_)} count the other way than those of the other motors."
        return what, "Set `sign: -1` for these references, or for the others."
    if 0 < len(foreign) < len(names):
        what = f"The references of {', '.join(foreign)} are not those of the excitation; the other motors' are."
        return what, "Check the variables of these references."
    what = f"It holds no period of the excitation: the correlation is {scores[found]:.2f} at most,"
    return f"{what} over all {n_real} realizations of {n_exp} experiments.", remedy


def check_size(gain: FloatArray, names: tuple[str, ...], rms: FloatArray) -> tuple[list[str], list[str]]:
    """Compares the size of the logged references with the excitation's.

    Args:
        gain (n_motor,): Logged over designed size.
        names: Names of the motors.
        rms (n_motor,): RMS of the excitation, in its unit.

    Returns:
        Problems and notes, one phrase for each motor.
    """
    problems, notes = [], []
    for name, value, size in zip(names, gain.tolist(), rms.tolist(), strict=True):
        if abs(value - 1) > _SIZE_TOLERANCE:
            unit = next((text for factor, text in _UNITS.items() if abs(value / factor - 1) < _SIZE_TOLERANCE), "")
            told = f", as {unit}" if unit else f" (RMS {value * size:.4g}, designed {size:.4g})"
            problems.append(f"{name} {value:.4g} times{told}")
        elif abs(value - 1) > 0.1 * _SIZE_TOLERANCE:
            notes.append(f"The logged reference of {name} has {value:.4g} times the designed size.")
    return problems, notes
