"""What must hold between a study and the experiment around it."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.study import choices
from robid.settings.yaml import FieldPath


def check_study(experiment: Experiment) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with the study, if there is one."""
    study = experiment.study
    if study is None:
        return
    campaign = experiment.campaigns.get(study.campaign)
    if campaign is None:
        message = f"there is no campaign `{study.campaign}`; {suggest(study.campaign, experiment.campaigns)}"
        yield ("study", "campaign"), message
    elif campaign.source is None or campaign.source.simulate is None:
        yield ("study", "campaign"), f"campaign `{study.campaign}` is not simulated, so its true response is not known"
    elif campaign.realizations % study.group or campaign.realizations < 2 * study.group:
        message = (
            f"does not divide the {campaign.realizations} realizations of `{study.campaign}` into groups, two or more"
        )
        yield ("study", "group"), message
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
