"""Loading an experiment file together with its robot file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError

from robid.errors import SettingsError
from robid.settings.checks.experiment import Studies, check_experiment
from robid.settings.checks.robot import check_robot
from robid.settings.checks.values import absurd, missing_keys
from robid.settings.experiment import Experiment, experiment_type
from robid.settings.fits import Families
from robid.settings.numbering import counted_from_zero, of_known_version
from robid.settings.other_files import refuse_other_settings
from robid.settings.placeholders import Row, fill, refuse_placeholders
from robid.settings.problems import SettingsProblem, mistyped, problem_at, raise_problems, told_once, validate_document
from robid.settings.robot import RobotFile, UnknownRobot
from robid.settings.robot_parts import plain_settings
from robid.settings.sound_part import LeftOut, names_of, sketch, sound_part, untouched
from robid.settings.sources import Acquire
from robid.settings.yaml import Document, FieldPath, load_yaml
from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel

ARM = ".arm"
_One = TypeVar("_One", InputChannel, OutputChannel, ReferenceChannel)


def with_sides(experiment: Experiment, robot: RobotFile) -> Experiment:
    """Returns an experiment whose channels of a joint's arm side are named alike, however the file wrote them.

    `A1.arm`, `A1` with `side: arm`, and `A1` of a joint without a motor are the same. An output is then called
    `A1.arm`, since the motor's angle may stand beside it; an input or a reference is the one of its joint, `A1` with
    its side.
    """
    changed = {}
    for name, campaign in experiment.campaigns.items():
        source = campaign.source
        if source is None or source.measured is None:
            continue
        measured, key = source.measured, "acquire" if source.response is None else "response"
        joints, sensed = [joint.name for joint in robot.joints], robot.without_motor
        found: Any = replace(
            measured,
            inputs=tuple(_drive(one, joints, sensed) for one in measured.inputs),
            outputs=tuple(_output(one, joints, sensed) for one in measured.outputs),
        )
        if isinstance(found, Acquire):
            found = replace(found, references=tuple(_drive(one, joints, sensed) for one in found.references))
        if found != measured:
            changed[name] = campaign.model_copy(update={"source": source.model_copy(update={key: found})})
    return experiment.model_copy(update={"campaigns": {**experiment.campaigns, **changed}}) if changed else experiment


def _drive(channel: _One, joints: Collection[str], sensed: Collection[str]) -> _One:
    name = channel.name.removesuffix(ARM)
    is_arm = _is_arm(channel, joints, sensed)
    return replace(channel, name=name, side="arm") if is_arm else channel


def _output(channel: OutputChannel, joints: Collection[str], sensed: Collection[str]) -> OutputChannel:
    is_arm = _is_arm(channel, joints, sensed) and not channel.name.endswith(ARM)
    return replace(channel, name=f"{channel.name}{ARM}", side=None) if is_arm else channel


def _is_arm(channel: _One, joints: Collection[str], sensed: Collection[str]) -> bool:
    """Whether a channel is of the arm side of a joint; one that contradicts itself stays for the checks."""
    name = channel.name.removesuffix(ARM)
    if name not in joints:
        return False
    if channel.name.endswith(ARM):
        return channel.side in (None, "arm")
    return channel.side == "arm" or (channel.side is None and name in sensed)


_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def experiment_schema_of(families: Families, study: Any = Any) -> dict[str, Any]:  # noqa: ANN401
    """Returns the JSON schema of the experiment file whose fits are of these families, with this type of study."""
    return {"$schema": _DIALECT, **experiment_type(families, study).model_json_schema(by_alias=True)}


def robot_schema() -> dict[str, Any]:
    """Returns the JSON schema of the robot file."""
    return {"$schema": _DIALECT, **RobotFile.model_json_schema(by_alias=True)}


RobotReader: TypeAlias = Callable[[Path], tuple[RobotFile | None, list[SettingsProblem]]]
"""Reads a robot file and finds what is wrong with it; raises a `SettingsError` where it cannot be read."""
_Model = TypeVar("_Model")


@dataclass(frozen=True)
class LoadedExperiment:
    """An experiment and its robot, checked."""

    path: Path  # The experiment file, as the user named it
    experiment: Experiment
    robot: RobotFile  # The robot file; without joints where there is none
    families: Families  # The families of its fits, by name
    # Names of files as a row of a manifest says them, by field; `experiment` holds where they are
    written: Mapping[FieldPath, str] = field(default_factory=dict)

    @property
    def robot_path(self) -> Path | None:
        """The robot file, None where there is none."""
        return None if self.experiment.robot is None else self.path.parent / self.experiment.robot

    @cached_property
    def plain(self) -> dict[str, Any]:
        """The experiment as values that JSON knows, with the whole robot file as its `robot`; not to be changed."""
        found = plain_settings(self.experiment)
        for path, text in self.written.items():
            section = found
            for part in path[:-1]:
                section = section[part]
            section[path[-1]] = text
        return {**found, "robot": plain_settings(self.robot)}


def load_experiment_of(families: Families, path: Path, studies: Studies | None = None) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, if it names one, and checks both; a study if one is known.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    document = load_yaml(path)
    refuse_placeholders(document)
    return _require(*_load(families, document, studies, read_robot))


def load_row_of(
    families: Families, document: Document, row: Row, read: RobotReader
) -> tuple[LoadedExperiment | None, list[SettingsProblem]]:
    """Checks the experiment that a row of a manifest makes of an experiment file.

    Returns:
        The experiment, None where there is a problem; every problem with its line and field.
    """
    filled = fill(document, row)
    loaded, problems = _load(families, filled.document, None, read)
    if filled.problems:
        # What stands in the place of the missing value may have been complained of too.
        told = {problem.field for problem in filled.problems}
        others = (problem for problem in problems if problem.field not in told)
        return None, told_once([*filled.problems, *others])
    return None if loaded is None else replace(loaded, written=filled.written), told_once(problems)


def read_robot(path: Path) -> tuple[RobotFile | None, list[SettingsProblem]]:
    """Reads a robot file and finds what is wrong with it.

    Raises:
        SettingsError: If it cannot be read.
    """
    return _checked_robot(load_yaml(path))


def load_robot(path: Path) -> RobotFile:
    """Loads a robot file and checks it.

    Raises:
        SettingsError: With every problem, each with its line and field.
    """
    return _require(*read_robot(path))


def _require(model: _Model | None, problems: list[SettingsProblem]) -> _Model:
    raise_problems(problems)
    if model is None:
        message = "a file without a problem has no model"
        raise RuntimeError(message)
    return model


def _load(
    families: Families, document: Document, studies: Studies | None, read: RobotReader
) -> tuple[LoadedExperiment | None, list[SettingsProblem]]:
    refuse_other_settings(document.path, document.data, "experiment")
    document, unversioned = of_known_version(document)
    document, miscounted = counted_from_zero(document)
    experiment, left_out, problems = _validated(families, document, Any if studies is None else studies.settings)
    robot, robot_problems = _named_robot(document, read)
    problems = [*unversioned, *miscounted, *problems]
    if experiment is not None:
        names = names_of(robot, robot_problems) if robot is not None else set()
        known = sketch(robot) if robot is not None and robot_problems else robot
        experiment = experiment if known is None else with_sides(experiment, known)
        problems += untouched(check_experiment(document, experiment, known, families, studies), left_out, names)
    problems = [*problems, *robot_problems]
    if problems or experiment is None or robot is None:
        return None, problems
    return LoadedExperiment(document.path, experiment, robot, families), []


def _validated(
    families: Families,
    document: Document,
    study: Any,  # noqa: ANN401
) -> tuple[Experiment | None, list[LeftOut], list[SettingsProblem]]:
    """Builds the settings with the families that the file names: building all takes longer than reading it.

    What is wrong is left out of them, for checks of the rest, and told.
    """
    fits = document.data.get("fits")
    written = [fit.get("family") for fit in fits.values() if isinstance(fit, dict)] if isinstance(fits, dict) else []
    is_known = all(name in list(families) for name in written)
    named = {name: family for name, family in families.items() if name in written or not is_known}
    with suppress(ValidationError):
        return experiment_type(named, study).model_validate(document.data), [], []
    # What is wrong is said with everything that could stand there.
    every = experiment_type(families, study)
    _, problems = validate_document(every, document)
    return *sound_part(every, document), problems


def _named_robot(document: Document, read: RobotReader) -> tuple[RobotFile | None, list[SettingsProblem]]:
    name = document.data.get("robot")
    if name is None:
        return UnknownRobot(name=str(document.data.get("name"))), []
    if not isinstance(name, str):
        return None, []
    try:
        return read(document.path.parent / name)
    except SettingsError as error:
        where = f"{error.where}: " if error.where else ""
        return None, [problem_at(document, ("robot",), f"{where}{error.what}; {error.remedy}")]


def _checked_robot(document: Document) -> tuple[RobotFile | None, list[SettingsProblem]]:
    refuse_other_settings(document.path, document.data, "robot")
    document, unversioned = of_known_version(document)
    robot, problems = _checked_model(document)
    return robot, [*unversioned, *problems]


def _checked_model(document: Document) -> tuple[RobotFile | None, list[SettingsProblem]]:
    robot, problems = validate_document(RobotFile, document)
    left_out: list[LeftOut] = []
    lacking: list[SettingsProblem] = []
    if robot is None:
        lacking = missing_keys(document)
        robot, left_out = sound_part(RobotFile, document)
    beyond = [problem_at(document, field, message) for field, message in absurd(document.data)]
    if robot is None or beyond:
        return None, [*problems, *lacking, *beyond]
    completed, found = _completed(document, robot)
    problems = [*problems, *untouched(found, left_out)]
    told = {problem.path for problem in problems} | mistyped(problems)
    return completed, [*problems, *(problem for problem in lacking if problem.path not in told)]


def _completed(document: Document, robot: RobotFile) -> tuple[RobotFile, list[SettingsProblem]]:
    """Completes a robot from its model, if it names one, and checks it."""
    if robot.model is None:
        return robot, check_robot(document, robot, {})
    from robid.settings.foreign import complete

    completed = complete(document, robot)
    found = [*completed.problems, *check_robot(document, completed.robot, completed.immobile)]
    return completed.robot, found
