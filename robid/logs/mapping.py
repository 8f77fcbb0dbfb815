"""Which variable of a log is which channel, in which unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

_DEG = float(np.pi / 180)

INPUT_UNITS = {"N m": 1.0, "mN m": 1e-3, "A": 1.0, "mA": 1e-3, "m/s": 1.0}
"""Factors to N m, or to A where a torque constant follows; m/s for a drive whose input is a velocity."""

OUTPUT_UNITS = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": _DEG, "turn": float(2 * np.pi), "m": 1.0, "mm": 1e-3}
"""Factors to rad, or to m."""

REFERENCE_UNITS = {
    "speed_reference": {"rad/s": 1.0, "deg/s": _DEG, "rpm": float(np.pi / 30)},
    "position_reference": {"rad": 1.0, "deg": _DEG},
    "torque": {"N m": 1.0},
}
"""Factors to the unit of the excitation, by its kind."""


@dataclass(frozen=True)
class TimeChannel:
    """The log's time stamps.

    Attributes:
        variable: Variable of the log.
        to_seconds: Factor to seconds.
    """

    variable: str
    to_seconds: float = 1.0


@dataclass(frozen=True)
class InputChannel:
    """A motor's torque or current.

    Attributes:
        name: Name of the channel.
        variable: Variable of the log.
        unit: One of `INPUT_UNITS`.
        torque_constant_nm_a: Torque constant, for a current [N m/A].
        torque_constant_relative_std: Standard deviation of its relative error.
        normalised: Whether the torque constant is unknown and 1 stands for it.
        sign: 1, or -1 where the log counts the other way.
        scale: Factor from the log's numbers to the unit.
        hold: A command held for a sample, or measured like the angles.
    """

    name: str
    variable: str
    unit: str = "N m"
    torque_constant_nm_a: float = 1.0
    torque_constant_relative_std: float = 0.0
    normalised: bool = False
    sign: int = 1
    scale: float = 1.0
    hold: Literal["zoh", "band_limited"] = "zoh"

    @property
    def is_current(self) -> bool:
        """Whether the log holds a current."""
        return self.unit.endswith("A")

    @property
    def factor(self) -> float:
        """Factor from the log's numbers to `stands_in`."""
        return self.sign * self.scale * INPUT_UNITS[self.unit] * self.torque_constant_nm_a

    @property
    def stands_in(self) -> str:
        """Unit of what the record holds as torque."""
        if self.unit == "m/s":
            return self.unit
        return "A" if self.normalised else "N m"


@dataclass(frozen=True)
class OutputChannel:
    """A measured angle or position.

    Attributes:
        name: Name of the channel; a motor's own angle carries the motor's name.
        variable: Variable of the log.
        unit: One of `OUTPUT_UNITS`.
        sign: 1, or -1 where the log counts the other way.
        scale: Factor from the log's numbers to the unit.
    """

    name: str
    variable: str
    unit: str = "rad"
    sign: int = 1
    scale: float = 1.0

    @property
    def factor(self) -> float:
        """Factor from the log's numbers to rad or m."""
        return self.sign * self.scale * OUTPUT_UNITS[self.unit]


@dataclass(frozen=True)
class ReferenceChannel:
    """What a motor was told, as the log has it.

    Attributes:
        name: Name of the motor.
        variable: Variable of the log.
        unit: One of `REFERENCE_UNITS` of the excitation's kind.
        sign: 1, or -1 where the log counts the other way.
        scale: Factor from the log's numbers to the unit.
    """

    name: str
    variable: str
    unit: str = "rad/s"
    sign: int = 1
    scale: float = 1.0


@dataclass(frozen=True)
class LogMapping:
    """One log file and its channels.

    Attributes:
        file: The log.
        sampling_period_s: Sampling period of all channels [s].
        drop_periods: Periods at the beginning that are left out as transient; with references, of those that match.
        time: Time stamps, or None where the log has none.
        inputs: Torque or current channels.
        outputs: Angle channels.
        references: What the motors were told, in the order of the inputs; empty where it was not logged.
        format: `mat` (version 5) or `csv`.
        take: Whether the first whole periods are used after the dropped ones, or the last of the log.
    """

    file: Path
    sampling_period_s: float
    drop_periods: int
    time: TimeChannel | None
    inputs: tuple[InputChannel, ...]
    outputs: tuple[OutputChannel, ...]
    references: tuple[ReferenceChannel, ...] = ()
    format: Literal["mat", "csv"] = "mat"
    take: Literal["first", "last"] = "first"

    @property
    def variables(self) -> list[str]:
        """The variables of all channels but the time: inputs, outputs, references."""
        channels: list[InputChannel | OutputChannel | ReferenceChannel] = [*self.inputs, *self.outputs]
        return [channel.variable for channel in [*channels, *self.references]]
