"""The lines that carry a signal, and what keeps it from being made."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.design.excitation.arbitrary import ArbitraryOptions
from robid.design.excitation.lines import choose_lines, period_samples, samples_per_period
from robid.design.excitation.options import (
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
    carrying = _carrying(options, sweep(options, sampling_period_s), _not_slow(options, n_sample))
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
        problems = _trajectory_problems(options, n_sample)
    elif isinstance(options, PoseChirpOptions):
        problems = _band_problems(options, sampling_period_s)
    else:
        problems = _perturbation_problems(options, n_sample, sampling_period_s)
    if problems:
        raise SettingsError(
            f"The {options.signal} cannot be made: {'; '.join(problems)}.",
            where="excitation",
            remedy="Change the fields named in parentheses.",
        )
    signal_lines(options, sampling_period_s)


def _trajectory_problems(options: TrajectoryOptions, n_sample: int) -> list[str]:
    if _SAMPLES_PER_WAVE * options.harmonics <= n_sample:
        return []
    return [
        f"{options.harmonics} harmonics leave fewer than {_SAMPLES_PER_WAVE} of {n_sample} samples to the fastest"
        " (lower harmonics or lengthen period_s)"
    ]


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


def _band_problems(options: SweepOptions | PoseChirpOptions, sampling_period_s: float) -> list[str]:
    problems = []
    if options.low_hz >= options.high_hz:
        problems.append(f"low_hz {options.low_hz:g} is not below high_hz {options.high_hz:g} (swap them)")
    if 2 * options.high_hz * sampling_period_s >= 1:
        nyquist = 0.5 / sampling_period_s
        problems.append(
            f"high_hz {options.high_hz:g} is not below the Nyquist frequency {nyquist:g} Hz (lower high_hz)"
        )
    return problems


def _sweep_problems(options: SweepOptions, n_sample: int, sampling_period_s: float) -> list[str]:
    problems = _band_problems(options, sampling_period_s)
    if options.grid == "odd" and n_sample % 2:
        problems.append(f"a period of {n_sample} samples has no half, which odd lines need (change period_s or grid)")
    if isinstance(options, SteppedSineOptions) and not problems:
        seconds = float(np.sum(1 / _steps_hz(options))) * (2 if options.grid == "odd" else 1)
        if seconds > options.period_s:
            problems.append(
                f"one cycle of each of {options.count} frequencies takes {seconds:.3g} s"
                f" (lengthen period_s to more, lower count, or raise low_hz)"
            )
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


def _not_slow(options: PerturbationOptions, n_sample: int) -> BoolArray:
    """Whether each line (n_lines,) is free of the slow motion and its multiples."""
    lines = np.arange(n_sample // 2 + 1)
    return np.asarray((options.slow_motion_rad_s == 0) | (lines % options.slow_motion_line != 0))


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
    is_odd = options.grid == "odd"
    length = n_sample // 2 if is_odd else n_sample
    if isinstance(options, ChirpOptions):
        low, high = options.low_hz * sampling_period_s, options.high_hz * sampling_period_s
        signal = chirp(low, high, length, peak=options.chirp_peak)
    else:
        signal = stepped_sine(_steps_hz(options) * sampling_period_s, length)
    return np.concatenate([signal, -signal]) if is_odd else signal - signal.mean()
