"""Logs of simulated records, written as a controller does with a unit of its own, and the mapping that reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy.io import savemat

from robid.arrays import FloatArray
from robid.results.scale import OWN_SCALES, SCALES, Scale
from robid.settings.sources import Acquire
from robid.signals.log_channels import InputChannel, OutputChannel, UnitName
from robid.signals.log_options import TimeChannel
from robid.signals.record import Record
from robid.studies.settings.unit_mistakes import LogSignal

Log: TypeAlias = dict[str, dict[str, FloatArray]]
"""Variables of each experiment, by its name."""

_SIGNALS = {"torque": "torque", "motor_angle": "angle", "arm_angle": "arm", "speed": "speed"}
"""Variables of a log by the channels that scales name; behind each stands the number of its joint."""

_SPEED_BAND = 0.25
"""Share of the sampling rate up to which a drive's speed follows its encoder's."""


@dataclass(frozen=True)
class Sizes:
    """Factors that are a robot's own.

    Attributes:
        gear_ratio (n_joint,): Size of each joint's gear ratio.
        counts: Counts of a radian of a motor's encoder.
        torque_constant: Torque constant of the motors [N m/A].
    """

    gear_ratio: FloatArray
    counts: float
    torque_constant: float

    def factors(self, scale: Scale) -> FloatArray:
        """Returns what a scale multiplies the values of each joint by (n_joint,)."""
        size = getattr(self, scale.factor) if scale.factor in OWN_SCALES else SCALES[scale.factor]
        factors = np.broadcast_to(np.asarray(size, float), self.gear_ratio.shape)
        return np.asarray(1 / factors if scale.inverse else factors)


def log_of(record: Record, joints: Sequence[str], configuration: int) -> Log:
    """Returns what a controller logs of one configuration: whole periods, every signal in SI units.

    Args:
        record: The record of that configuration.
        joints: Names of the joints.
        configuration: Its index.
    """
    outputs = record.outputs[0] + record.output_offset[0]
    inputs, names = record.inputs[0], record.output_names
    found: Log = {}
    for real, exp in np.ndindex(inputs.shape[:2]):
        torque, moved = (each[real, exp].reshape(-1, each.shape[-1]) for each in (inputs, outputs))
        one = {"time": record.sampling_period_s * np.arange(len(torque))}
        for number, joint in enumerate(joints, start=1):
            angle = moved[:, names.index(joint)]
            one[f"torque_{number}"] = torque[:, record.input_names.index(joint)]
            one[f"angle_{number}"] = angle
            one[f"speed_{number}"] = _speed(angle, record.sampling_period_s)
            if f"{joint}.arm" in names:
                one[f"arm_{number}"] = moved[:, names.index(f"{joint}.arm")]
        found[f"c{configuration + 1}_r{real + 1}_e{exp + 1}"] = one
    return found


def _speed(angle: FloatArray, period_s: float) -> FloatArray:
    """A drive's speed: the derivative of a steady state's encoder, without what lies above its band."""
    spectrum, line_hz = np.fft.rfft(angle), np.fft.rfftfreq(len(angle), period_s)
    kept = line_hz <= _SPEED_BAND / period_s
    return np.asarray(np.fft.irfft(2j * np.pi * line_hz * kept * spectrum, len(angle)))


def mistaken_log(log: Log, scale: Scale, factors: FloatArray) -> Log:
    """Returns a log whose values are those of another unit than the one that is stated.

    Args:
        log: The log in SI units.
        scale: What is wrong; the time stamps, where it is the time.
        factors (n_joint,): What the channel of each joint is multiplied by; 1 where nothing is wrong.
    """
    if scale.channel == "time":
        return {name: {**one, "time": one["time"] * factors[0]} for name, one in log.items()}
    changed = {f"{_SIGNALS[scale.channel]}_{number}": factor for number, factor in enumerate(factors.tolist(), start=1)}

    def read(name: str, values: FloatArray) -> FloatArray:
        scaled = values * changed.get(name, 1.0)
        # What counts is a whole number.
        return np.asarray(np.rint(scaled) if scale.factor == "counts" and changed.get(name, 1.0) != 1 else scaled)

    return {experiment: {name: read(name, values) for name, values in one.items()} for experiment, one in log.items()}


def write_log(path: Path, log: Log) -> None:
    """Writes a log as a MAT file, a structure for each experiment."""
    columns: dict[str, Any] = {name: {key: values[:, None] for key, values in one.items()} for name, one in log.items()}
    savemat(path, columns)


def mapping_of(
    path: Path, joints: Sequence[str], signals: Sequence[LogSignal], period_s: float, options: Mapping[str, Any]
) -> Acquire:
    """Returns the mapping that reads such a log, every channel in SI units.

    Args:
        path: The log.
        joints: Names of the joints.
        signals: What it holds beside the torques; where it has no angles, speeds take their place.
        period_s: Stated sampling period [s].
        options: Further options of the mapping.
    """
    place = "c{configuration}_r{realization}_e{experiment}"

    def outputs(signal: LogSignal) -> list[OutputChannel]:
        suffix = {"angle": "", "arm": ".arm", "speed": ".speed" if "angle" in signals else ""}[signal]
        unit: UnitName = "rad/s" if signal == "speed" else "rad"
        return [
            OutputChannel(name=f"{joint}{suffix}", variable=f"{place}.{signal}_{number}", unit=unit)
            for number, joint in enumerate(joints, start=1)
        ]

    return Acquire(
        file=str(path),
        format="mat",
        sampling_period_s=period_s,
        inputs=tuple(
            InputChannel(name=joint, variable=f"{place}.torque_{number}", unit="N m")
            for number, joint in enumerate(joints, start=1)
        ),
        outputs=tuple(channel for signal in signals for channel in outputs(signal)),
        **options,
    )


def stamps(place: str = "c{configuration}_r{realization}_e{experiment}") -> TimeChannel:
    """Returns the time channel of such a log."""
    return TimeChannel(variable=f"{place}.time", unit="s")
