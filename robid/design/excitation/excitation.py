"""Excitation of a campaign: what each motor is told to do, every kind of signal, and what it will cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from threadpoolctl import threadpool_limits

from robid.arrays import ComplexArray, FloatArray, IntArray, Quantity, part_of
from robid.design.excitation.lines import (
    RESTING_ORDERS,
    check_signal,
    choose_lines,
    samples_per_period,
    signal_lines,
    sweep,
)
from robid.design.excitation.loop import NominalLoop, sensitivity_amplitude
from robid.design.excitation.options import FourierOptions, MultisineOptions, PerturbationOptions, SweepOptions
from robid.errors import SettingsError
from robid.signals.crest import reduce_crest, reduce_crest_with_motion
from robid.signals.quantities import Channel
from robid.signals.waveforms import crest_factor, multisine, orthogonal_matrix, resting_series, slow_motion, time_signal

_PLAYED_SHARE = 1e-6  # Size of a line, relative to the largest, below which it holds only rounding
_PLANNED = ("speed", "torque", "excursion")
_PLACES = "configuration motor"
_SNR = "configuration frequency output input", "Predicted signal-to-noise ratio of the response"
_CONDITION = "realization", "Condition number of a trajectory's regressor"
_INJECTED = "realization experiment sample motor", "Injected signal, one period"
_SPECTRUM = "realization experiment frequency motor", "Complex amplitudes of the excited lines"
_TRAVEL = "sample motor", "Position reference of the motors beneath the excitation, from the configuration"
UNITS = {"speed_reference": "rad/s", "position_reference": "rad", "torque": "N m", "pose_reference": "m, or rad"}


@dataclass(frozen=True)
class ExcitationPlan:
    """What the excitation will do to the nominal robot, over all realizations and experiments."""

    speed_rms: Annotated[FloatArray, Quantity("rad/s", "configuration motor", "Predicted RMS of the speed")]
    speed_peak: Annotated[FloatArray, Quantity("rad/s", "configuration motor", "Predicted peak of the speed")]
    # Motor torque with its static part
    torque_rms: Annotated[FloatArray, Quantity("N m", "configuration motor", "Predicted RMS of the torque")]
    # Largest absolute motor torque with its static part
    torque_peak: Annotated[FloatArray, Quantity("N m", "configuration motor", "Predicted peak of the torque")]
    # Arm excursion, motor angle over gear ratio
    excursion_rms: Annotated[FloatArray, Quantity("rad", "configuration motor", "Predicted RMS of the excursion")]
    excursion_peak: Annotated[FloatArray, Quantity("rad", "configuration motor", "Predicted peak of the excursion")]
    speed_limit: Annotated[FloatArray, Quantity("rad/s", "motor", "Limit of the speed")]
    torque_limit: Annotated[FloatArray, Quantity("N m", "motor", "Limit of the torque")]
    excursion_limit: Annotated[FloatArray, Quantity("rad", "motor", "Limit of the excursion")]
    # Factor on all motors' RMS at which this motor meets its first limit; 0 where the static torque alone does
    admissible_scale: Annotated[FloatArray, Quantity("1", _PLACES, "Factor on all RMS at which the first limit is met")]
    speed_crest: Annotated[FloatArray | None, Quantity("1", _PLACES, "Largest crest factor of the motor speed")] = None
    # Power of each element of the response over the variance that the assumed noise will give its estimate; None with
    # fewer experiments than motors and in older files
    snr_db: Annotated[FloatArray | None, Quantity("dB", *_SNR)] = None
    duration_s: float | None = None  # Time that the whole campaign takes, transients included; None in older files [s]
    # Of a trajectory, condition number of the regressor of its base parameters, each column over its size in random
    # motions; None for other signals and in older files
    condition: Annotated[FloatArray | None, Quantity("1", *_CONDITION)] = None

    @property
    def speed_margin(self) -> FloatArray:
        """Share of the speed limit (n_conf, n_motor) that is left."""
        return np.asarray(1 - self.speed_peak / self.speed_limit)

    @property
    def torque_margin(self) -> FloatArray:
        """Share of the torque limit (n_conf, n_motor) that is left."""
        return np.asarray(1 - self.torque_peak / self.torque_limit)

    @property
    def excursion_margin(self) -> FloatArray:
        """Share of the excursion limit (n_conf, n_motor) that is left."""
        return np.asarray(1 - self.excursion_peak / self.excursion_limit)


def make_plan(rms: FloatArray, peak: FloatArray, limits: FloatArray, admissible_scale: FloatArray) -> ExcitationPlan:
    """Makes a plan of speeds, torques and excursions.

    Predicted RMS and peak of each are (3, n_conf, n_motor), limits (3, n_motor), the scale (n_conf, n_motor).
    """
    kinds = (("rms", rms), ("peak", peak), ("limit", limits))
    found = {f"{what}_{kind}": each[row] for kind, each in kinds for row, what in enumerate(_PLANNED)}
    return ExcitationPlan(**found, admissible_scale=admissible_scale)


@dataclass(frozen=True)
class Excitation:
    """What each motor is told to do, one period per realization and experiment."""

    # Injected signal; of a pose chirp the commands, a channel of the pose in place of each motor
    reference: Annotated[FloatArray, Quantity("{signal}", *_INJECTED, compact=True)]
    kind: str  # `speed_reference`, `position_reference`, `torque` or `pose_reference`
    excited_lines: Annotated[IntArray, Quantity("1", "frequency", "Excited DFT lines")]
    detection_lines: Annotated[IntArray, Quantity("1", "detection", "DFT lines left out to detect distortion")]
    sampling_period_s: float  # Sampling period of the controller [s]
    spectrum: Annotated[ComplexArray, Quantity("{signal}", *_SPECTRUM)]
    # RMS of each motor's signal, a slow motion left out
    rms: Annotated[FloatArray, Quantity("{signal}", "motor", "RMS of each motor's signal")]
    # Peak over RMS, a slow motion left out
    crest_factor: Annotated[FloatArray, Quantity("1", "realization experiment motor", "Peak over RMS")]
    plan: ExcitationPlan | None = None  # Predicted motion against the limits, or None before `predict`
    channels: Annotated[tuple[Channel, ...], Quantity("1", "motor", "What each column is where it is no motor")] = ()
    # Of a large motion; None without one
    travel: Annotated[FloatArray | None, Quantity("rad", *_TRAVEL, compact=True)] = None

    @property
    def own_units(self) -> dict[str, str]:
        """Unit that its kind decides."""
        return {"signal": UNITS[self.kind]}

    @property
    def period_s(self) -> float:
        """Length of one period [s]."""
        return float(self.reference.shape[2]) * self.sampling_period_s

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies (n_freq,) [Hz]."""
        return np.asarray(self.excited_lines / self.period_s)

    @property
    def played_lines(self) -> IntArray:
        """All lines (n_played,) that `reference` holds: excited ones, a slow motion, a sweep's edges."""
        size = np.abs(np.fft.rfft(self.reference, axis=2)).max(axis=(0, 1, 3))
        size[0] = size[len(size) - 1 if self.reference.shape[2] % 2 == 0 else 0] = 0
        return np.flatnonzero(size > _PLAYED_SHARE * size.max())

    @property
    def played_spectrum(self) -> ComplexArray:
        """Complex amplitudes (n_real, n_exp, n_played, n_motor) at the played lines [as reference]."""
        n_sample = self.reference.shape[2]
        return np.asarray(np.fft.rfft(self.reference, axis=2)[:, :, self.played_lines] * (2 / n_sample))

    def first_experiments(self, count: int | None) -> Excitation:
        """Returns the first experiments of every block, all of them without a count."""
        return part_of(self, "experiment", slice(count))


@dataclass(frozen=True)
class CampaignExcitation:
    """The excitation of one campaign."""

    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side joint angles")]
    excitation: Excitation  # The excitation; without realizations where a log was played by others


def design_excitation(
    options: MultisineOptions,
    n_motor: int,
    realizations: int,
    sampling_period_s: float,
    loop: NominalLoop | None = None,
) -> Excitation:
    """Designs orthogonal random-phase multisines with a low crest factor over each block of experiments.

    Args:
        options: Period, band, lines, RMS, amplitudes, crest-factor search and seed.
        n_motor: Number of motors, and of experiments in a realization.
        realizations: Number of realizations, each with new phases.
        sampling_period_s: Sampling period of the controller [s].
        loop: The nominal loop at the excited lines; needed for amplitudes shaped by sensitivity and for a low
            crest factor of the motion, which is that of the configuration nearest the mean.

    Raises:
        SettingsError: If the lines cannot be chosen or the RMS does not fit the motors.
        ValueError: If the loop is needed and not given.

    Source:
        Wernholt and Moberg (2008), sec. 4.
    """
    rms = _rms_per_motor(options.rms, n_motor)
    excited, detection = choose_lines(options, sampling_period_s)
    # The vectors are short: on a busy machine BLAS threads would only wait for each other.
    with threadpool_limits(1, user_api="blas"):
        amplitude = _amplitude(options, rms, len(excited), loop)
        turn = None
        if options.random_block_phases:
            generator = np.random.default_rng([options.seed, 4])
            turn = generator.uniform(0, 2 * np.pi, (realizations, n_motor, len(excited)))
        phase = np.array([_phases(options, amplitude, excited, index, turn, loop) for index in range(realizations)])
    spectrum = multisine(amplitude, phase, turn)
    reference = time_signal(spectrum, excited, samples_per_period(options.period_s, sampling_period_s))
    crest = crest_factor(reference)
    return Excitation(reference, options.inject, excited, detection, sampling_period_s, spectrum, rms, crest)


def _amplitude(options: MultisineOptions, rms: FloatArray, n_lines: int, loop: NominalLoop | None) -> FloatArray:
    # A sum of n cosines of amplitude a has the RMS a sqrt(n / 2).
    flat = np.repeat(rms[:, None] * np.sqrt(2 / n_lines), n_lines, axis=1)
    if options.amplitude == "flat":
        return flat
    noise = options.assumed_angle_noise_rad, options.assumed_torque_noise_nm
    return sensitivity_amplitude(flat, _needed(loop), options.inject, *noise)


def _phases(
    options: MultisineOptions,
    amplitude: FloatArray,
    lines: IntArray,
    realization: int,
    turn: FloatArray | None,
    loop: NominalLoop | None,
) -> FloatArray:
    """Phases (n_motor, n_lines) of one realization; a start beyond one per motor goes to the worst motor so far."""
    n_motor, n_lines = amplitude.shape
    # Motor i of experiment l plays the same phases plus those of T[i, l]: R = R_diag T, T T^H = n 1.
    shifts = np.angle(orthogonal_matrix(n_motor))
    own = None if turn is None else turn[realization]
    if own is not None:
        shifts = shifts[:, :, None] + own
    generators = [np.random.default_rng([options.seed, 2, realization, motor]) for motor in range(n_motor)]
    phases, crest = np.zeros(amplitude.shape), np.full(n_motor, np.inf)
    for _ in range(max(options.phase_starts, n_motor)):
        # Each further start goes to the motor whose crest factor is the worst.
        motor = int(np.argmax(crest))
        start = generators[motor].uniform(0, 2 * np.pi, (n_lines,))
        found, peak = reduce_crest(start, amplitude[motor], lines, shifts[motor], iterations=options.phase_iterations)
        if peak < crest[motor]:
            phases[motor], crest[motor] = found, peak
    if options.crest_at == "reference":
        return phases
    loop = _needed(loop)
    speed = 1j * loop.omega[:, None, None] * loop.gains(loop.central(), options.inject)[1]
    return reduce_crest_with_motion(phases, amplitude, lines, speed, own, iterations=options.phase_iterations)


def _needed(loop: NominalLoop | None) -> NominalLoop:
    if loop is None:
        raise ValueError("The nominal loop is needed to shape amplitudes or motion.")
    return loop


def _rms_per_motor(rms: float | tuple[float, ...], n_motor: int) -> FloatArray:
    values = np.full(n_motor, rms, float) if np.ndim(rms) == 0 else np.asarray(rms, float)
    problems = [] if len(values) == n_motor else [f"{len(values)} values for {n_motor} motors"]
    low = [(index, value) for index, value in enumerate(values, 1) if value <= 0]
    problems += [f"value {value:g} of motor {index} is not positive" for index, value in low]
    if problems:
        message, remedy = f"S025 The RMS does not fit: {'; '.join(problems)}.", "Give one positive number, or a list of"
        raise SettingsError(message, where="excitation.rms", remedy=f"{remedy} {n_motor}.")
    return values


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
        # A speed v at the line k is the angle v T / (2 pi k).
        amplitude *= options.period_s / (2 * np.pi * options.slow_motion_line)
    n_sample, generator = excitation.reference.shape[2], np.random.default_rng([options.seed, 3])
    added = slow_motion(amplitude, options.slow_motion_line, realizations, n_motor, n_sample, generator)
    return replace(excitation, reference=excitation.reference + added)


def _design_other(
    options: SweepOptions | FourierOptions, n_motor: int, realizations: int, sampling_period_s: float
) -> Excitation:
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    excited, detection = signal_lines(options, sampling_period_s)
    lines, base = _series(options, excited, n_motor, realizations, sampling_period_s)
    rms = _rms_per_motor(options.rms, n_motor)
    # RMS of complex amplitudes is sqrt(sum |a|^2 / 2).
    base = base * (rms[:, None] / np.sqrt(np.sum(np.abs(base) ** 2, axis=-1, keepdims=True) / 2))
    block = np.einsum("rik,ie->reki", base, orthogonal_matrix(n_motor))
    reference, spectrum = time_signal(block, lines, n_sample), block[:, :, np.searchsorted(lines, excited)]
    crest = crest_factor(reference)
    return Excitation(reference, options.inject, excited, detection, sampling_period_s, spectrum, rms, crest)


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
