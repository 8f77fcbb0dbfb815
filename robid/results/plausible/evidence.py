"""What the checks of plausibility look at: signs, means and noise of the motors alone, and what carries the weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.frf.quality import saturated_signals
from robid.robot.description import Robot
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.signals.quantities import ACCELERATION, MOTOR_TORQUE, QUANTITIES, Channel

CLEAR = 10.0
"""Power over variance from which a response counts as seen (10 dB)."""

_LOW_LINES = 16
_SPREAD_LINES = 40


@dataclass(frozen=True)
class Evidence:
    """What a campaign shows of the motors whose torque and angle were both recorded."""

    names: tuple[str, ...]  # Their names
    configurations: FloatArray  # (n_conf, n_joint) Stated arm-side angles [rad]
    frequency_hz: FloatArray  # (n_low,) The lowest lines [Hz]
    response: ComplexArray  # (n_conf, n_low, n_motor, n_motor) Response there [rad/(s^2 N m)]
    clear: BoolArray  # (n_conf, n_low, n_motor, n_motor) Which of it stands out of its noise
    # (n_conf, n_freq, n_motor) Power of the driving points over their variance, at all lines; None where no variance is
    # known
    signal_to_noise: FloatArray | None
    mean_angle: FloatArray | None  # (n_conf, n_motor) Mean motor angles, None in old files [rad]
    mean_torque: FloatArray | None  # (n_conf, n_motor) Mean motor torques, None in old files [N m]
    motion_rms: FloatArray | None  # (n_conf, n_motor) RMS of motor angles about their means, None in old files [rad]
    torque_unit: str  # Unit that stands for N m
    lines_hz: FloatArray  # (n_freq,) All lines [Hz]
    driving: ComplexArray  # (n_conf, n_freq, n_motor) Driving points there [rad/(s^2 N m)]
    sampling_period_s: float  # Sampling period of the experiment [s]
    hold_period_s: float | None  # Period for which the torque is held; None where it is not [s]
    # Share of the time (n_conf,) in which each input and output saturates, by what it is; empty where it is unknown
    saturated: Mapping[str, FloatArray]
    moved: tuple[Channel, ...]  # What each motor and arm, as far as it was recorded, was measured as
    spread_hz: FloatArray  # (n_spread,) Lines all over the band [Hz]
    spread: ComplexArray  # (n_conf, n_spread, n_moved, n_motor) Response of these motors and arms there [rad/(s^2 N m)]
    uncompensated: ComplexArray  # (n_conf, n_spread, n_moved, n_motor) The same before torques were compensated
    spread_clear: BoolArray  # (n_conf, n_spread, n_moved, n_motor) Which of it stands out of its noise
    torque_rms: FloatArray | None  # (n_conf, n_motor) RMS of the torques about their means, None in old files [N m]
    has_record: bool = True  # Whether a record is behind it, which leaves no doubt of the phase's sign

    def joints(self, robot: Robot) -> IntArray:
        """Indices of the motors among a robot's joints."""
        names = [joint.name for joint in robot.joints]
        return np.array([names.index(name) for name in self.names], int)

    def undone(self, torque: FloatArray, motion: FloatArray, time: float) -> Evidence:
        """Returns what the motors would have shown without wrong scales.

        Args:
            torque (n_motor,): Read over true torques.
            motion (n_motor,): Read over true motions.
            time: Read over true time.
        """
        kinds = {one.name: QUANTITIES[one.quantity].derivatives or 0 for one in self.moved}
        faster = time ** np.array([kinds.get(name, 0) for name in self.names], float)
        factor = (faster / motion)[:, None] * torque

        def over(values: FloatArray | None, scale: FloatArray) -> FloatArray | None:
            return None if values is None else values / scale

        return replace(
            self,
            frequency_hz=self.frequency_hz * time,
            lines_hz=self.lines_hz * time,
            response=self.response * factor,
            driving=self.driving * np.diagonal(factor),
            mean_angle=over(self.mean_angle, motion),
            motion_rms=over(self.motion_rms, motion),
            mean_torque=over(self.mean_torque, torque),
            sampling_period_s=self.sampling_period_s / time,
            hold_period_s=None if self.hold_period_s is None else self.hold_period_s / time,
        )

    def belongs_to(self, robot: Robot) -> bool:
        """Whether there are motors, and all of them are the robot's."""
        return bool(self.names) and {*self.names} <= {joint.name for joint in robot.joints}


def gather_evidence(frf: Frf) -> Evidence:
    """Takes what the checks look at from a response."""
    pushed = {one.name for one in frf.input_channels if MOTOR_TORQUE.accepts([one])}
    moved = {one.name for one in frf.output_channels if ACCELERATION.accepts([one])}
    names = tuple(name for name in frf.input_names if name in pushed & moved)
    inputs = [frf.input_names.index(name) for name in names]
    outputs = [frf.output_names.index(name) for name in names]
    shows_angles = all(frf.measured_channels[output].quantity == "angle" for output in outputs if frf.measured_channels)
    low = np.argsort(frf.frequency_hz, kind="stable")[:_LOW_LINES]
    response = frf.response[:, :, outputs][..., inputs]
    ratio = _signal_to_noise(frf)
    seen = None if ratio is None else ratio[:, :, outputs][..., inputs]
    return Evidence(
        names=names,
        configurations=frf.configurations,
        frequency_hz=frf.frequency_hz[low],
        response=response[:, low],
        clear=np.ones(response[:, low].shape, bool) if seen is None else seen[:, low] > CLEAR,
        signal_to_noise=None if seen is None else np.diagonal(seen, axis1=-2, axis2=-1),
        mean_angle=frf.mean_output[:, outputs] if frf.mean_output is not None and shows_angles else None,
        mean_torque=None if frf.mean_input is None else frf.mean_input[:, inputs],
        motion_rms=frf.motion_rms[:, outputs] if frf.motion_rms is not None and shows_angles else None,
        torque_unit=frf.input_unit,
        lines_hz=frf.frequency_hz,
        driving=np.diagonal(response, axis1=-2, axis2=-1),
        sampling_period_s=frf.sampling_period_s,
        hold_period_s=frf.hold_period_s,
        saturated=saturated_signals(frf),
        has_record=frf.has_record,
        **_spread(frf, names, inputs),
    )


def _spread(frf: Frf, names: tuple[str, ...], inputs: list[int]) -> dict[str, Any]:
    """What lines all over the band show of motors and of arms beside them."""
    known = {*names, *(f"{name}.arm" for name in names)}
    outputs = [
        index for index, one in enumerate(frf.output_channels) if one.name in known and ACCELERATION.accepts([one])
    ]
    measured = frf.measured_channels or frf.output_channels
    order = np.argsort(frf.frequency_hz, kind="stable")
    at = order[np.unique(np.linspace(0, order.size - 1, min(order.size, _SPREAD_LINES)).round().astype(int))]
    pick = np.ix_(np.arange(len(frf.configurations)), at, np.array(outputs, int), np.array(inputs, int))
    ratio, raw = _signal_to_noise(frf), frf.uncompensated_response
    return {
        "moved": tuple(measured[index] for index in outputs),
        "spread_hz": frf.frequency_hz[at],
        "spread": frf.response[pick],
        "uncompensated": (frf.response if raw is None else raw)[pick],
        "spread_clear": np.ones(frf.response[pick].shape, bool) if ratio is None else ratio[pick] > CLEAR,
        "torque_rms": None if frf.input_amplitude is None else _rms(frf.input_amplitude[:, :, inputs]),
    }


def _rms(amplitude: ComplexArray) -> FloatArray:
    """RMS (n_conf, n_in) of half complex amplitudes (n_conf, n_freq, n_in, n_block), mean over the experiments."""
    power = 2 * np.nansum(np.abs(amplitude) ** 2, axis=(1, 3))
    return np.asarray(np.sqrt(power / np.maximum(np.isfinite(amplitude).all(axis=1).sum(axis=-1), 1)))


_OF_CONFIGURATIONS = ("configurations", "response", "clear", "driving", "spread", "uncompensated", "spread_clear")
_IF_KNOWN = ("signal_to_noise", "mean_angle", "mean_torque", "motion_rms", "torque_rms")


def join_evidence(parts: Sequence[Evidence]) -> Evidence:
    """Joins the evidence of single configurations of one campaign."""
    first, joined = parts[0], dict[str, Any]()
    for name in (*_OF_CONFIGURATIONS, *_IF_KNOWN):
        values = [getattr(part, name) for part in parts]
        joined[name] = None if any(value is None for value in values) else np.concatenate(values)
    shared = [signal for signal in first.saturated if all(signal in part.saturated for part in parts)]
    saturated = {signal: np.concatenate([part.saturated[signal] for part in parts]) for signal in shared}
    return replace(first, **joined, saturated=saturated)


def _signal_to_noise(frf: Frf) -> FloatArray | None:
    """Power over the noise's variance, over the total one where noise is not known apart."""
    if frf.noise_covariance is not None:
        return frf.signal_to_noise
    if frf.total_covariance is None:
        return None
    power, variance = np.abs(frf.response) ** 2, frf.element_variance()
    return np.asarray(np.divide(power, variance, out=np.full_like(power, np.inf), where=variance > 0))


@dataclass(frozen=True)
class Carrier:
    """A robot, and what its torques are recorded as."""

    robot: Robot  # The robot, with its campaign's payload
    torque_factor: FloatArray  # (n_joint,) Recorded over true torques

    def holds(self, configurations: FloatArray, motors: IntArray) -> FloatArray:
        """Returns true torques (n_conf, n_motor) with which motors hold configurations (n_conf, n_joint) [N m]."""
        model = build_model(self.robot, balanced=True)
        return np.asarray(solve_statics(model, configurations).motor_torque[:, motors])


@dataclass(frozen=True)
class Fitted:
    """What a fit found, and how far it may be off."""

    found: Carrier  # The robot as the fit has it
    off: tuple[Carrier, ...]  # The robot off by a share of a standard deviation along each independent direction
    share: float  # That share

    def scatter(self, configurations: FloatArray, motors: IntArray) -> FloatArray:
        """Returns the covariance (n_motor, n_conf, n_conf) of true torques that this leaves open [N^2 m^2]."""
        factor = self.found.torque_factor[motors]
        own = self.found.holds(configurations, motors)
        total = np.zeros((len(motors), len(configurations), len(configurations)))
        for other in self.off:
            changed = other.holds(configurations, motors) * other.torque_factor[motors] / factor
            column = (changed - own) / self.share
            total += np.einsum("cm,dm->mcd", column, column)
        return total
