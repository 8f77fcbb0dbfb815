"""Experiment files that may have a study, and what must hold between each kind of study and the rest of its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robid.models.known import load_experiment
from robid.settings.checks.experiment import Studies
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.studies.experiments import Problems
from robid.studies.settings.elastic import check_wernholt2008, check_zimmermann2023
from robid.studies.settings.mistakes import check_mistakes
from robid.studies.settings.parts import check_janot2009, check_oliveira2019, check_turk2018
from robid.studies.settings.study import Study, check_fleet, check_frf_study
from robid.studies.trust.individuals import check_trust

_CHECKS: Mapping[str, Callable[[Any, Experiment, RobotFile | None], Problems]] = {
    "frf": check_frf_study,
    "wernholt2008": check_wernholt2008,
    "zimmermann2023": check_zimmermann2023,
    "mistakes": check_mistakes,
    "janot2009": check_janot2009,
    "oliveira2019": check_oliveira2019,
    "turk2018": check_turk2018,
    "trust": check_trust,
    "fleet": check_fleet,
}


def load_with_study(path: Path) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, and checks both, with the study where there is one.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    return load_experiment(path, studies=Studies(Study, _check_study))


def _check_study(experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields what is wrong with the study, if there is one; the robot file is None where it could not be read."""
    study = experiment.study
    if study is not None:
        yield from _CHECKS[study.kind](study, experiment, robot)
