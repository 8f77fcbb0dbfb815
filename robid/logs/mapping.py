"""Which variable of a log is which channel, in which unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

INPUT_UNITS = {"N m": 1.0, "mN m": 1e-3, "A": 1.0, "mA": 1e-3}
"""Factors to N m, or to A where a torque constant follows."""

OUTPUT_UNITS = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": float(np.pi / 180), "turn": float(2 * np.pi)}
"""Factors to rad."""


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
        hold: A command held for a sample, or measured like the angles.
    """

    name: str
    variable: str
    unit: str = "N m"
    torque_constant_nm_a: float = 1.0
    torque_constant_relative_std: float = 0.0
    normalised: bool = False
    sign: int = 1
    hold: Literal["zoh", "band_limited"] = "zoh"

    @property
    def is_current(self) -> bool:
        """Whether the log holds a current."""
        return self.unit.endswith("A")


@dataclass(frozen=True)
class OutputChannel:
    """A measured angle.

    Attributes:
        name: Name of the channel; a motor's own angle carries the motor's name.
        variable: Variable of the log.
        unit: One of `OUTPUT_UNITS`.
        sign: 1, or -1 where the log counts the other way.
    """

    name: str
    variable: str
    unit: str = "rad"
    sign: int = 1


@dataclass(frozen=True)
class LogMapping:
    """One log file and its channels.

    Attributes:
        file: The log.
        sampling_period_s: Sampling period of all channels [s].
        drop_periods: Periods at the beginning that are left out as transient.
        time: Time stamps, or None where the log has none.
        inputs: Torque or current channels.
        outputs: Angle channels.
    """

    file: Path
    sampling_period_s: float
    drop_periods: int
    time: TimeChannel | None
    inputs: tuple[InputChannel, ...]
    outputs: tuple[OutputChannel, ...]
