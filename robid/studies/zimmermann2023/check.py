"""What must hold between a study of designs and the campaigns of its pairs."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.checks.configurations import configuration_count
from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.simulate.options import SimulateOptions
from robid.studies.settings.study import ZimmermannStudy


def check_zimmermann2023(experiment: Experiment, robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of designs."""
    study = experiment.study
    if not isinstance(study, ZimmermannStudy):
        return
    unusable: list[tuple[FieldPath, str]] = [
        (("study", key, index), message)
        for key, names in (("estimation", study.estimation), ("validation", study.validation))
        for index, name in enumerate(names)
        if (message := _unusable(experiment, name))
    ]
    yield from unusable
    yield from _check_names(experiment, study, robot)
    if len(study.validation) != len(study.estimation):
        message = f"has {len(study.validation)} campaigns for the {len(study.estimation)} of `estimation`: one for each"
        yield ("study", "validation"), message
    elif not unusable:
        yield from _check_pairs(experiment, study)
    if not unusable:
        yield from _check_configurations(
            study, configuration_count(experiment, experiment.campaigns[study.estimation[0]])
        )


def _unusable(experiment: Experiment, name: str) -> str:
    campaign = experiment.campaigns.get(name)
    if campaign is None:
        return f"there is no campaign `{name}`; {suggest(name, experiment.campaigns)}"
    return "" if _simulated(campaign) else f"campaign `{name}` is not simulated, so its true robot is not known"


def _simulated(campaign: Campaign) -> SimulateOptions | None:
    return None if campaign.source is None else campaign.source.simulate


def _check_pairs(experiment: Experiment, study: ZimmermannStudy) -> Iterator[tuple[FieldPath, str]]:
    first = experiment.campaigns[study.estimation[0]]
    for key, names in (("estimation", study.estimation), ("validation", study.validation)):
        for index, name in enumerate(names):
            if experiment.campaigns[name].configurations != first.configurations:
                message = f"`{name}` has other configurations than `{study.estimation[0]}`"
                yield ("study", key, index), message
    for index, pair in enumerate(zip(study.estimation, study.validation, strict=True)):
        own, other = (_simulated(experiment.campaigns[name]) for name in pair)
        if own is not None and other is not None and own.truth != other.truth:
            message = f"`{pair[1]}` simulates another individual than `{pair[0]}`: give both the same `truth`"
            yield ("study", "validation", index), message


def _check_names(
    experiment: Experiment, study: ZimmermannStudy, robot: RobotFile | None
) -> Iterator[tuple[FieldPath, str]]:
    if study.design not in experiment.designs:
        message = f"there is no design `{study.design}`; {suggest(study.design, experiment.designs)}"
        yield ("study", "design"), message
    roles: list[tuple[FieldPath, str | None]] = [
        ((key,), getattr(study, key)) for key in ("reference", "optimal", "guess", "nonlinear")
    ]
    roles += [(("stepped", index), name) for index, name in enumerate(study.stepped)]
    for place, name in roles:
        if name is not None and name not in study.models:
            yield ("study", *place), f"there is no model `{name}`; {suggest(name, study.models)}"
    joints = [] if robot is None else [joint.name for joint in robot.joints]
    asked: list[tuple[FieldPath, str | None]] = [
        (("models", name, "low_torque"), choice.low_torque) for name, choice in study.models.items()
    ]
    asked += [(("axes", index), joint) for index, joint in enumerate(study.axes)]
    for place, joint in asked:
        if robot is not None and joint is not None and joint not in joints:
            yield ("study", *place), f"there is no joint `{joint}`; {suggest(joint, joints)}"


def _check_configurations(study: ZimmermannStudy, n_conf: int | None) -> Iterator[tuple[FieldPath, str]]:
    for name, model in study.models.items():
        field = ("study", "models", name)
        for index, chosen in enumerate(model.configurations or ()):
            if n_conf is not None and chosen >= n_conf:
                yield (*field, "configurations", index), f"there are {n_conf} configurations, numbered from 0"
        there = n_conf if model.configurations is None else len(model.configurations)
        if model.count is not None and there is not None and model.count > there:
            yield (*field, "count"), f"cannot take {model.count} of {there} configurations"
