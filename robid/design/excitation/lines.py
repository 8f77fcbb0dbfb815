"""The lines that carry a signal: excited and detection lines, and what keeps a signal from being made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.design.excitation.options import (
    ArbitraryOptions,
    ChirpOptions,
    ChosenLineOptions,
    ExcitationOptions,
    FourierOptions,
    PerturbationOptions,
    PoseChirpOptions,
    SteppedSineOptions,
    SweepOptions,
    TrajectoryOptions,
    Travel,
)
from robid.errors import SettingsError
from robid.signals.waveforms import chirp, stepped_sine

MOST_SAMPLES = 5_000_000
"""Samples of a period, an hour at 1 kHz: a signal of so many, with its spectrum, is computed in a second."""
_WHOLE = 1e-6  # Relative distance from a whole number of samples that is passed over
_SLIP = 0.01  # Relative error of a sampling period that is taken to be a slip
_DIGITS = 3
_REMEDY = "Change the fields named in parentheses."
_COUNTABLE = 100_000  # Lines up to which a period that holds them is counted out


def samples_per_period(period_s: float, sampling_period_s: float) -> int:
    """Returns the whole number of samples in one period.

    Raises:
        SettingsError: If the period is not a whole number of samples.
    """
    ratio = period_s / sampling_period_s
    _refuse_many(ratio, "excitation.period_s", "shorten it, or lengthen the sampling period")
    count = round(ratio)
    if count < 1 or abs(ratio - count) > _WHOLE * ratio:
        samples = f"{ratio:.6g} samples of {sampling_period_s:g} s, not a whole number."
        remedy = f"{_rounder(period_s, sampling_period_s)} a period of {max(count, 1) * sampling_period_s:.9g} s."
        raise SettingsError(f"S026 A period of {period_s:g} s is {samples}", where="excitation.period_s", remedy=remedy)
    return count


def _refuse_many(samples: float, where: str, remedy: str) -> None:
    """Refuses a period before anything is laid out over its samples or lines."""
    if samples > MOST_SAMPLES:
        what = f"S595 A period has {samples:.3g} samples; more than {MOST_SAMPLES:.3g} are not computed with."
        raise SettingsError(what, where=where, remedy=f"{remedy}.")


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
        ratio = options.period_s / sampling_period_s
        _refuse_many(ratio, "excitation.resolution_hz", "raise it, or lengthen the sampling period")
        return options.segment_samples(sampling_period_s)
    return samples_per_period(options.period_s, sampling_period_s)


def choose_lines(options: ChosenLineOptions, sampling_period_s: float) -> tuple[IntArray, IntArray]:
    """Chooses excited lines (count,) and, interleaved with them, detection lines (n_detection,), both rising.

    Logarithmic spacing takes consecutive lines of the grid where it would be finer than the grid, so that the
    numbers of lines come out exactly. One detection line is drawn in each of equal runs of the chosen lines; the
    lowest and the highest chosen line stay excited.

    Raises:
        SettingsError: If the period is no whole number of samples, the band is empty or reaches the Nyquist
            frequency, or has fewer lines than are asked for.
    """
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    if options.lines is not None:
        return _stated_lines(options, n_sample), np.zeros(0, int)
    # Their share of all chosen lines, at least one unless the share is zero.
    share = options.detection_share
    n_detection = 0 if share == 0 else max(1, round(options.count * share / (1 - share)))
    total, grid = options.count + n_detection, _grid(options)
    available = len(grid)
    problems = _band_problems(options, grid, n_sample)
    if options.low_hz < options.high_hz and available < total:
        odd = "odd " if options.grid == "odd" else ""
        problems.append(
            f"{options.count} excited and {n_detection} detection lines do not fit: the band {options.low_hz:g} to "
            f"{options.high_hz:g} Hz contains {available} {odd}lines of a {options.period_s:g} s"
            f" period (lower count, or lengthen the period to {_long_enough(options, n_sample, total):.9g} s)"
        )
    _refuse(problems)
    chosen, generator = _spread(grid, total, options.spacing), np.random.default_rng([options.seed, 1])
    # Detection lines are drawn from equal runs, ends apart, so that they cover the band.
    inner = np.arange(1, total - 1) if total >= n_detection + 2 else np.arange(total)
    drawn = [int(generator.choice(run)) for run in np.array_split(inner, n_detection)] if n_detection else []
    return np.delete(chosen, drawn), chosen[drawn]


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
        message = f"S027 The lines cannot be chosen: {'; '.join(problems)}."
        raise SettingsError(message, where="excitation", remedy=_REMEDY)


def _grid(options: ChosenLineOptions) -> IntArray:
    # No period has lines beyond, however high the band; that it is too high is told elsewhere.
    lowest = max(int(np.ceil(min(options.low_hz * options.period_s, MOST_SAMPLES) - 1e-9)), 1)
    highest = int(np.floor(min(options.high_hz * options.period_s, MOST_SAMPLES) + 1e-9))
    if options.grid == "odd":
        lowest, highest = lowest + 1 - lowest % 2, highest - 1 + highest % 2
    grid = np.arange(lowest, highest + 1, 2 if options.grid == "odd" else 1)
    return grid[grid % options.slow_motion_line != 0] if options.slow_motion_rad_s > 0 else grid


def _band_problems(options: ChosenLineOptions, grid: IntArray, n_sample: int) -> list[str]:
    problems = []
    if 2 * grid.max(initial=0) >= n_sample:
        problems.append(_beyond(options.high_hz, n_sample / (2 * options.period_s)))
    if options.low_hz >= options.high_hz:
        problems.append(f"low_hz {options.low_hz:g} is not below high_hz {options.high_hz:g} (swap them)")
    return problems


def _beyond(high_hz: float, nyquist_hz: float) -> str:
    return f"high_hz {high_hz:g} is not below the Nyquist frequency {nyquist_hz:g} Hz (lower high_hz)"


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


def _spread(grid: IntArray, count: int, spacing: str) -> IntArray:
    """Spreads `count` distinct lines over a rising grid."""
    lowest, highest = int(grid[0]), int(grid[-1])
    lines, places = grid.astype(float), np.arange(len(grid), dtype=float)
    if count == 1:
        middle = np.sqrt(lowest * highest) if spacing == "log" else (lowest + highest) / 2
        return grid[[np.argmin(np.abs(grid - middle))]]
    chosen = [0]
    for left in range(count - 1, 0, -1):
        last = int(grid[chosen[-1]])
        # The geometric way to the highest line, divided by the lines that are left; never the same line twice.
        target = last * (highest / last) ** (1 / left) if spacing == "log" else last + (highest - last) / left
        nearest = round(float(np.interp(target, lines, places)))
        chosen.append(min(max(nearest, chosen[-1] + 1), len(grid) - left))
    return grid[chosen]


LINE_SHARE = 0.03  # Amplitude of a line, relative to the strongest one of the band, from which it counts as excited
_SAMPLES_PER_WAVE = 20  # Samples that the fastest harmonic of a trajectory must have
RESTING_ORDERS = {"speed_reference": (-1, 0, 1), "position_reference": (0, 1, 2), "torque": (0, 1)}
"""Derivatives of a signal that begin and end at rest, by where it is injected."""


def signal_lines(options: ExcitationOptions, sampling_period_s: float) -> tuple[IntArray, IntArray]:
    """Returns the excited and the detection lines of a signal; only multisines and Fourier series have the latter.

    Raises:
        SettingsError: If the signal cannot be made as asked.
    """
    if isinstance(options, ChosenLineOptions):
        return choose_lines(options, sampling_period_s)
    if isinstance(options, ArbitraryOptions):
        return options.lines(sampling_period_s), np.zeros(0, int)
    if isinstance(options, TrajectoryOptions):
        return np.arange(1, options.harmonics + 1), np.zeros(0, int)
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    if isinstance(options, PoseChirpOptions):
        everywhere = np.ones(n_sample // 2 + 1, bool)
        return np.flatnonzero(_carrying(options, pose_chirp(options, sampling_period_s), everywhere)), np.zeros(0, int)
    # Free of the slow motion and its multiples.
    free = (options.slow_motion_rad_s == 0) | (np.arange(n_sample // 2 + 1) % options.slow_motion_line != 0)
    carrying = _carrying(options, sweep(options, sampling_period_s), np.asarray(free))
    if options.grid == "odd":
        carrying[::2] = False
    return np.flatnonzero(carrying), np.zeros(0, int)


def _carrying(options: SweepOptions | PoseChirpOptions, signal: FloatArray, allowed: BoolArray) -> BoolArray:
    """Which lines (n_lines,) of the band, of those allowed, a sweep really carries."""
    magnitude = np.abs(np.fft.rfft(signal))
    frequency = np.arange(len(magnitude)) / options.period_s
    band = (frequency >= options.low_hz - 1e-9) & (frequency <= options.high_hz + 1e-9) & allowed
    return np.asarray(band & (magnitude >= LINE_SHARE * magnitude[band].max(initial=0.0)) & (magnitude > 0))


def check_signal(options: ExcitationOptions, sampling_period_s: float) -> None:
    """Refuses what cannot be made before anything is designed.

    Raises:
        SettingsError: With every problem of the signal, or of its lines.
    """
    n_sample = period_samples(options, sampling_period_s)
    if isinstance(options, ArbitraryOptions):
        problems = options.problems(sampling_period_s)
    elif isinstance(options, TrajectoryOptions):
        short = _SAMPLES_PER_WAVE * options.harmonics > n_sample
        few = f"{options.harmonics} harmonics leave fewer than {_SAMPLES_PER_WAVE} of {n_sample} samples to the fastest"
        problems = [f"{few} (lower harmonics or lengthen period_s)"] if short else []
    elif isinstance(options, PoseChirpOptions):
        problems = _sweep_band_problems(options, sampling_period_s)
    else:
        problems = _perturbation_problems(options, n_sample, sampling_period_s)
    if problems:
        message = f"S031 The {options.signal} cannot be made: {'; '.join(problems)}."
        raise SettingsError(message, where="excitation", remedy=_REMEDY)
    signal_lines(options, sampling_period_s)


def _perturbation_problems(options: PerturbationOptions, n_sample: int, sampling_period_s: float) -> list[str]:
    problems = []
    if isinstance(options, SweepOptions):
        problems += _sweep_problems(options, n_sample, sampling_period_s)
    if options.slow_motion_rad_s > 0:
        problems += _slow_problems(options)
    if options.travel is not None:
        problems += _travel_problems(options.travel, options, n_sample)
    resting = RESTING_ORDERS[options.inject]
    count = len(options.lines) if isinstance(options, FourierOptions) and isinstance(options.lines, tuple) else None
    if isinstance(options, FourierOptions) and options.at_rest and (count or options.count) <= len(resting):
        needed = len(resting) + 1
        problems.append(f"{count or options.count} lines cannot begin and end at rest (use at least {needed} lines)")
    return problems


def _sweep_band_problems(options: SweepOptions | PoseChirpOptions, sampling_period_s: float) -> list[str]:
    problems = []
    if options.low_hz >= options.high_hz:
        problems.append(f"low_hz {options.low_hz:g} is not below high_hz {options.high_hz:g} (swap them)")
    if 2 * options.high_hz * sampling_period_s >= 1:
        problems.append(_beyond(options.high_hz, 0.5 / sampling_period_s))
    return problems


def _sweep_problems(options: SweepOptions, n_sample: int, sampling_period_s: float) -> list[str]:
    problems = _sweep_band_problems(options, sampling_period_s)
    if options.grid == "odd" and n_sample % 2:
        problems.append(f"a period of {n_sample} samples has no half, which odd lines need (change period_s or grid)")
    if isinstance(options, SteppedSineOptions) and not problems:
        seconds = float(np.sum(1 / _steps_hz(options))) * (2 if options.grid == "odd" else 1)
        if seconds > options.period_s:
            remedy = "(lengthen period_s to more, lower count, or raise low_hz)"
            problems.append(f"one cycle of each of {options.count} frequencies takes {seconds:.3g} s {remedy}")
    return problems


def _slow_problems(options: PerturbationOptions) -> list[str]:
    line, problems = options.slow_motion_line, []
    if options.inject == "torque":
        problems.append("a slow motion needs a reference of speed or position (inject)")
    if line % 2:
        problems.append(f"the slow motion's line {line} is odd, as excited lines are (make slow_motion_line even)")
    if line >= options.low_hz * options.period_s:
        problems.append(
            f"the slow motion's {line / options.period_s:g} Hz is not below low_hz {options.low_hz:g}"
            " (lower slow_motion_line)"
        )
    return problems


def _travel_problems(travel: Travel, options: PerturbationOptions, n_sample: int) -> list[str]:
    problems = []
    if (travel.amplitude_m is None) == (travel.amplitude_deg is None):
        problems.append("a travel needs one amplitude (travel.amplitude_m, or travel.amplitude_deg)")
    if _SAMPLES_PER_WAVE * travel.line > n_sample:
        problems.append(f"the travel's line {travel.line} leaves too few samples to a turn (lower travel.line)")
    if options.limit_share is not None:
        problems.append("the share of a limit that a travel leaves is not known (state rms instead of limit_share)")
    return problems


def _steps_hz(options: SteppedSineOptions) -> FloatArray:
    spread = np.geomspace if options.spacing == "log" else np.linspace
    return np.asarray(spread(options.low_hz, options.high_hz, options.count))


def pose_chirp(options: PoseChirpOptions, sampling_period_s: float) -> FloatArray:
    """One period of a chirp of amplitude one that begins and ends at zero."""
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    low, high = options.low_hz * sampling_period_s, options.high_hz * sampling_period_s
    return chirp(low, high, n_sample, peak=options.chirp_peak)


def sweep(options: SweepOptions, sampling_period_s: float) -> FloatArray:
    """One period of a chirp or stepped sine; the odd grid repeats its first half with the opposite sign."""
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    # A half period that repeats with the opposite sign has odd lines only.
    is_odd = options.grid == "odd"
    length = n_sample // 2 if is_odd else n_sample
    if isinstance(options, ChirpOptions):
        low, high = options.low_hz * sampling_period_s, options.high_hz * sampling_period_s
        signal = chirp(low, high, length, peak=options.chirp_peak)
    else:
        signal = stepped_sine(_steps_hz(options) * sampling_period_s, length)
    return np.concatenate([signal, -signal]) if is_odd else signal - signal.mean()
