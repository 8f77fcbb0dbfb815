"""What must hold between a study of trust and the experiment around it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from pydantic import ValidationError

from robid.results.doubt import CAUSES
from robid.settings.checks.campaigns import check_truth
from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.changed import changed_simulation
from robid.studies.mistakes.check import fit_problem
from robid.studies.settings.trust import TrustStudy
from robid.studies.trust.individuals import Individual, individuals

_Found = Iterator[tuple[FieldPath, str]]


def check_trust(experiment: Experiment, robot: RobotFile | None) -> _Found:
    """Yields the field and the message of everything that is wrong with a study of trust."""
    study = experiment.study
    if not isinstance(study, TrustStudy):
        return
    for place, message in experiment_problems(experiment, study):
        yield ("study", *place), message
    yield from _check_groups(study)
    yield from _check_seeds(study)
    if not any(experiment_problems(experiment, study)):
        campaign = experiment.campaigns[experiment.fits[study.fit].campaign]
        yield from physics_problems(study, "heavy", campaign, robot)


def experiment_problems(experiment: Experiment, study: TrustStudy) -> _Found:
    """Yields why the campaigns of an experiment, the light one's too, cannot be those of the study."""
    message = fit_problem(experiment, study.fit)
    if message:
        yield ("fit",), message
        return
    fit = experiment.fits[study.fit]
    for name, least in ((fit.campaign, 1), (str(fit.validate_on), study.validated_in)):
        chosen = experiment.campaigns[name].configurations
        if chosen is None or chosen.random is None:
            yield ("fit",), f"campaign `{name}` needs `random` configurations: each robot's places are drawn anew"
        elif chosen.random.count < least:
            yield ("validated_in",), f"campaign `{name}` has {chosen.random.count} places only"
    if study.designed is None:
        return
    designed = experiment.campaigns.get(study.designed)
    if designed is None:
        message = f"there is no campaign `{study.designed}`; {suggest(study.designed, experiment.campaigns)}"
        yield ("designed",), message
    elif designed.source is None or designed.source.simulate is None:
        yield ("designed",), f"campaign `{study.designed}` is not simulated"


def physics_problems(study: TrustStudy, robot_name: str, campaign: Campaign, robot: RobotFile | None) -> _Found:
    """Yields what sets and causes name that a robot or its simulation does not have."""
    seen: set[str] = set()
    for one in individuals(study):
        if one.robot != robot_name or one.kind == "linear" or one.group in seen:
            continue
        seen.add(one.group)
        field = ("study", "sets" if one.kind == "set" else "causes", one.group)
        yield from (((*field, *place), message) for place, message in _physics(one, campaign, robot))


def _physics(one: Individual, campaign: Campaign, robot: RobotFile | None) -> _Found:
    try:
        changed = changed_simulation(campaign, one.physics)
    except ValidationError as error:
        yield from (((*each["loc"][1:3],), each["msg"]) for each in error.errors())
        return
    if robot is not None:
        yield from check_truth((), campaign, changed, robot)


def _check_groups(study: TrustStudy) -> _Found:
    for name, defects in study.sets.items():
        field = ("study", "sets", name)
        if defects.robot == "light" and study.light is None:
            yield (*field, "robot"), "the study has no `light` robot"
        if defects.referenced > defects.robots:
            yield (*field, "referenced"), f"the set has {defects.robots} robots only"
        if defects.springs_each > len(defects.springs):
            yield (*field, "springs_each"), f"there are {len(defects.springs)} springs to draw from"
    for name, kind in study.causes.items():
        field = ("study", "causes", name)
        if name in study.sets:
            yield field, "a set has this name too"
        for index, cause in enumerate(kind.named):
            if cause not in CAUSES:
                yield (*field, "named", index), f"there is no cause `{cause}`; {suggest(cause, CAUSES)}"


def _check_seeds(study: TrustStudy) -> _Found:
    ends = _end(study, "judge"), _end(study, "choose")
    judge, choose = study.seeds.judge.first, study.seeds.choose.first
    if max(judge, choose) < min(ends):
        yield ("study", "seeds"), "the seeds of `judge` and `choose` overlap"


def _end(study: TrustStudy, use: Literal["judge", "choose"]) -> int:
    found = individuals(study.model_copy(update={"use": use}))
    return max((one.seed for one in found), default=0) + 1
