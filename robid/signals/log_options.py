"""What a log is: its format and dialect, its channels, its own time, its poses, and which part of it is used."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

import numpy as np

from robid.arrays import FloatArray, option
from robid.signals.log_channels import InputChannel, LogChannel, OutputChannel, ReferenceChannel
from robid.signals.pose import ANGLES, POSE
from robid.signals.quantities import DRIVES

LogFormat: TypeAlias = Literal["csv", "mat", "hdf5", "npz", "parquet", "arrow", "json", "mcap", "rosbag", "tdms", "mdf"]
"""The formats of logs that are read; `robid.logs` has a row of its table of formats for each."""


@dataclass(frozen=True)
class Dialect:
    """How a table of text is written; what is not given is told from the table."""

    delimiter: str | None = field(
        default=None,
        metadata={
            "description": "Separator of the columns: one character, `tab`, or `whitespace` for any number of "
            "spaces and tabs. Recognised from the table when not given.",
            "pattern": r"^([^\w\s.+\-]|tab|whitespace)$",
        },
    )
    decimal: Literal[".", ","] | None = option(None, "Decimal mark; recognised from the table when not given.")
    header_line: int | None = option(
        None,
        "Line of the column names, counted from 1; 0 if there is none and numbers from 1 name the columns. "
        "Recognised from the table when not given.",
        ge=0,
        le=1_000_000,
    )
    comments: tuple[str, ...] = option(("#", "%"), "Beginning of lines that are skipped.")
    encoding: str | None = option(
        None,
        "Encoding of the text, as `shift_jis`. When not given: what its first bytes state, UTF-8 or else Windows-1252.",
    )

    @property
    def separator(self) -> str | None:
        """The delimiter as a character; a space stands for `whitespace`, None where it is to be told."""
        return {"tab": "\t", "whitespace": " "}.get(self.delimiter or "", self.delimiter)


TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
"""Units of time [s]."""


@dataclass(frozen=True)
class TimeChannel:
    """The log's own time, against which the sampling period is checked."""

    variable: str = field(metadata={"description": "Name of the variable in the log."})
    unit: Literal["s", "ms", "us", "ns", "min", "h"] = option("s", "Unit of the time.")

    @property
    def to_seconds(self) -> float:
        """Factor to seconds."""
        return TIME_UNITS[self.unit]


@dataclass(frozen=True)
class PoseOptions:
    """Which channels of a log are absolute poses, to become displacements in the tool frame of the home pose."""

    absolute: tuple[Literal["inputs", "outputs"], ...] = option(
        ("outputs",),
        "Which of `inputs` and `outputs` are absolute poses, channels X Y Z A B C: turns A about Z,"
        " B about the new Y, C about the new X. Displacements along the home pose's axes are left as they are.",
        min_length=1,
    )
    home: tuple[float, float, float, float, float, float] | None = option(
        None, "The home pose, X Y Z [m] and A B C [deg]; the first sample that is used when not given."
    )

    @property
    def stated(self) -> FloatArray | None:
        """The home pose (6,) [m, rad] where it is stated."""
        return None if self.home is None else np.concatenate([self.home[:3], np.deg2rad(self.home[3:])])


@dataclass(frozen=True, kw_only=True)
class LogOptions:
    """What the variables of a log mean, and which part of it is used."""

    format: LogFormat | None = option(None, "Format of the log; recognised from the file when not given.")
    dialect: Dialect = option(Dialect(), "Format of a text table; recognised from the table when not given.")
    sampling_period_s: float = field(
        metadata={
            "description": "Sampling period of the log [s]: the controller's cycle, or the setting of the recorder.",
            "ge": 1e-7,
        }
    )
    inputs: tuple[InputChannel, ...] = field(
        metadata={
            "description": "Signals that drive the robot: motor torques in the order of the joints.",
            "min_length": 1,
        }
    )
    outputs: tuple[OutputChannel, ...] = field(metadata={"description": "Measured signals.", "min_length": 1})
    references: tuple[ReferenceChannel, ...] = option(
        (),
        "Commands of the motors, in the order of the joints. The excitation is then designed here, and each "
        "log is matched to it.",
    )
    pose: PoseOptions | None = option(None, "Which channels are absolute poses of the tool.")
    time: TimeChannel | None = option(None, "The log's own time, if it has one.")
    resample: Literal["time", "period"] | None = option(
        None,
        "Clock to which interpolation brings the samples. `time`: the log's own, in steps of "
        "`sampling_period_s`. `period`: the generator's, so that a measured period has its stated samples.",
    )
    drop_periods: int = option(0, "Periods dropped at the start of the log.", ge=0, le=100_000)
    one_shot: bool = option(
        False,
        "The log does not repeat, as a trajectory. It is read whole, without excitation, periods and frequency "
        "response.",
    )
    from_s: float = option(
        0.0,
        "Start of the used part, counted from the log's first sample, by the log's own time if it has one. "
        "Periods count from here [s].",
        ge=0,
    )
    to_s: float | None = option(None, "End of the used part; the end of the log when not given [s].", gt=0)
    take: Literal["first", "last"] = option(
        "first", "Which whole periods are used: the first after those dropped, or the last."
    )

    @property
    def groups(self) -> dict[str, tuple[LogChannel, ...]]:
        """Inputs, outputs and references, by the names of their settings."""
        return {"inputs": self.inputs, "outputs": self.outputs, "references": self.references}

    @property
    def channels(self) -> tuple[LogChannel, ...]:
        """All channels but the time: inputs, outputs, references."""
        return (*self.inputs, *self.outputs, *self.references)

    @property
    def is_cut(self) -> bool:
        """Whether only a part of the log is used."""
        return self.from_s > 0 or self.to_s is not None

    @property
    def takes_turns(self) -> bool:
        """Whether a log may move some of its channels only: it has several commands, no torques."""
        return len(self.inputs) > 1 and not any(one.channel.quantity in DRIVES for one in self.inputs)

    def pose_problems(self) -> list[tuple[str, str]]:
        """Finds channels that make no pose: `inputs` or `outputs`, and what is wrong with them."""
        found: list[tuple[str, str]] = []
        for key in () if self.pose is None else self.pose.absolute:
            channels: tuple[LogChannel, ...] = getattr(self, key)
            units = {one.name: one.si_unit for one in channels if not one.problems()}
            lacking = [name for name in POSE if units.get(name) != ("rad" if name in ANGLES else "m")]
            if lacking:
                found.append(
                    (key, f"S375 a pose has X Y Z in m or mm and A B C in rad or deg: {', '.join(lacking)} lacking")
                )
            if any(one.name in POSE and getattr(one, "zero", 0.0) for one in channels):
                found.append((key, "S376 a pose is seen from its home: leave `zero` out"))
        return found
