"""Loading an experiment file together with its robot file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from robid.errors import SettingsError
from robid.settings.checks.experiment import StudyCheck, check_experiment
from robid.settings.checks.robot import check_robot
from robid.settings.checks.robot_missing import missing_keys
from robid.settings.experiment import Experiment, experiment_type
from robid.settings.fits import Families
from robid.settings.plain import plain_settings
from robid.settings.problems import SettingsProblem, problem_at, raise_problems, validate_document
from robid.settings.robot import RobotFile, UnknownRobot
from robid.settings.yaml import Document, load_yaml


@dataclass(frozen=True)
class LoadedExperiment:
    """An experiment and its robot, checked.

    Attributes:
        path: The experiment file, as the user named it.
        experiment: The experiment.
        robot: The robot file; without joints where there is none.
        families: The families of its fits, by name.
    """

    path: Path
    experiment: Experiment
    robot: RobotFile
    families: Families

    @property
    def robot_path(self) -> Path | None:
        """The robot file, None where there is none."""
        return None if self.experiment.robot is None else self.path.parent / self.experiment.robot

    @cached_property
    def plain(self) -> dict[str, Any]:
        """The experiment as values that JSON knows, with the whole robot file as its `robot`; not to be changed."""
        return {**plain_settings(self.experiment), "robot": plain_settings(self.robot)}


def load_experiment_of(families: Families, path: Path, check_study: StudyCheck | None = None) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, if it names one, and checks both.

    Args:
        families: The families that its fits may be of, by name.
        path: The experiment file.
        check_study: Finds what is wrong with the study for the robot, where that could be read; studies lie above.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    document = load_yaml(path)
    experiment, problems = validate_document(experiment_type(families), document)
    robot, robot_problems = _named_robot(document)
    if experiment is not None:
        problems += check_experiment(document, experiment, None if robot_problems else robot, families, check_study)
    raise_problems([*problems, *robot_problems])
    if experiment is None or robot is None:
        message = "a file without a problem has no model"
        raise RuntimeError(message)
    return LoadedExperiment(path, experiment, robot, families)


def load_robot(path: Path) -> RobotFile:
    """Loads a robot file and checks it.

    Raises:
        SettingsError: With every problem, each with its line and field.
    """
    robot, problems = _checked_robot(load_yaml(path))
    raise_problems(problems)
    if robot is None:
        message = "a file without a problem has no model"
        raise RuntimeError(message)
    return robot


def _named_robot(document: Document) -> tuple[RobotFile | None, list[SettingsProblem]]:
    if "robot" not in document.data:
        return UnknownRobot(name=str(document.data.get("name"))), []
    name = document.data["robot"]
    if not isinstance(name, str):
        return None, []
    try:
        robot = load_yaml(document.path.parent / name)
    except SettingsError as error:
        where = f"{error.where}: " if error.where else ""
        return None, [problem_at(document, ("robot",), f"{where}{error.what}; {error.remedy}")]
    return _checked_robot(robot)


def _checked_robot(document: Document) -> tuple[RobotFile | None, list[SettingsProblem]]:
    robot, problems = validate_document(RobotFile, document)
    if robot is None:
        return None, [*problems, *missing_keys(document)]
    if robot.model is None:
        return robot, check_robot(document, robot, {})
    from robid.settings.foreign import complete

    completed = complete(document, robot)
    return completed.robot, [*completed.problems, *check_robot(document, completed.robot, completed.immobile)]
