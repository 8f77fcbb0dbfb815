"""Excitations of every kind: which signal, and what is added to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import ComplexArray, IntArray
from robid.design.excitation.excitation import Excitation, design_excitation, rms_per_motor
from robid.design.excitation.lines import samples_per_period
from robid.design.excitation.loop import NominalLoop
from robid.design.excitation.options import FourierOptions, MultisineOptions, PerturbationOptions, SweepOptions
from robid.design.excitation.signal_lines import RESTING_ORDERS, check_signal, signal_lines, sweep
from robid.signals.waveforms import crest_factor, orthogonal_matrix, resting_series, slow_motion, time_signal


def design_signal(
    options: PerturbationOptions,
    n_motor: int,
    realizations: int,
    sampling_period_s: float,
    loop: NominalLoop | None = None,
) -> Excitation:
    """Designs the excitation that the options ask for, with the slow motion that they add.

    Every kind is one period, played by all motors at once: motor i of experiment l has all its phases turned by
    entry (i, l) of `robid.signals.waveforms.orthogonal_matrix`, so that the block is orthogonal at every line.

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
    if isinstance(options, MultisineOptions):
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


def _design_other(
    options: SweepOptions | FourierOptions, n_motor: int, realizations: int, sampling_period_s: float
) -> Excitation:
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
    options: SweepOptions | FourierOptions, excited: IntArray, n_motor: int, realizations: int, sampling_period_s: float
) -> tuple[IntArray, ComplexArray]:
    """Lines, and each motor's complex amplitudes (n_real, n_motor, n_lines) at them."""
    generator = np.random.default_rng([options.seed, 2])
    if isinstance(options, FourierOptions):
        phase = generator.uniform(0, 2 * np.pi, (realizations, n_motor, len(excited)))
        series = np.exp(1j * phase)
        return excited, resting_series(series, excited, RESTING_ORDERS[options.inject]) if options.at_rest else series
    signal = sweep(options, sampling_period_s)
    lines = np.arange(1, (len(signal) - 1) // 2 + 1, 2 if options.grid == "odd" else 1)
    phase = generator.uniform(0, 2 * np.pi, (realizations, n_motor, 1))
    return lines, np.fft.rfft(signal)[lines] * np.exp(1j * phase)
