"""Where an experiment needs limits of the motors that a robot file may leave out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.experiment import Campaign, Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
SPEED, TORQUE = "max_speed_rad_s", "max_torque_nm"


def check_limits(experiment: Experiment, robot: RobotFile) -> _Found:
    """Yields who needs a limit that is missing; logs alone need none."""
    if not robot.is_complete:
        return
    for name, campaign in experiment.campaigns.items():
        if _is_designed(campaign):
            what = "a simulation needs" if campaign.source and campaign.source.simulate else "an excitation is held to"
            yield from missing_limits(("campaigns", name, "source"), what, robot, (SPEED, TORQUE))
    for name, design in experiment.designs.items():
        if design.cost == "travel":
            yield from missing_limits(("designs", name, "cost"), "the time of travel needs", robot, (SPEED,))


def _is_designed(campaign: Campaign) -> bool:
    """Tells whether a campaign's excitation is designed here; one that others played is not."""
    if campaign.source is None or campaign.is_arbitrary:
        return False
    return campaign.source.acquire is None or bool(campaign.source.acquire.references)


def missing_limits(field: FieldPath, what: str, robot: RobotFile, keys: tuple[str, ...]) -> _Found:
    """Yields which of these keys of the motors are missing, after who needs them."""
    places = [
        f"joints[{index}].motor.{key}"
        for index, joint in enumerate(robot.joints)
        for key in keys
        if joint.motor is not None and getattr(joint.motor, key) is None
    ]
    if places:
        yield field, f"{what} the robot file's {', '.join(f'`{place}`' for place in places)}: missing"
