"""A large slow motion of one joint beneath an excitation, told to the position reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.excitation import Excitation
from robid.design.excitation.loop import NominalLoop
from robid.design.excitation.options import Travel
from robid.errors import SettingsError
from robid.robot.description import Robot

_ROUNDING = 1e-9


def with_travel(excitation: Excitation, travel: Travel | None, robot: Robot, configurations: FloatArray) -> Excitation:
    """Adds the travel that the options ask for, which begins in the middle: `amplitude sin(2 pi line t / period)`.

    Args:
        excitation: The perturbation.
        travel: The travel, or none.
        robot: The robot.
        configurations (n_conf, n_joint): Middles of the travel, arm side [rad, or m].

    Raises:
        SettingsError: If it leads beyond a joint's limits.
    """
    if travel is None:
        return excitation
    names = [joint.name for joint in robot.joints]
    index = names.index(travel.joint)
    amplitude = _amplitude(travel)
    lowest, highest = configurations[:, index].min() - amplitude, configurations[:, index].max() + amplitude
    if lowest < robot.lower[index] - _ROUNDING or highest > robot.upper[index] + _ROUNDING:
        unit, factor = ("m", 1.0) if robot.prismatic[index] else ("deg", 180 / np.pi)
        raise SettingsError(
            f"S034 Joint {travel.joint} would travel from {factor * lowest:.4g} to {factor * highest:.4g} {unit}, "
            "beyond its"
            f" limits of {factor * robot.lower[index]:.4g} and {factor * robot.upper[index]:.4g} {unit}.",
            where="excitation.travel",
            remedy="Lower the amplitude, or move the configuration to the middle.",
        )
    n_sample = excitation.reference.shape[2]
    way = amplitude * np.sin(2 * np.pi * travel.line * np.arange(n_sample) / n_sample)
    return replace(excitation, travel=np.asarray(way[:, None] * robot.motor_per_arm[:, index]))


def travel_demand(travel: FloatArray, loop: NominalLoop, index: int) -> FloatArray:
    """Predicts speed and torque of the motors on their way, by the robot in the travel's middle.

    Args:
        travel (n_sample, n_motor): Position reference of the motors [rad].
        loop: The nominal loop with its linearised robot.
        index: The configuration.

    Returns:
        Two signals (2, n_sample, n_motor) [rad/s, N m].
    """
    spectrum = np.fft.rfft(travel, axis=0)
    line = int(np.abs(spectrum).max(axis=1).argmax())
    slow = loop.at(np.array([line / (len(travel) * loop.controller.sampling_period_s)]))
    to_torque, to_angle = (gain[0] @ spectrum[line] for gain in slow.gains(index, "position_reference"))
    turn = np.exp(2j * np.pi * line * np.arange(len(travel)) / len(travel))[:, None] * 2 / len(travel)
    return np.stack([np.real(turn * 1j * slow.omega[0] * to_angle), np.real(turn * to_torque)])


def _amplitude(travel: Travel) -> float:
    return float(np.deg2rad(travel.amplitude_deg or 0.0)) if travel.amplitude_m is None else travel.amplitude_m
