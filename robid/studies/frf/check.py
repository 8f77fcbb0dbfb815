"""What must hold between a study of estimators of responses and its campaign."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.campaign_check import campaign_problem
from robid.studies.settings.study import FrfStudy, choices


def check_frf_study(experiment: Experiment, _robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of estimators of responses."""
    study = experiment.study
    if not isinstance(study, FrfStudy):
        return
    message = campaign_problem(experiment, study.campaign)
    if message:
        yield ("study", "campaign"), message
    else:
        yield from _check_groups(study, experiment.campaigns[study.campaign])
    yield from _check_names(study)


def _check_groups(study: FrfStudy, campaign: Campaign) -> Iterator[tuple[FieldPath, str]]:
    if campaign.estimate.friction_fit is not None:
        message = f"the friction of `{study.campaign}` is a fit's, which this study does not compare: name another one"
        yield ("study", "campaign"), message
    if campaign.realizations % study.group or campaign.realizations < 2 * study.group:
        message = (
            f"does not divide the {campaign.realizations} realizations of `{study.campaign}` into groups, two or more"
        )
        yield ("study", "group"), message


def _check_names(study: FrfStudy) -> Iterator[tuple[FieldPath, str]]:
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
