"""What a campaign's signals come from: its excitation, a simulation with its truth, measured logs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import pydantic.dataclasses
from pydantic import Discriminator, Field, GetJsonSchemaHandler, Tag
from pydantic_core import CoreSchema

from robid.arrays import group, option
from robid.design.excitation.options import (
    ArbitraryOptions,
    ChirpOptions,
    FourierOptions,
    MultisineOptions,
    PoseChirpOptions,
    SteppedSineOptions,
    TrajectoryOptions,
)
from robid.later import later
from robid.robot.description import Robot
from robid.settings.base import DATA_VARIABLE, STRICT, data_path
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import SpringSection
from robid.signals.log_options import LogOptions
from robid.signals.response_options import ResponseOptions
from robid.simulate.options import SimulateOptions, Truth

with later(__name__):
    from robid.simulate.truth import true_robot

_DEFAULT = "multisine"


def signal(value: Any) -> str:  # noqa: ANN401
    """Returns which signal a section is about; without the key it is a multisine."""
    if isinstance(value, Mapping):
        return str(value.get("signal", _DEFAULT))
    return str(getattr(value, "signal", _DEFAULT))


class _KeyUnlessDefault:
    """Requires the key in the JSON schema of every signal but the default, so that a section fits one of them."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core)
        for member in schema["oneOf"]:
            section = handler.resolve_ref_schema(member)
            if section["properties"]["signal"]["const"] != _DEFAULT:
                section["required"] = ["signal", *section.get("required", [])]
        return schema


ExcitationSettings: TypeAlias = Annotated[
    Annotated[MultisineOptions, Tag("multisine")]
    | Annotated[ChirpOptions, Tag("chirp")]
    | Annotated[SteppedSineOptions, Tag("stepped_sine")]
    | Annotated[FourierOptions, Tag("fourier")]
    | Annotated[TrajectoryOptions, Tag("trajectory")]
    | Annotated[PoseChirpOptions, Tag("pose_chirp")]
    | Annotated[ArbitraryOptions, Tag("arbitrary")],
    Discriminator(signal),
    _KeyUnlessDefault(),
]


@dataclass(frozen=True)
class TruthSettings(Truth):
    """How the simulated robot differs from the robot file, in springs that the file lacks too."""

    springs: tuple[SpringSection, ...] = option(
        (),
        "Springs that the simulated robot has and the robot file lacks, written as in a robot file;"
        " no transmissions. They have no random deviation.",
    )


@dataclass(frozen=True)
class SimulateSettings(SimulateOptions):
    """One simulated campaign, as the experiment file describes it."""

    truth: TruthSettings = group(TruthSettings, "How the true robot differs from the robot file.")


def with_truth_springs(robot: RobotFile, truth: TruthSettings) -> RobotFile:
    """Returns the robot file with the springs that it lacks after its own."""
    return robot.model_copy(update={"springs": (*robot.springs, *truth.springs)})


def true_robot_of(robot: RobotFile, payload_kg: float | None, truth: Truth) -> Robot:
    """Returns the true robot of a campaign, whose payload mass replaces the file's where it is given [kg]."""
    springs = truth.springs if isinstance(truth, TruthSettings) else ()
    further = tuple(spring.spring(robot.joints) for spring in springs)
    return true_robot(robot.to_robot(payload_kg), truth, further)


PLACES = ("configuration", "realization", "experiment")
"""What stands for numbers in names of logs and variables."""
WIDTH = re.compile(r"0?\d{0,2}d?")
"""How a number may be written in such a name: as `{realization:03d}`."""
_NUMBERED = re.compile(r"\{(" + "|".join(PLACES) + r")(?::(" + WIDTH.pattern + r"))?\}")


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class Acquire(LogOptions):
    """Measured logs and what their variables mean."""

    file: str = Field(
        description="The log. `${ROBID_DATA}` is the data folder; other paths start at the experiment file. "
        "`{configuration}`, `{realization}` and `{experiment}` are replaced by their numbers, from "
        "1."
    )

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
        """Returns the paths of the logs that channels name beside `file`, by that name; indices as in `log_path`."""
        return {one.file: _path(one.file, folder, indices) for one in self.channels if one.file is not None}

    def in_place(self, *indices: int) -> LogOptions:
        """Returns what the log means, numbers in place of their names in its variables; indices as in `log_path`."""
        changed: dict[str, Any] = {}
        for key, channels in self.groups.items():
            times = [None if one.time is None else _numbered(one.time, indices) for one in channels]
            pairs = zip(channels, times, strict=True)
            changed[key] = tuple(
                replace(one, variable=_numbered(one.variable, indices), time=time) for one, time in pairs
            )
        if self.time is not None:
            changed["time"] = replace(self.time, variable=_numbered(self.time.variable, indices))
        return LogOptions(**{one.name: changed.get(one.name, getattr(self, one.name)) for one in fields(LogOptions)})


_IN_RESPONSE = re.compile(r"\{(configuration)(?::(" + WIDTH.pattern + r"))?\}")


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class ResponseSource(ResponseOptions):
    """Frequency responses that were measured elsewhere, and what their files mean."""

    file: str = Field(
        description="The file of responses. `${ROBID_DATA}` is the data folder; other paths start at the experiment "
        "file. `{configuration}` is replaced by its number, from 1, where each has a file; else one file has all."
    )

    @property
    def is_numbered(self) -> bool:
        """Whether each configuration has a file of its own."""
        return is_numbered_response(self.file)

    def paths(self, folder: Path, configuration: int) -> dict[str | None, Path]:
        """Returns the files of a configuration, index from 0: None for `file`, others by their names as written."""
        return response_paths(self.file, self, folder, configuration)


def is_numbered_response(file: str) -> bool:
    """Whether each configuration has a file of responses of its own, by the name of it."""
    return _IN_RESPONSE.search(file) is not None


def response_paths(file: str, options: ResponseOptions, folder: Path, configuration: int) -> dict[str | None, Path]:
    """Returns the files of a configuration, index from 0: None for `file`, others by their names as written."""
    names: dict[str | None, str] = {each.file: each.file for each in options.elements if each.file is not None}
    if not options.elements or any(each.file is None for each in options.elements):
        names = {None: file, **names}
    return {key: _path(name, folder, (configuration, 0, 0)) for key, name in names.items()}


def is_numbered(variable: str, place: str) -> bool:
    """Whether a variable's name holds the number of a place, as `exp{realization}.torque`."""
    return any(found[1] == place for found in _NUMBERED.finditer(variable))


def _numbered(variable: str, indices: Sequence[int]) -> str:
    """A variable's name with its numbers; braces may stand for cells too, so only known names are replaced."""
    numbers = {key: index + 1 for key, index in zip(PLACES, indices, strict=True)}
    return _NUMBERED.sub(lambda found: format(numbers[found[1]], found[2] or ""), variable)


def _path(file: str, folder: Path, indices: Sequence[int]) -> Path:
    rest = file.removeprefix(DATA_VARIABLE)
    start = file.removesuffix(rest) if rest else file
    numbers = {key: index + 1 for key, index in zip(PLACES, indices, strict=True)}
    return data_path(start + rest.format(**numbers), folder)
