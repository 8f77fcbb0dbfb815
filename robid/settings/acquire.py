"""Models of measured logs in the experiment file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pydantic.dataclasses
from pydantic import Field

from robid.settings.base import DATA_VARIABLE, STRICT, data_path
from robid.signals.log_channels import LogChannel
from robid.signals.log_options import LogOptions

PLACES = ("configuration", "realization", "experiment")
"""What stands for numbers in names of logs and variables."""
_NUMBERED = re.compile(r"\{(" + "|".join(PLACES) + r")(?::(0?\d*d?))?\}")


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class Acquire(LogOptions):
    """Measured logs and what their variables mean."""

    file: str = Field(
        description="The log; `${ROBID_DATA}` stands for the data folder, other paths start at the experiment file;"
        " `{configuration}`, `{realization}` and `{experiment}` for their numbers, from 1."
    )

    @property
    def channels(self) -> tuple[LogChannel, ...]:
        """Inputs, outputs and references."""
        return (*self.inputs, *self.outputs, *self.references)

    def log_path(self, folder: Path, configuration: int = 0, realization: int = 0, experiment: int = 0) -> Path:
        """Returns the path of a log.

        Args:
            folder: Folder of the experiment file, for a path that does not start with `${ROBID_DATA}`.
            configuration: Index of the configuration, from 0.
            realization: Index of the realization, from 0.
            experiment: Index of the experiment, from 0.
        """
        return _path(self.file, folder, (configuration, realization, experiment))

    def further_paths(self, folder: Path, *indices: int) -> dict[str, Path]:
        """Returns the paths of the logs that channels name beside `file`, by that name.

        Args:
            folder: As in `log_path`.
            *indices: Of configuration, realization and experiment, each from 0.
        """
        return {one.file: _path(one.file, folder, indices) for one in self.channels if one.file is not None}

    def in_place(self, *indices: int) -> LogOptions:
        """Returns what the log means, numbers from 1 in the place of their names in its variables.

        Args:
            *indices: Of configuration, realization and experiment, each from 0.
        """
        changed: dict[str, Any] = {
            key: tuple(_in_place(one, indices) for one in getattr(self, key))
            for key in ("inputs", "outputs", "references")
        }
        if self.time is not None:
            changed["time"] = replace(self.time, variable=_numbered(self.time.variable, indices))
        return LogOptions(**{one.name: changed.get(one.name, getattr(self, one.name)) for one in fields(LogOptions)})


def _in_place(channel: LogChannel, indices: Sequence[int]) -> LogChannel:
    """A channel with numbers in the names of its variable and of its time."""
    time = None if channel.time is None else _numbered(channel.time, indices)
    return replace(channel, variable=_numbered(channel.variable, indices), time=time)


def is_numbered(variable: str, place: str) -> bool:
    """Whether a variable's name holds the number of a place, as `exp{realization}.torque`."""
    return any(found[1] == place for found in _NUMBERED.finditer(variable))


def _numbered(variable: str, indices: Sequence[int]) -> str:
    """A variable's name with its numbers; braces may stand for cells too, so only known names are replaced."""
    numbers = {key: index + 1 for key, index in zip(PLACES, indices, strict=True)}
    return _NUMBERED.sub(lambda found: format(numbers[found[1]], found[2] or ""), variable)


def _path(file: str, folder: Path, indices: Sequence[int]) -> Path:
    """The path of a log, numbers from 1 in the place of their names."""
    rest = file.removeprefix(DATA_VARIABLE)
    start = file.removesuffix(rest) if rest else file
    return data_path(
        start + rest.format(**{key: index + 1 for key, index in zip(PLACES, indices, strict=True)}), folder
    )
