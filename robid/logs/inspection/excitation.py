"""How the signals of a log repeat, the lines that carry energy, and the mapping to propose for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import rfft
from scipy.signal import decimate, detrend

from robid.arrays import FloatArray, IntArray
from robid.logs.inspection.channels import Entry
from robid.logs.period import Repetition, band_of, find_lines, format_lines, line_power, measure_repetition

# Samples up to which a period is measured on all of them; of longer signals on every second, fourth,
_LOOKED = 1 << 17
_SAME = 0.01  # relative distance of periods that are one
_ENERGY = 0.95
_ALL = 0.9999  # share of the energy of the inputs up to the highest line
# Distance from a whole number of periods within which a log holds that number: a period is measured with noise
_WHOLE = 1e-3
_PLACES = 1000  # places in a period with which a part of a signal is compared
_ALIKE = 0.95  # correlation with one of them from which the part is there
_LOST = 0.25  # share of the parts that may be nowhere: those that lost samples, or were a transient
# Distance of a first period from the mean of the last, in those that they have, from which it is a transient
_UNSETTLED = 3.0
_EXACT = 1e-3  # the same distance, relative to the signal, below which it does not matter


@dataclass(frozen=True)
class Shared:
    """The period that signals share."""

    samples: float  # Its length, a fraction included
    std_samples: float  # Standard deviation of it
    held: float  # Periods that the log holds, a fraction included
    names: tuple[str, ...]  # Signals that repeat with it
    transient: tuple[str, ...] = ()  # Signals whose first periods differ from the others
    settling: int = 0  # How many they are

    @property
    def whole(self) -> int:
        """Its length in whole samples."""
        return round(self.samples)


def measure_period(values: FloatArray) -> Repetition:
    """Measures the shortest period of a signal (n_sample,) of which nothing is known."""
    factor = 1
    while len(values) > _LOOKED * factor:
        factor *= 2
    short = values if factor == 1 else np.asarray(decimate(values, factor, ftype="fir"))
    found = _repetition_within(short)
    if found.samples is None:
        found = _repetition_in_parts(short)
    if found.samples is None or factor == 1:
        return found
    return Repetition(found.samples * factor, max(found.std_samples, 0.01) * factor, found.reachable)


def _repetition_within(values: FloatArray) -> Repetition:
    half = len(values) // 2
    return measure_repetition(values, half, np.array([1, max(half // 2 - 1, 2)]))


def _repetition_in_parts(values: FloatArray) -> Repetition:
    """Period of a signal that repeats before and after samples that it lost: the two do not fit each other."""
    half = len(values) // 2
    for part in (values[half:], values[:half]):
        found = _repetition_within(part)
        if found.samples is not None and _is_everywhere(values, part[: round(found.samples)]):
            return found
    return Repetition(None, 0.0, reachable=True)


def _is_everywhere(values: FloatArray, period: FloatArray) -> bool:
    """Whether quarters of a period, all over a signal (n_sample,), look like some place of it but for a few."""
    length = max(len(period) // 4, 2)
    blocks = values[: len(values) // length * length].reshape(-1, length)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    around = np.concatenate([period, period[: length - 1]])
    places = sliding_window_view(around, length)[:: max(len(period) // _PLACES, 1)]
    places = places - places.mean(axis=1, keepdims=True)
    norms = np.linalg.norm(places, axis=1) * np.linalg.norm(blocks, axis=1)[:, None]
    alike = (blocks @ places.T / np.maximum(norms, np.finfo(float).tiny)).max(axis=1)
    return bool(np.mean(alike > _ALIKE) >= 1 - _LOST)


def share_period(periods: Mapping[str, Repetition], leading: Sequence[str], n_sample: int) -> Shared | None:
    """Returns the period that most of the leading signals share, which say what was played, the best first; or none."""
    known = [periods[name] for name in leading if periods[name].samples is not None]
    if not known:
        return None

    def shares(one: Repetition, length: float) -> bool:
        """Whether whole periods of a signal make up a length."""
        samples = float(one.samples or 0)
        return abs(samples * max(round(length / samples), 1) / length - 1) < _SAME

    # Signals that repeat by chance, each with a length of its own, have no period in common.
    first = max(known, key=lambda one: sum(shares(other, float(one.samples or 0)) for other in known))
    length = float(first.samples or 0)
    if 2 * sum(shares(one, length) for one in known) <= len(known):
        return None
    alike = tuple(name for name, one in periods.items() if one.samples is not None and shares(one, length))
    held, count = n_sample / length, round(n_sample / length)
    whole = abs(held - count) < _WHOLE and count * round(length) <= n_sample
    return Shared(length, first.std_samples, count if whole else held, alike)


def cut_periods(values: FloatArray, samples: int, *, last: bool) -> FloatArray:
    """Returns the whole periods (n_period, n_sample) of a signal, counted from its end or its beginning."""
    count = len(values) // samples
    used = values[len(values) - count * samples :] if last else values[: count * samples]
    return used.reshape(count, samples)


def unsettled(blocks: FloatArray) -> int:
    """Returns how many of the first periods (n_period, n_sample) differ from the last ones more than those do."""
    if len(blocks) < 4:
        return 0
    level = blocks - blocks.mean(axis=1, keepdims=True)
    late = level[len(level) // 2 :]
    apart = np.sqrt(np.mean((level - late.mean(axis=0)) ** 2, axis=1))
    usual = max(float(np.median(apart[len(level) // 2 :])), _EXACT * float(np.sqrt(np.mean(late**2))))
    settled = np.flatnonzero(apart <= _UNSETTLED * usual)
    return min(int(settled[0]), len(blocks) // 2)


def carrying_lines(signals: list[FloatArray]) -> IntArray:
    """Returns the lines at which periods (n_period, n_sample) of some signals are excited, up to nearly all energy."""
    power = np.sum([line_power(one)[0] / max(float(one.var()), np.finfo(float).tiny) for one in signals], axis=0)
    power[0] = 0
    last = int(np.searchsorted(np.cumsum(power), _ALL * power.sum()))
    return find_lines(signals, np.arange(1, min(last, (signals[0].shape[1] - 1) // 2) + 1))


def shorten(shared: Shared, lines: IntArray) -> tuple[Shared, IntArray]:
    """Returns the shortest period whose lines these are, and its own lines: a measured one may hold several."""
    count = int(np.gcd.reduce(lines))
    if count == 1 or shared.whole % count:
        return shared, lines
    samples, std_samples = shared.samples / count, shared.std_samples / count
    return replace(shared, samples=samples, std_samples=std_samples, held=shared.held * count), lines // count


def energy_band(values: FloatArray, step_s: float, part: float = _ENERGY) -> tuple[float, float]:
    """Returns the frequencies between which a part of a signal's energy lies, nearly all unless told [Hz]."""
    power = np.abs(rfft(np.asarray(detrend(values)))) ** 2
    share = np.cumsum(power) / max(float(power.sum()), np.finfo(float).tiny)
    low, high = np.searchsorted(share, [(1 - part) / 2, (1 + part) / 2])
    return float(max(low, 1) / (len(values) * step_s)), float(high / (len(values) * step_s))


def moves_far(motions: Sequence[FloatArray], torques: Sequence[FloatArray], step_s: float) -> bool:
    """Returns whether joints move far and slowly, torques along with them: that tells a rigid model, not a response.

    Args:
        motions: Angles or positions (n_sample,) of some joints or motors [rad, or m].
        torques: What drives them (n_sample,).
        step_s: Sampling period [s].
    """
    if not motions or max(float(np.ptp(one)) for one in motions) < _FAR:
        return False
    speeds = [np.gradient(one, step_s) for one in motions]
    sizes = [float(one.std()) for one in speeds]
    slow = np.average([_below(one, step_s) for one in speeds], weights=np.square(sizes))
    return bool(slow > _SLOW and np.median([_below(one, step_s) for one in torques]) > _FOLLOWING)


def _below(values: FloatArray, step_s: float) -> float:
    """Share of a signal's power below the frequencies at which springs show."""
    power = np.abs(rfft(np.asarray(detrend(values)))) ** 2
    low = np.fft.rfftfreq(len(values), step_s) < _SLOW_HZ
    return float(power[low].sum() / max(float(power.sum()), np.finfo(float).tiny))


_FAR = 0.3  # rad, or m, over which a joint moves in a motion for a rigid model, and its motor more
_SLOW_HZ, _SLOW, _FOLLOWING = 5.0, 0.98, 0.9  # share of the speeds' and of a usual torque's power below that frequency
_LISTED = 40  # lines that are listed one by one
_DENSE = 0.9  # share of a band's lines from which all of them are meant
_ARBITRARY = 0.02  # share of the band up to Nyquist from which a signal that does not repeat is more than a trajectory
_SEGMENTS = 20  # segments into which a signal that does not repeat is cut
# Share of the frequency that halves the energy of several inputs up to which a resolution tells something
_RESOLVED = 0.25
_FREQUENCIES = 400  # frequencies of its response at most

Settings: TypeAlias = dict[str, str | float | int | list[int]]


@dataclass(frozen=True)
class Excitation:
    """What was played, as settings, and what to check about it."""

    settings: Settings
    checks: tuple[str, ...] = ()

    @property
    def is_arbitrary(self) -> bool:
        """Whether only a band and a resolution are said."""
        return self.settings.get("signal") == "arbitrary"


@dataclass(frozen=True)
class Proposal:
    """A mapping that is proposed."""

    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    references: tuple[Entry, ...]
    excitation: Excitation | None  # What was played; None for one shot
    periods: int | None = None
    drop_periods: int = 0
    take_last: bool = False  # Whether periods are counted from the end
    resample: str = ""  # Clock to resample to; empty for none
    one_shot: bool = False  # Whether the log is a record without a response
    is_motion: bool = False  # Whether several joints move far and slowly, as for a rigid model
    part_s: tuple[float, float] | None = None  # From where to where it is used, None for all of it [s]


def propose_lines(shared: Shared, lines: IntArray, step_s: float) -> Excitation:
    """Proposes period, band and lines of a signal that repeats, by lines (n_line,) with energy and its step [s]."""
    period_s, dense = float(f"{shared.whole * step_s:.9g}"), _dense_part(lines)
    told = (f"lines with energy: {format_lines(lines)}; the period was measured to {shared.samples:.6g} samples",)
    low, high = int(dense[0]), int(dense[-1])
    if len(lines) == 1:
        around = _band(period_s, 0.5 * low, 1.5 * low)
        return Excitation({**around, "grid": "full", "lines": [low]}, told)
    grids = {"odd": np.arange(low, high + 1, 2) if low % 2 else dense[:0], "full": np.arange(low, high + 1)}
    for grid, meant in grids.items():
        if len(np.intersect1d(meant, lines)) >= _DENSE * max(len(meant), len(lines)):
            return Excitation({**_band(period_s, low, high), "lines": "all", "grid": grid}, told)
    settings: Settings = {**_band(period_s, int(lines[0]), int(lines[-1])), "grid": "full"}
    return Excitation({**settings, "lines": lines.tolist() if len(lines) <= _LISTED else "found"}, told)


def _band(period_s: float, low: float, high: float) -> Settings:
    """Period and band of some lines, its ends rounded outwards."""
    lowest, highest = band_of(low, high, period_s)
    return {"period_s": period_s, "low_hz": lowest, "high_hz": highest}


def _dense_part(lines: IntArray) -> IntArray:
    """The lines without single ones far off the others, as distortion has them."""
    kept = lines
    while len(kept) > _DENSE * len(lines):
        steps = np.diff(kept)
        if len(steps) < 2 or kept[-1] - kept[0] <= len(steps) / _DENSE * np.median(steps):
            return kept
        kept = kept[1:] if steps[0] > steps[-1] else kept[:-1]
    return lines


def propose_band(band: tuple[float, float], duration_s: float, n_input: int) -> Excitation:
    """Proposes band and resolution of inputs that do not repeat, by their band [Hz] and how long they last [s]."""
    resolution = _resolution(band, duration_s, n_input)
    low, high = max(float(f"{band[0]:.3g}"), resolution), float(f"{band[1]:.3g}")
    told: tuple[str, ...] = ("nothing repeats; band by where the inputs have their energy",)
    if n_input > 1:
        told += ("for a rigid model, which reads large motions, say `one_shot: true` below `acquire` in place of this",)
    return Excitation({"signal": "arbitrary", "low_hz": low, "high_hz": high, "resolution_hz": resolution}, told)


def is_broad(band: tuple[float, float], step_s: float, duration_s: float) -> bool:
    """Returns whether a signal's band [Hz] is wide enough for a frequency response."""
    return band[1] > _ARBITRARY * 0.5 / step_s and (band[1] - band[0]) * duration_s > 4 * _SEGMENTS


def is_resolved(band: tuple[float, float], middle_hz: float, duration_s: float, n_input: int) -> bool:
    """Returns whether the resolution that tells some inputs apart is finer than what half of their energy needs.

    That half lies below `middle_hz` [Hz] in the slowest one, all of it in `band` [Hz]; the log lasts `duration_s` [s].
    """
    return n_input == 1 or _resolution(band, duration_s, n_input) < _RESOLVED * middle_hz


def _resolution(band: tuple[float, float], duration_s: float, n_input: int) -> float:
    return float(f"{max(_SEGMENTS * n_input / duration_s, (band[1] - band[0]) / _FREQUENCIES):.2g}")
