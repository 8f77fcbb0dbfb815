"""Excitation of a campaign and its predicted motion against the robot's limits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.design.lines import choose_lines, samples_per_period
from robid.design.options import ExcitationOptions
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.signals.multisine import crest_factor, multisine, reduce_crest, time_signal
from robid.simulate.controller import frequency_response
from robid.simulate.options import Controller

MAX_EXCURSION_RAD = float(np.radians(5.0))
"""Default limit of the arm's excursion: what is linearised must stay a perturbation."""

_PLAYED_SHARE = 1e-6

UNITS = {"speed_reference": "rad/s", "position_reference": "rad", "torque": "N m"}


@dataclass(frozen=True)
class Plan:
    """What the excitation will do to the nominal robot, over all realizations and experiments.

    Attributes:
        speed_rms (n_conf, n_motor): Motor speed [rad/s].
        speed_peak (n_conf, n_motor): Largest absolute motor speed [rad/s].
        torque_rms (n_conf, n_motor): Motor torque with its static part [N m].
        torque_peak (n_conf, n_motor): Largest absolute motor torque with its static part [N m].
        excursion_rms (n_conf, n_motor): Arm excursion, motor angle over gear ratio [rad].
        excursion_peak (n_conf, n_motor): Largest absolute arm excursion [rad].
        speed_limit (n_motor,): Limit of the motor speed [rad/s].
        torque_limit (n_motor,): Limit of the motor torque [N m].
        excursion_limit (n_motor,): Limit of the arm excursion [rad].
        admissible_scale (n_conf, n_motor): Factor on all motors' RMS at which this motor meets its first limit;
            0 where the static torque alone does.
    """

    speed_rms: FloatArray
    speed_peak: FloatArray
    torque_rms: FloatArray
    torque_peak: FloatArray
    excursion_rms: FloatArray
    excursion_peak: FloatArray
    speed_limit: FloatArray
    torque_limit: FloatArray
    excursion_limit: FloatArray
    admissible_scale: FloatArray

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


@dataclass(frozen=True)
class Excitation:
    """What each motor is told to do, one period per realization and experiment.

    Attributes:
        reference (n_real, n_exp, n_sample, n_motor): Injected signal [rad/s, rad or N m].
        kind: `speed_reference`, `position_reference` or `torque`.
        excited_lines (n_freq,): Excited DFT lines.
        detection_lines (n_detection,): Odd lines of the band that were left out on purpose.
        sampling_period_s: Sampling period of the controller [s].
        spectrum (n_real, n_exp, n_freq, n_motor): Complex amplitudes at the excited lines [as reference].
        rms (n_motor,): RMS of each motor's signal [as reference].
        crest_factor (n_real, n_exp, n_motor): Peak over RMS of `reference`.
        plan: Predicted motion against the limits, or None before `predict`.
    """

    reference: FloatArray
    kind: str
    excited_lines: IntArray
    detection_lines: IntArray
    sampling_period_s: float
    spectrum: ComplexArray
    rms: FloatArray
    crest_factor: FloatArray
    plan: Plan | None = None

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
    def played_hz(self) -> FloatArray:
        """Frequencies of the played lines (n_played,) [Hz]."""
        return np.asarray(self.played_lines / self.period_s)


def design_excitation(
    options: ExcitationOptions, n_motor: int, realizations: int, sampling_period_s: float
) -> Excitation:
    """Designs orthogonal random-phase multisines with a low crest factor over each block of experiments.

    Args:
        options: Period, band, lines, RMS, phase iterations and seed.
        n_motor: Number of motors, and of experiments in a realization.
        realizations: Number of realizations, each with new phases.
        sampling_period_s: Sampling period of the controller [s].

    Raises:
        SettingsError: If the lines cannot be chosen or the RMS does not fit the motors.

    Source:
        Wernholt and Moberg (2008), sec. 4.
    """
    rms = rms_per_motor(options.rms, n_motor)
    excited, detection = choose_lines(options, sampling_period_s)
    amplitude = np.repeat(rms[:, None] * np.sqrt(2 / len(excited)), len(excited), axis=1)
    phase = np.empty((realizations, n_motor, len(excited)))
    # The optimizer's vectors are short: on a busy machine BLAS threads would only wait for each other.
    with threadpool_limits(1, user_api="blas"):
        for realization, motor in np.ndindex(realizations, n_motor):
            generator = np.random.default_rng([options.seed, 2, realization, motor])
            phase[realization, motor] = reduce_crest(
                generator.uniform(0, 2 * np.pi, len(excited)),
                amplitude[motor],
                excited,
                2 * np.pi * motor * np.arange(n_motor) / n_motor,
                iterations=options.phase_iterations,
            )
    spectrum = multisine(amplitude, phase)
    reference = time_signal(spectrum, excited, samples_per_period(options.period_s, sampling_period_s))
    return Excitation(
        reference=reference,
        kind=options.inject,
        excited_lines=excited,
        detection_lines=detection,
        sampling_period_s=sampling_period_s,
        spectrum=spectrum,
        rms=rms,
        crest_factor=crest_factor(reference),
    )


def predict(
    excitation: Excitation,
    response: ComplexArray,
    controller: Controller,
    static_torque: FloatArray,
    robot: Robot,
    *,
    max_excursion_rad: float = MAX_EXCURSION_RAD,
) -> Excitation:
    """Predicts speed, torque and excursion of the nominal closed loop and holds them against the limits.

    Friction is not in the prediction: a margin of a few N m should be left for it.

    Args:
        excitation: The excitation.
        response (n_conf, n_played, n_motor, n_motor): Sampled nominal response from motor torque to motor
            acceleration at the played lines, hold and computation delay inside [rad/(s^2 N m)].
        controller: The controller that plays it.
        static_torque (n_conf, n_motor): Motor torque that holds the arm [N m].
        robot: Names, limits, gear ratios and rotor inertias.
        max_excursion_rad: Limit of the arm excursion [rad].

    Returns:
        The excitation with its plan.

    Raises:
        SettingsError: If a motor's speed, torque or excursion exceeds its limit in any configuration.
    """
    n_motor, n_conf = len(robot.joints), response.shape[0]
    lines = excitation.played_lines
    check_shape("response", response, "n_conf n_played n_motor n_motor", n_played=len(lines), n_motor=n_motor)
    check_shape("static_torque", static_torque, "n_conf n_motor", n_conf=n_conf, n_motor=n_motor)
    reach = np.stack(
        [_reach(excitation, response[i], controller, static_torque[i], robot) for i in range(n_conf)], axis=2
    )
    minimum, maximum, rms = reach
    peak = np.maximum(maximum, -minimum)
    limits = np.array(
        [
            [joint.motor.max_speed_rad_s for joint in robot.joints],
            [joint.motor.max_torque_nm for joint in robot.joints],
            np.full(n_motor, max_excursion_rad),
        ]
    )
    scale = _admissible_scale(minimum, maximum, limits, static_torque)
    plan = Plan(
        speed_rms=rms[0],
        speed_peak=peak[0],
        torque_rms=rms[1],
        torque_peak=peak[1],
        excursion_rms=rms[2],
        excursion_peak=peak[2],
        speed_limit=limits[0],
        torque_limit=limits[1],
        excursion_limit=limits[2],
        admissible_scale=scale.min(axis=0),
    )
    _check_limits(excitation, robot, peak, limits, scale)
    return replace(excitation, plan=plan)


def rms_per_motor(rms: float | tuple[float, ...], n_motor: int) -> FloatArray:
    """Returns the RMS of each motor's signal (n_motor,).

    Raises:
        SettingsError: If the values do not fit the motors or are not positive.
    """
    values = np.full(n_motor, rms, float) if np.ndim(rms) == 0 else np.asarray(rms, float)
    problems = [] if len(values) == n_motor else [f"{len(values)} values for {n_motor} motors"]
    problems += [
        f"value {value:g} of motor {index + 1} is not positive" for index, value in enumerate(values) if value <= 0
    ]
    if problems:
        raise SettingsError(
            f"The RMS does not fit: {'; '.join(problems)}.",
            where="excitation.rms",
            remedy=f"Give one positive number, or a list of {n_motor}.",
        )
    return values


def _reach(
    excitation: Excitation, response: ComplexArray, controller: Controller, static_torque: FloatArray, robot: Robot
) -> FloatArray:
    """Minimum, maximum and RMS (3, 3, n_motor) of speed, torque and excursion in one configuration."""
    omega, lines, n_sample = 2 * np.pi * excitation.played_hz, excitation.played_lines, excitation.reference.shape[2]
    reference_gain, angle_gain = frequency_response(controller, robot.motor_inertia_kgm2, omega, excitation.kind)
    # U = C_r R - C_q Q with Q = -G U / w^2, for all experiments of a line at once.
    plant = -response / omega[:, None, None] ** 2
    loop = np.eye(len(robot.joints)) + angle_gain[:, :, None] * plant
    spectrum = np.fft.rfft(excitation.reference, axis=2)[:, :, lines] * (2 / n_sample)
    drive = np.moveaxis(reference_gain * spectrum, (0, 1, 2, 3), (2, 3, 0, 1))
    torque = np.linalg.solve(loop, drive.reshape(*drive.shape[:2], -1))
    angle = plant @ torque
    stacked = np.stack([1j * omega[:, None, None] * angle, torque, robot.arm_per_motor @ angle])
    signal = time_signal(np.moveaxis(stacked, -1, 1), lines, n_sample)
    signal[1] += static_torque
    return np.stack([signal.min(axis=(1, 2)), signal.max(axis=(1, 2)), np.sqrt(np.mean(signal**2, axis=(1, 2)))])


def _admissible_scale(
    minimum: FloatArray, maximum: FloatArray, limits: FloatArray, static_torque: FloatArray
) -> FloatArray:
    """Factor (3, n_conf, n_motor) on the excitation at which each quantity meets its limit."""
    offset = np.zeros_like(minimum)
    offset[1] = static_torque
    tiny = np.finfo(float).tiny
    upward = (limits[:, None] - offset) / np.maximum(maximum - offset, tiny)
    downward = (limits[:, None] + offset) / np.maximum(offset - minimum, tiny)
    return np.asarray(np.maximum(np.minimum(upward, downward), 0))


def _check_limits(
    excitation: Excitation, robot: Robot, peak: FloatArray, limits: FloatArray, scale: FloatArray
) -> None:
    """Collects every limit that a motor exceeds, at its worst configuration."""
    problems = []
    quantities = (("speed", "rad/s", 1.0), ("torque", "N m", 1.0), ("arm excursion", "deg", 180 / np.pi))
    for index, (quantity, unit, factor) in enumerate(quantities):
        for motor, joint in enumerate(robot.joints):
            over = np.flatnonzero(peak[index, :, motor] > limits[index, motor])
            if not len(over):
                continue
            worst = over[np.argmin(scale[index, over, motor])]
            others = f" and {len(over) - 1} more" if len(over) > 1 else ""
            admissible = (
                f"admissible rms {_floor(scale[index, worst, motor] * excitation.rms[motor]):.3g}"
                f" {UNITS[excitation.kind]}"
                if scale[index, worst, motor] > 0
                else "its static torque alone leaves no room"
            )
            problems.append(
                f"motor {joint.name}, configuration {worst + 1}{others}: {quantity} peak"
                f" {peak[index, worst, motor] * factor:.4g} {unit} exceeds {limits[index, motor] * factor:.4g} {unit}"
                f" ({admissible})"
            )
    if problems:
        factor = _floor(float(scale.min()))
        raise SettingsError(
            "The excitation would exceed limits:\n  " + "\n  ".join(problems),
            where="excitation.rms",
            remedy=f"Multiply the RMS of all motors by at most {factor:.3g} (the motors are coupled)."
            if factor > 0
            else "Leave out the configurations that the motors cannot hold.",
        )


def _floor(value: float) -> float:
    """Rounds a positive value down to three significant digits."""
    if value <= 0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(np.floor(value / digit) * digit)
