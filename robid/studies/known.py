"""The studies that there are, known to the commands by this list alone, and experiment files that may have one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from robid.models.known import load_experiment
from robid.settings.checks.experiment import Studies
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.fleet import FLEET
from robid.studies.frf import FRF_STUDY
from robid.studies.janot2009 import JANOT2009
from robid.studies.mistakes import MISTAKES
from robid.studies.oliveira2019 import OLIVEIRA2019
from robid.studies.settings.study import Study as StudySettings
from robid.studies.study import Study
from robid.studies.trust import TRUST
from robid.studies.turk2018 import TURK2018
from robid.studies.wernholt2008 import WERNHOLT2008
from robid.studies.zimmermann2023 import ZIMMERMANN2023

STUDIES: Mapping[str, Study] = {
    "frf": FRF_STUDY,
    "wernholt2008": WERNHOLT2008,
    "zimmermann2023": ZIMMERMANN2023,
    "mistakes": MISTAKES,
    "janot2009": JANOT2009,
    "oliveira2019": OLIVEIRA2019,
    "turk2018": TURK2018,
    "trust": TRUST,
    "fleet": FLEET,
}


def load_with_study(path: Path) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, and checks both, with the study where there is one.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    return load_experiment(path, studies=Studies(StudySettings, check_study))


def check_study(experiment: Experiment, robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with the study, if there is one.

    Args:
        experiment: The experiment.
        robot: The robot file, where it could be read.
    """
    if experiment.study is not None:
        yield from STUDIES[experiment.study.kind].check(experiment, robot)
