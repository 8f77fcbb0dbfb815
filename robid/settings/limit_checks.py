"""Where an experiment needs limits of the motors that a robot file may leave out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.experiment import Campaign, Experiment, Fit
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_SPEED, _TORQUE = "max_speed_rad_s", "max_torque_nm"


def check_limits(experiment: Experiment, robot: RobotFile) -> _Found:
    """Yields who needs a limit that is missing; logs alone need none."""
    if not robot.is_complete:
        return
    for name, campaign in experiment.campaigns.items():
        if _is_designed(campaign):
            what = "a simulation needs" if campaign.source and campaign.source.simulate else "an excitation is held to"
            yield from _missing(("campaigns", name, "source"), what, robot, (_SPEED, _TORQUE))
    for name, design in experiment.designs.items():
        if design.cost == "travel":
            yield from _missing(("designs", name, "cost"), "the time of travel needs", robot, (_SPEED,))
    for name, fit in experiment.fits.items():
        if _frees_cubic(fit):
            yield from _missing(("fits", name, "free"), "the scale of `cubic` needs", robot, (_TORQUE,))


def _is_designed(campaign: Campaign) -> bool:
    """Tells whether a campaign's excitation is designed here; one that others played is not."""
    if campaign.source is None:
        return False
    return campaign.source.acquire is None or bool(campaign.source.acquire.references)


def _frees_cubic(fit: Fit) -> bool:
    return "cubic" in fit.free


def _missing(field: FieldPath, what: str, robot: RobotFile, keys: tuple[str, ...]) -> _Found:
    places = [
        f"joints[{index}].motor.{key}"
        for index, joint in enumerate(robot.joints)
        for key in keys
        if getattr(joint.motor, key) is None
    ]
    if places:
        yield field, f"{what} the robot file's {', '.join(f'`{place}`' for place in places)}: missing"
