"""Predicted motion, torque and signal-to-noise ratio of an excitation and of the travel beneath it, against limits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.design.excitation.excitation import UNITS, Excitation, make_plan
from robid.design.excitation.loop import NominalLoop, predicted_snr_db, residual_covariance
from robid.design.excitation.options import PerturbationOptions, Travel
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.signals.waveforms import crest_factor, time_signal

_ROUNDING = 1 + 1e-9  # A limit that is used up to its last digit is not exceeded


def predict(
    excitation: Excitation,
    loop: NominalLoop,
    options: PerturbationOptions,
    *,
    periods: int = 1,
    transient_periods: int = 0,
) -> Excitation:
    """Predicts what the nominal closed loop will do, scaled where a share of its limits is asked for; refuses more.

    Friction is not in the prediction: a margin of a few N m should be left for it. The static torque is not scaled.
    A travel counts for speed and torque, not for the excursion.

    Args:
        excitation: The excitation.
        loop: The nominal loop at the excited lines; its linearised robot is needed where more than these is played.
        options: Share of the limits to use, limit of the excursion and assumed noise.
        periods: Recorded periods of each experiment.
        transient_periods: Periods of each experiment before those.

    Raises:
        SettingsError: If a motor's speed, torque or excursion exceeds its limit in any configuration.
    """
    n_motor, n_conf = len(loop.robot.joints), len(loop.response)
    axes = {"n_freq": len(excitation.excited_lines), "n_motor": n_motor}
    check_shape("response", loop.response, "n_conf n_freq n_motor n_motor", **axes)
    check_shape("static_torque", loop.static_torque, "n_conf n_motor", n_conf=n_conf, n_motor=n_motor)
    limits = _limits(loop.robot, options)
    reach, crest = _reaches(excitation, loop)
    if options.limit_share is not None:
        share = admissible_scale(reach[0], reach[1], options.limit_share * limits, loop.static_torque)
        factor = _common_factor(share, loop.robot, options.limit_share)
        excitation, reach = _scaled(excitation, factor), _scaled_reach(reach, loop.static_torque, factor)
    minimum, maximum, rms = reach
    peak = np.maximum(maximum, -minimum)
    scale = admissible_scale(minimum, maximum, limits, loop.static_torque)
    every = "RMS of all motors" if options.slow_motion_rad_s == 0 else "RMS of all motors and the slow motion"
    _check_limits(excitation, loop.robot, peak, limits, scale, every)
    length = np.prod(excitation.reference.shape[:2]) * n_conf * (periods + transient_periods)
    whole = excitation.reference.shape[1] == n_motor
    plan = replace(
        make_plan(rms, peak, limits, scale.min(axis=0)),
        speed_crest=crest,
        snr_db=np.array([_snr_db(excitation, loop, i, options, periods) for i in range(n_conf)]) if whole else None,
        duration_s=float(length) * excitation.period_s,
    )
    return replace(excitation, plan=plan)


def _reaches(excitation: Excitation, loop: NominalLoop) -> tuple[FloatArray, FloatArray]:
    """What `_reach` finds in all configurations (3, 3, n_conf, n_motor), (n_conf, n_motor)."""
    played = excitation.played_lines
    # A slow motion and a sweep's edges move the robot too, at lines that the loop was not made for.
    moving = loop if np.array_equal(played, excitation.excited_lines) else loop.at(played / excitation.period_s)
    found = [_reach(excitation, moving, index) for index in range(len(loop.response))]
    return np.stack([each for each, _ in found], axis=2), np.array([each for _, each in found])


def _limits(robot: Robot, options: PerturbationOptions) -> FloatArray:
    speed, torque = ([getattr(one.motor, key) for one in robot.joints] for key in ("max_speed_rad_s", "max_torque_nm"))
    excursion = np.where(robot.prismatic, options.max_excursion_m, np.radians(options.max_excursion_deg))
    return np.array([speed, torque, excursion])


def _reach(excitation: Excitation, loop: NominalLoop, index: int) -> tuple[FloatArray, FloatArray]:
    """Minimum, maximum and RMS (3, 3, n_motor) of speed, torque and excursion, and the speed's crest (n_motor,)."""
    to_torque, to_angle = loop.gains(index, excitation.kind)
    rate = 1j * loop.omega[:, None, None]
    # Speed j w q, torque, and arm excursion, each as a gain from the references.
    gains = np.stack([rate * to_angle, to_torque, loop.robot.arm_per_motor @ to_angle])
    # All experiments at once: complex amplitudes of the played lines, then one inverse transform.
    stacked = np.einsum("qkmi,reki->qrekm", gains, excitation.played_spectrum, optimize=True)
    signal = time_signal(stacked, excitation.played_lines, excitation.reference.shape[2])
    crest = crest_factor(signal[0]).max(axis=(0, 1))
    if excitation.travel is not None:
        signal[:2] += travel_demand(excitation.travel, loop, index)[:, None, None]
    signal[1] += loop.static_torque[index]
    samples = (1, 2, 3)
    rms = np.sqrt(np.mean(signal**2, axis=samples))
    return np.stack([signal.min(axis=samples), signal.max(axis=samples), rms]), crest


def _snr_db(
    excitation: Excitation, loop: NominalLoop, index: int, options: PerturbationOptions, periods: int
) -> FloatArray:
    """Signal-to-noise ratio (n_freq, n_out, n_in) in one configuration."""
    response = loop.response[index]
    torque = np.einsum("kmi,reki->rekm", loop.gains(index, excitation.kind)[0], excitation.spectrum, optimize=True)
    noise = options.assumed_angle_noise_rad, options.assumed_torque_noise_nm
    residual = residual_covariance(response, loop.omega, *noise)
    return predicted_snr_db(response, torque, residual, excitation.reference.shape[2], periods)


def _common_factor(share: FloatArray, robot: Robot, limit_share: float) -> float:
    """The factor on all motors at which the nearest limit is reached to the share that is asked for."""
    factor = float(share.min())
    if factor > 0:
        return factor
    _, configuration, motor = np.unravel_index(int(np.argmin(share)), share.shape)
    needed = f"more than {100 * limit_share:.3g} % of its torque limit to hold the arm"
    message = f"S029 Motor {robot.joints[motor].name} needs {needed} in configuration {configuration + 1}."
    remedy = "Raise `limit_share`, or leave out the configurations that the motors hardly hold."
    raise SettingsError(message, where="excitation.limit_share", remedy=remedy)


def _scaled(excitation: Excitation, factor: float) -> Excitation:
    scaled: dict[str, Any] = {name: factor * getattr(excitation, name) for name in ("reference", "spectrum", "rms")}
    return replace(excitation, **scaled)


def _scaled_reach(reach: FloatArray, static_torque: FloatArray, factor: float) -> FloatArray:
    """Minimum, maximum and RMS around a static torque (n_conf, n_motor) that does not scale."""
    offset = np.zeros_like(reach[0])
    offset[1] = static_torque
    minimum, maximum = offset + factor * (reach[0] - offset), offset + factor * (reach[1] - offset)
    # RMS about an offset: the varying part alone scales.
    rms = np.sqrt(offset**2 + factor**2 * np.maximum(reach[2] ** 2 - offset**2, 0))
    return np.stack([minimum, maximum, rms])


def admissible_scale(
    minimum: FloatArray, maximum: FloatArray, limits: FloatArray, static_torque: FloatArray
) -> FloatArray:
    """Factor (3, n_conf, n_motor) at which each quantity meets its limit; static torque does not scale.

    Least and greatest speed, torque and excursion are (3, n_conf, n_motor) [rad/s, N m, rad or m], their limits
    (3, n_motor), the motor torque that holds the arm (n_conf, n_motor) [N m].
    """
    offset = np.zeros_like(minimum)
    offset[1] = static_torque
    tiny = np.finfo(float).tiny
    # Factor at which the varying part meets what the static torque leaves of the limit.
    upward = (limits[:, None] - offset) / np.maximum(maximum - offset, tiny)
    downward = (limits[:, None] + offset) / np.maximum(offset - minimum, tiny)
    return np.asarray(np.maximum(np.minimum(upward, downward), 0))


def _check_limits(
    excitation: Excitation, robot: Robot, peak: FloatArray, limits: FloatArray, scale: FloatArray, every: str
) -> None:
    """Collects every limit that a motor exceeds, at its worst configuration."""
    problems = []
    quantities = (("speed", "rad/s", 1.0), ("torque", "N m", 1.0), ("arm excursion", "deg", 180 / np.pi))
    for index, (quantity, of_angles, factor_of_angles) in enumerate(quantities):
        for motor, joint in enumerate(robot.joints):
            slides = quantity == "arm excursion" and joint.type == "prismatic"
            unit, factor = ("m", 1.0) if slides else (of_angles, factor_of_angles)
            over = np.flatnonzero(peak[index, :, motor] > _ROUNDING * limits[index, motor])
            if not len(over):
                continue
            worst = over[np.argmin(scale[index, over, motor])]
            others = f" and {len(over) - 1} more" if len(over) > 1 else ""
            admissible = "its static torque alone leaves no room"
            if (room := scale[index, worst, motor]) > 0:
                admissible = f"admissible rms {_floor(room * excitation.rms[motor]):.3g} {UNITS[excitation.kind]}"
            problems.append(
                f"motor {joint.name}, configuration {worst + 1}{others}: {quantity} peak"
                f" {peak[index, worst, motor] * factor:.4g} {unit} exceeds {limits[index, motor] * factor:.4g} {unit}"
                f" ({admissible})"
            )
    if problems:
        remedy = "Leave out the configurations that the motors cannot hold."
        if (factor := _floor(float(scale.min()))) > 0:
            remedy = f"Multiply the {every} by at most {factor:.3g} (the motors are coupled)."
        message = "S030 The excitation would exceed limits:\n  " + "\n  ".join(problems)
        raise SettingsError(message, where="excitation.rms", remedy=remedy)


def _floor(value: float) -> float:
    """Rounds a positive value down to three significant digits."""
    if value <= 0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(np.floor(value / digit) * digit)


_END_ROUNDING = 1e-9


def with_travel(excitation: Excitation, travel: Travel | None, robot: Robot, configurations: FloatArray) -> Excitation:
    """Adds the travel that the options ask for, which begins in the middle: `amplitude sin(2 pi line t / period)`.

    Its middles are the configurations (n_conf, n_joint) [rad, or m].

    Raises:
        SettingsError: If it leads beyond a joint's limits.
    """
    if travel is None:
        return excitation
    names = [joint.name for joint in robot.joints]
    index = names.index(travel.joint)
    degrees = travel.amplitude_deg or 0.0
    amplitude = float(np.deg2rad(degrees)) if travel.amplitude_m is None else travel.amplitude_m
    lowest, highest = configurations[:, index].min() - amplitude, configurations[:, index].max() + amplitude
    if lowest < robot.lower[index] - _END_ROUNDING or highest > robot.upper[index] + _END_ROUNDING:
        unit, factor = ("m", 1.0) if robot.prismatic[index] else ("deg", 180 / np.pi)
        way = f"{factor * lowest:.4g} to {factor * highest:.4g} {unit}"
        limits = f"{factor * robot.lower[index]:.4g} and {factor * robot.upper[index]:.4g} {unit}"
        message = f"S034 Joint {travel.joint} would travel from {way}, beyond its limits of {limits}."
        remedy = "Lower the amplitude, or move the configuration to the middle."
        raise SettingsError(message, where="excitation.travel", remedy=remedy)
    n_sample = excitation.reference.shape[2]
    sine = amplitude * np.sin(2 * np.pi * travel.line * np.arange(n_sample) / n_sample)
    return replace(excitation, travel=np.asarray(sine[:, None] * robot.motor_per_arm[:, index]))


def travel_demand(travel: FloatArray, loop: NominalLoop, index: int) -> FloatArray:
    """Speed and torque (2, n_sample, n_motor) on a travel (n_sample, n_motor) [rad], by the robot in its middle.

    It is a position reference of the motors [rad] that makes speeds [rad/s] and torques [N m] in one configuration.
    """
    spectrum = np.fft.rfft(travel, axis=0)
    # A travel is one line: amplitude and phase at it say all.
    line = int(np.abs(spectrum).max(axis=1).argmax())
    slow = loop.at(np.array([line / (len(travel) * loop.controller.sampling_period_s)]))
    to_torque, to_angle = (gain[0] @ spectrum[line] for gain in slow.gains(index, "position_reference"))
    turn = np.exp(2j * np.pi * line * np.arange(len(travel)) / len(travel))[:, None] * 2 / len(travel)
    return np.stack([np.real(turn * 1j * slow.omega[0] * to_angle), np.real(turn * to_torque)])
