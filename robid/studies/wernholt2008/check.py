"""What must hold between a study of parameter estimators and its campaign."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.campaign_check import campaign_problem
from robid.studies.settings.study import WernholtStudy


def check_wernholt2008(experiment: Experiment, _robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of parameter estimators."""
    study = experiment.study
    if not isinstance(study, WernholtStudy):
        return
    message = campaign_problem(experiment, study.campaign)
    if message:
        yield ("study", "campaign"), message
    for index, name in enumerate(study.individuals):
        if message := campaign_problem(experiment, name):
            yield ("study", "individuals", index), message
        elif name in study.individuals[:index]:
            yield ("study", "individuals", index), f"`{name}` is there twice"
    for _, message in _problems(study, (study.reference,)):
        yield ("study", "reference"), message
    for index, message in _problems(study, study.wide, alone=True):
        yield ("study", "wide", index), message
    for index, message in _problems(study, study.individual_estimators):
        yield ("study", "individual_estimators", index), message


def _problems(study: WernholtStudy, names: tuple[str, ...], *, alone: bool = False) -> Iterator[tuple[int, str]]:
    """Yields what is wrong with names of estimators; only with `alone` may they use one configuration."""
    for index, name in enumerate(names):
        if name not in study.estimators:
            yield index, f"there is no `{name}`; {suggest(name, study.estimators)}"
        elif name in names[:index]:
            yield index, f"`{name}` is there twice"
        elif not alone and study.estimators[name].configurations != "all":
            yield index, f"`{name}` does not use all configurations"
