"""What must hold between a study of parameter estimators and its campaign."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.study import WernholtStudy
from robid.settings.yaml import FieldPath
from robid.studies.campaign_check import campaign_problem


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
    if study.reference not in study.estimators:
        yield ("study", "reference"), f"there is no `{study.reference}`; {suggest(study.reference, study.estimators)}"
    elif study.estimators[study.reference].configurations != "all":
        yield ("study", "reference"), f"`{study.reference}` does not use all configurations"
    for index, name in enumerate(study.wide):
        if name not in study.estimators:
            yield ("study", "wide", index), f"there is no `{name}`; {suggest(name, study.estimators)}"
        elif name in study.wide[:index]:
            yield ("study", "wide", index), f"`{name}` is there twice"
