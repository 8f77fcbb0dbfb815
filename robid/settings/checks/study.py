"""What must hold between a study and the experiment around it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robid.settings.checks.design_study import check_design_study
from robid.settings.checks.mistakes import check_mistakes
from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.study import FrfStudy, MistakesStudy, WernholtStudy, ZimmermannStudy, choices
from robid.settings.yaml import FieldPath


def check_study(
    experiment: Experiment, robot: RobotFile | None, count: Callable[[Experiment, Campaign], int | None]
) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with the study, if there is one.

    Args:
        experiment: The experiment.
        robot: The robot file, where it could be read.
        count: Tells how many configurations a campaign has, None where that is unknown.
    """
    study = experiment.study
    if study is None:
        return
    if isinstance(study, ZimmermannStudy):
        yield from check_design_study(experiment, study, robot, count)
        return
    if isinstance(study, MistakesStudy):
        yield from check_mistakes(experiment, study, robot)
        return
    campaign = experiment.campaigns.get(study.campaign)
    if campaign is None:
        message = f"there is no campaign `{study.campaign}`; {suggest(study.campaign, experiment.campaigns)}"
        yield ("study", "campaign"), message
    elif campaign.source is None or campaign.source.simulate is None:
        yield ("study", "campaign"), f"campaign `{study.campaign}` is not simulated, so its true response is not known"
    elif isinstance(study, FrfStudy):
        yield from _check_groups(study, campaign)
    yield from _check_frf(study) if isinstance(study, FrfStudy) else _check_wernholt(study)


def _check_groups(study: FrfStudy, campaign: Campaign) -> Iterator[tuple[FieldPath, str]]:
    if campaign.realizations % study.group or campaign.realizations < 2 * study.group:
        message = (
            f"does not divide the {campaign.realizations} realizations of `{study.campaign}` into groups, two or more"
        )
        yield ("study", "group"), message


def _check_frf(study: FrfStudy) -> Iterator[tuple[FieldPath, str]]:
    for key, known, named in (
        ("estimators", choices("estimator"), study.estimators or ()),
        ("compensations", choices("compensation"), study.compensations or ()),
    ):
        for index, name in enumerate(named):
            if name not in known:
                yield ("study", key, index), f"there is no `{name}`; {suggest(name, known)}"
            elif name in named[:index]:
                yield ("study", key, index), f"`{name}` is there twice"
    if study.reference_estimator not in choices("estimator"):
        message = (
            f"there is no `{study.reference_estimator}`; {suggest(study.reference_estimator, choices('estimator'))}"
        )
        yield ("study", "reference_estimator"), message


def _check_wernholt(study: WernholtStudy) -> Iterator[tuple[FieldPath, str]]:
    if study.reference not in study.estimators:
        yield ("study", "reference"), f"there is no `{study.reference}`; {suggest(study.reference, study.estimators)}"
    elif study.estimators[study.reference].configurations != "all":
        yield ("study", "reference"), f"`{study.reference}` does not use all configurations"
    for index, name in enumerate(study.wide):
        if name not in study.estimators:
            yield ("study", "wide", index), f"there is no `{name}`; {suggest(name, study.estimators)}"
        elif name in study.wide[:index]:
            yield ("study", "wide", index), f"`{name}` is there twice"
