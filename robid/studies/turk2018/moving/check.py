"""What must hold of the campaigns of a travelling slide."""

from __future__ import annotations

from collections.abc import Iterator

from robid.models.lpv.settings import LpvFit
from robid.settings.experiment import Campaign, Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.campaign_check import campaign_problem
from robid.studies.settings.turk2018 import TravelCase

_Found = Iterator[tuple[FieldPath, str]]
_ARM = ".arm"
_FIELD: FieldPath = ("study", "global")


def check_travel(experiment: Experiment, case: TravelCase, robot: RobotFile | None) -> _Found:
    """Yields what is wrong with the campaigns of a travelling slide and with its scheduling parameter."""
    problems = {key: campaign_problem(experiment, name) for key, name in _named(case)}
    yield from (((*_FIELD, key), problem) for key, problem in problems.items() if problem)
    if robot is not None and len(robot.joints) != 1:
        yield _FIELD, f"is of a drive of one joint; the robot has {len(robot.joints)}"
    if not problems["campaign"]:
        yield from _moving(experiment, case)
    if not problems["fixed"]:
        yield from _standing(experiment.campaigns[case.fixed], case)


def position_output(scheduling: str) -> str:
    """Returns the output that shows a scheduling parameter, which names a joint or that output itself."""
    return scheduling if scheduling.endswith(_ARM) else scheduling + _ARM


def _named(case: TravelCase) -> tuple[tuple[str, str], tuple[str, str]]:
    return ("campaign", case.campaign), ("fixed", case.fixed)


def _moving(experiment: Experiment, case: TravelCase) -> _Found:
    campaign, fit = experiment.campaigns[case.campaign], experiment.fits.get(case.fit)
    field = (*_FIELD, "campaign")
    if not campaign.travels:
        yield field, f"campaign `{case.campaign}` has no `excitation.travel`: nothing moves in it"
    if campaign.periods < 2:
        yield field, f"campaign `{case.campaign}` needs at least 2 periods to tell noise from what repeats"
    if not isinstance(fit, LpvFit):
        return
    if len(fit.scheduling) != 1:
        yield (*_FIELD, "fit"), f"fit `{case.fit}` has {len(fit.scheduling)} scheduling parameters; one can move here"
    elif (output := position_output(fit.scheduling[0])) not in campaign.outputs:
        yield field, f"campaign `{case.campaign}` does not record `{output}`: add it to its `outputs`"


def _standing(campaign: Campaign, case: TravelCase) -> _Found:
    field = (*_FIELD, "fixed")
    if not campaign.has_response:
        yield field, f"campaign `{case.fixed}` has no frequency response"
    if min(campaign.realizations, campaign.periods) < 2:
        yield field, f"campaign `{case.fixed}` needs at least 2 realizations and 2 periods to tell its variances"
