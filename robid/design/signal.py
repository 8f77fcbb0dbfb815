"""Excitations of every kind: which signal, what is added to it, and the lines that carry it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.design.excitation import Excitation, design_excitation, rms_per_motor
from robid.design.lines import choose_lines, samples_per_period
from robid.design.loop import NominalLoop
from robid.design.options import ExcitationOptions
from robid.errors import SettingsError
from robid.signals.chirp import chirp
from robid.signals.fourier import resting_series
from robid.signals.multisine import crest_factor, orthogonal_matrix, time_signal
from robid.signals.slow_motion import slow_motion
from robid.signals.stepped_sine import stepped_sine

LINE_SHARE = 0.03
"""Amplitude of a line, relative to the strongest one of the band, from which it counts as excited."""

_ORDERS = {"speed_reference": (-1, 0, 1), "position_reference": (0, 1, 2), "torque": (0, 1)}


def design_signal(
    options: ExcitationOptions,
    n_motor: int,
    realizations: int,
    sampling_period_s: float,
    loop: NominalLoop | None = None,
) -> Excitation:
    """Designs the excitation that the options ask for, with the slow motion that they add.

    Every kind is one period, played by all motors at once: motor i of experiment l has all its phases turned by
    entry (i, l) of `robid.signals.multisine.orthogonal_matrix`, so that the block is orthogonal at every line.

    Args:
        options: Kind, period, band, RMS, seed and slow motion.
        n_motor: Number of motors, and of experiments in a realization.
        realizations: Number of realizations; each has new phases, of a chirp or stepped sine one for each motor.
        sampling_period_s: Sampling period of the controller [s].
        loop: The nominal loop at the excited lines, for a multisine that is shaped by it.

    Raises:
        SettingsError: If the signal cannot be made as asked.
    """
    check_signal(options, sampling_period_s)
    if options.signal == "multisine":
        excitation = design_excitation(options, n_motor, realizations, sampling_period_s, loop)
    else:
        excitation = _design_other(options, n_motor, realizations, sampling_period_s)
    if options.slow_motion_rad_s == 0:
        return excitation
    amplitude = options.slow_motion_rad_s
    if options.inject == "position_reference":
        amplitude *= options.period_s / (2 * np.pi * options.slow_motion_line)
    added = slow_motion(
        amplitude,
        options.slow_motion_line,
        realizations,
        n_motor,
        excitation.reference.shape[2],
        np.random.default_rng([options.seed, 3]),
    )
    return replace(excitation, reference=excitation.reference + added)


def signal_lines(options: ExcitationOptions, sampling_period_s: float) -> tuple[IntArray, IntArray]:
    """Returns the excited and the detection lines of a signal; a chirp and a stepped sine have no detection lines.

    Raises:
        SettingsError: If the signal cannot be made as asked.
    """
    if options.signal in ("multisine", "fourier"):
        return choose_lines(options, sampling_period_s)
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    magnitude = np.abs(np.fft.rfft(_sweep(options, sampling_period_s)))
    frequency = np.arange(n_sample // 2 + 1) / options.period_s
    band = (frequency >= options.low_hz - 1e-9) & (frequency <= options.high_hz + 1e-9) & _not_slow(options, n_sample)
    carrying = band & (magnitude >= LINE_SHARE * magnitude[band].max(initial=0.0)) & (magnitude > 0)
    if options.grid == "odd":
        carrying[::2] = False
    return np.flatnonzero(carrying), np.zeros(0, int)


def check_signal(options: ExcitationOptions, sampling_period_s: float) -> None:
    """Refuses what cannot be made before anything is designed.

    Raises:
        SettingsError: With every problem of the signal, or of its lines.
    """
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    problems = []
    if options.signal in ("chirp", "stepped_sine"):
        problems += _sweep_problems(options, n_sample, sampling_period_s)
    if options.signal != "multisine" and (options.amplitude, options.crest_at) != ("flat", "reference"):
        problems.append("only a multisine is shaped by the robot (leave out amplitude and crest_at)")
    if options.signal != "multisine" and options.random_block_phases:
        problems.append("only a multisine keeps its shape under random phases (leave out random_block_phases)")
    if options.slow_motion_rad_s > 0:
        problems += _slow_problems(options)
    if options.signal == "fourier" and options.at_rest and options.count <= len(_ORDERS[options.inject]):
        needed = len(_ORDERS[options.inject]) + 1
        problems.append(f"{options.count} lines cannot begin and end at rest (use at least {needed} lines)")
    if problems:
        raise SettingsError(
            f"The {options.signal} cannot be made: {'; '.join(problems)}.",
            where="excitation",
            remedy="Change the fields named in parentheses.",
        )
    signal_lines(options, sampling_period_s)


def _sweep_problems(options: ExcitationOptions, n_sample: int, sampling_period_s: float) -> list[str]:
    problems = []
    if options.low_hz >= options.high_hz:
        problems.append(f"low_hz {options.low_hz:g} is not below high_hz {options.high_hz:g} (swap them)")
    if 2 * options.high_hz * sampling_period_s >= 1:
        nyquist = 0.5 / sampling_period_s
        problems.append(
            f"high_hz {options.high_hz:g} is not below the Nyquist frequency {nyquist:g} Hz (lower high_hz)"
        )
    if options.grid == "odd" and n_sample % 2:
        problems.append(f"a period of {n_sample} samples has no half, which odd lines need (change period_s or grid)")
    if options.signal == "stepped_sine" and not problems:
        seconds = float(np.sum(1 / _steps_hz(options))) * (2 if options.grid == "odd" else 1)
        if seconds > options.period_s:
            problems.append(
                f"one cycle of each of {options.count} frequencies takes {seconds:.3g} s"
                f" (lengthen period_s to more, lower count, or raise low_hz)"
            )
    return problems


def _slow_problems(options: ExcitationOptions) -> list[str]:
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


def _not_slow(options: ExcitationOptions, n_sample: int) -> BoolArray:
    """Whether each line (n_lines,) is free of the slow motion and its multiples."""
    lines = np.arange(n_sample // 2 + 1)
    return np.asarray((options.slow_motion_rad_s == 0) | (lines % options.slow_motion_line != 0))


def _steps_hz(options: ExcitationOptions) -> FloatArray:
    spread = np.geomspace if options.spacing == "log" else np.linspace
    return np.asarray(spread(options.low_hz, options.high_hz, options.count))


def _sweep(options: ExcitationOptions, sampling_period_s: float) -> FloatArray:
    """One period of a chirp or stepped sine; the odd grid repeats its first half with the opposite sign."""
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    is_odd = options.grid == "odd"
    length = n_sample // 2 if is_odd else n_sample
    if options.signal == "chirp":
        low, high = options.low_hz * sampling_period_s, options.high_hz * sampling_period_s
        signal = chirp(low, high, length, peak=options.chirp_peak)
    else:
        signal = stepped_sine(_steps_hz(options) * sampling_period_s, length)
    return np.concatenate([signal, -signal]) if is_odd else signal - signal.mean()


def _design_other(options: ExcitationOptions, n_motor: int, realizations: int, sampling_period_s: float) -> Excitation:
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    excited, detection = signal_lines(options, sampling_period_s)
    lines, base = _series(options, excited, n_motor, realizations, sampling_period_s)
    rms = rms_per_motor(options.rms, n_motor)
    base = base * (rms[:, None] / np.sqrt(np.sum(np.abs(base) ** 2, axis=-1, keepdims=True) / 2))
    block = np.einsum("rik,ie->reki", base, orthogonal_matrix(n_motor))
    reference = time_signal(block, lines, n_sample)
    return Excitation(
        reference=reference,
        kind=options.inject,
        excited_lines=excited,
        detection_lines=detection,
        sampling_period_s=sampling_period_s,
        spectrum=block[:, :, np.searchsorted(lines, excited)],
        rms=rms,
        crest_factor=crest_factor(reference),
    )


def _series(
    options: ExcitationOptions, excited: IntArray, n_motor: int, realizations: int, sampling_period_s: float
) -> tuple[IntArray, ComplexArray]:
    """Lines, and each motor's complex amplitudes (n_real, n_motor, n_lines) at them."""
    generator = np.random.default_rng([options.seed, 2])
    if options.signal == "fourier":
        phase = generator.uniform(0, 2 * np.pi, (realizations, n_motor, len(excited)))
        series = np.exp(1j * phase)
        return excited, resting_series(series, excited, _ORDERS[options.inject]) if options.at_rest else series
    signal = _sweep(options, sampling_period_s)
    lines = np.arange(1, (len(signal) - 1) // 2 + 1, 2 if options.grid == "odd" else 1)
    phase = generator.uniform(0, 2 * np.pi, (realizations, n_motor, 1))
    return lines, np.fft.rfft(signal)[lines] * np.exp(1j * phase)
