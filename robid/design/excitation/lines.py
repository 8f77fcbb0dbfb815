"""Choice of excited and detection lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import IntArray
from robid.design.excitation.arbitrary import ArbitraryOptions
from robid.design.excitation.options import ChosenLineOptions, ExcitationOptions
from robid.errors import SettingsError

_WHOLE = 1e-6  # Relative distance from a whole number of samples that is passed over
_SLIP = 0.01  # Relative error of a sampling period that is taken to be a slip
_DIGITS = 3
_COUNTABLE = 100_000  # Lines up to which a period that holds them is counted out


def samples_per_period(period_s: float, sampling_period_s: float) -> int:
    """Returns the whole number of samples in one period.

    Raises:
        SettingsError: If the period is not a whole number of samples.
    """
    ratio = period_s / sampling_period_s
    count = round(ratio)
    if count < 1 or abs(ratio - count) > _WHOLE * ratio:
        raise SettingsError(
            f"A period of {period_s:g} s is {ratio:.6g} samples of {sampling_period_s:g} s, not a whole number.",
            where="excitation.period_s",
            remedy=f"{_rounder(period_s, sampling_period_s)} a period of {max(count, 1) * sampling_period_s:.9g} s.",
        )
    return count


def _rounder(period_s: float, sampling_period_s: float) -> str:
    """Begins a remedy with the sampling period of few digits that was meant where the period is a multiple of it."""
    for digits in range(_DIGITS):
        meant = float(f"{sampling_period_s:.{digits}e}")
        ratio = period_s / meant
        whole = round(ratio) > 0 and abs(ratio - round(ratio)) < _WHOLE * ratio
        if whole and abs(meant / sampling_period_s - 1) < _SLIP:
            return f"Use a sampling period of {meant:g} s, or"
    return "Use"


def period_samples(options: ExcitationOptions, sampling_period_s: float) -> int:
    """Returns the samples of one period, or of the segments of a signal that has none.

    Raises:
        SettingsError: If the period is not a whole number of samples.
    """
    if isinstance(options, ArbitraryOptions):
        return options.segment_samples(sampling_period_s)
    return samples_per_period(options.period_s, sampling_period_s)


def choose_lines(options: ChosenLineOptions, sampling_period_s: float) -> tuple[IntArray, IntArray]:
    """Chooses the excited lines and, interleaved with them, the detection lines.

    Logarithmic spacing takes consecutive lines of the grid where it would be finer than the grid, so that the
    numbers of lines come out exactly. One detection line is drawn in each of equal runs of the chosen lines; the
    lowest and the highest chosen line stay excited.

    Args:
        options: Period, band, count, spacing, grid, detection share and seed.
        sampling_period_s: Sampling period of the controller or of the log [s].

    Returns:
        Excited lines (count,) and detection lines (n_detection,), both rising.

    Raises:
        SettingsError: If the period is no whole number of samples, the band is empty or reaches the Nyquist
            frequency, or has fewer lines than are asked for.
    """
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    if options.lines is not None:
        return _stated_lines(options, n_sample), np.zeros(0, int)
    n_detection = _detection_count(options)
    total = options.count + n_detection
    grid = _grid(options)
    available = len(grid)
    problems = _band_problems(options, grid, n_sample)
    if options.low_hz < options.high_hz and available < total:
        odd = "odd " if options.grid == "odd" else ""
        problems.append(
            f"{options.count} excited and {n_detection} detection lines do not fit: the band {options.low_hz:g} to "
            f"{options.high_hz:g} Hz holds {available} {odd}lines of a {options.period_s:g} s"
            f" period (lower count, or lengthen the period to {_long_enough(options, n_sample, total):.9g} s)"
        )
    _refuse(problems)
    chosen = _spread(grid, total, options.spacing)
    generator = np.random.default_rng([options.seed, 1])
    inner = np.arange(1, total - 1) if total >= n_detection + 2 else np.arange(total)
    drawn = [int(generator.choice(run)) for run in np.array_split(inner, n_detection)] if n_detection else []
    excited = np.delete(chosen, drawn)
    return excited, chosen[drawn]


def _long_enough(options: ChosenLineOptions, n_sample: int, total: int) -> float:
    """A period of whole samples whose band holds so many lines [s]."""
    step = options.period_s / n_sample
    available = max(len(_grid(options)), 1)
    longer = replace(options, period_s=step * int(np.ceil(n_sample * total / available)))
    # Where the lines lie in the band decides whether the last one is within it.
    while total < _COUNTABLE and len(_grid(longer)) < total:
        longer = replace(longer, period_s=longer.period_s + step * max(n_sample // available, 1))
    return longer.period_s


def _refuse(problems: list[str]) -> None:
    if problems:
        raise SettingsError(
            "The lines cannot be chosen: " + "; ".join(problems) + ".",
            where="excitation",
            remedy="Change the fields named in parentheses.",
        )


def _grid(options: ChosenLineOptions) -> IntArray:
    """Lines of the band that may be excited."""
    lowest = max(int(np.ceil(options.low_hz * options.period_s - 1e-9)), 1)
    highest = int(np.floor(options.high_hz * options.period_s + 1e-9))
    if options.grid == "odd":
        lowest, highest = lowest + 1 - lowest % 2, highest - 1 + highest % 2
    grid = np.arange(lowest, highest + 1, 2 if options.grid == "odd" else 1)
    return grid[grid % options.slow_motion_line != 0] if options.slow_motion_rad_s > 0 else grid


def _band_problems(options: ChosenLineOptions, grid: IntArray, n_sample: int) -> list[str]:
    problems = []
    if 2 * grid.max(initial=0) >= n_sample:
        nyquist_hz = n_sample / (2 * options.period_s)
        problems.append(
            f"high_hz {options.high_hz:g} is not below the Nyquist frequency {nyquist_hz:g} Hz (lower high_hz)"
        )
    if options.low_hz >= options.high_hz:
        problems.append(f"low_hz {options.low_hz:g} is not below high_hz {options.high_hz:g} (swap them)")
    return problems


def _stated_lines(options: ChosenLineOptions, n_sample: int) -> IntArray:
    """The lines whose numbers are stated, or all of the band."""
    if not isinstance(options.lines, tuple):
        grid = _grid(options)
        problems = _band_problems(options, grid, n_sample)
        if not (problems or len(grid)):
            problems.append(f"no line of a {options.period_s:g} s period lies in the band (widen low_hz to high_hz)")
        _refuse(problems)
        return grid
    stated = np.array(options.lines, dtype=int)
    problems, highest = [], (n_sample - 1) // 2
    if not len(stated) or stated.min() < 1 or stated.max() > highest:
        problems.append(f"they must be within 1 to {highest}, below Nyquist (lines, period_s)")
    if np.any(np.diff(stated) <= 0):
        problems.append("they must rise (lines)")
    _refuse(problems)
    return stated


def _detection_count(options: ChosenLineOptions) -> int:
    """Number of detection lines: their share of all chosen lines, at least one unless the share is zero."""
    share = options.detection_share
    return 0 if share == 0 else max(1, round(options.count * share / (1 - share)))


def _spread(grid: IntArray, count: int, spacing: str) -> IntArray:
    """Spreads `count` distinct lines over a rising grid."""
    lowest, highest = int(grid[0]), int(grid[-1])
    if count == 1:
        middle = np.sqrt(lowest * highest) if spacing == "log" else (lowest + highest) / 2
        return grid[[np.argmin(np.abs(grid - middle))]]
    chosen = [0]
    for left in range(count - 1, 0, -1):
        last = int(grid[chosen[-1]])
        target = last * (highest / last) ** (1 / left) if spacing == "log" else last + (highest - last) / left
        nearest = round(float(np.interp(target, grid, np.arange(len(grid)))))
        chosen.append(min(max(nearest, chosen[-1] + 1), len(grid) - left))
    return grid[chosen]
