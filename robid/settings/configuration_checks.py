"""What must hold of the configurations of campaigns: angles within the limits, designs that are there, no circles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from robid.settings.experiment import Campaign, Configurations, Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_LIMIT_TOLERANCE_DEG = 1e-9


def configuration_count(experiment: Experiment, campaign: Campaign) -> int | None:
    """Returns the number of a campaign's configurations, None where its design is unknown."""
    return _count(experiment, campaign.configurations)


def _count(experiment: Experiment, chosen: Configurations) -> int | None:
    if chosen.list_deg is not None:
        return len(chosen.list_deg)
    if chosen.grid_deg is not None:
        return int(np.prod([len(row) for row in chosen.grid_deg]))
    if chosen.random is not None:
        return chosen.random.count
    if chosen.join is not None:
        parts = [_count(experiment, part) for part in chosen.join]
        return None if None in parts else sum(part or 0 for part in parts)
    designs = [experiment.designs.get(name) for name in chosen.designs]
    return None if None in designs else sum(0 if design is None else design.count for design in designs)


def check_cycles(experiment: Experiment) -> _Found:
    """Follows each campaign to the campaigns that its designs read; a cycle is told once, at its first name."""
    for start in experiment.campaigns:
        trail = _way_back(experiment, start, (start,))
        if trail is not None and start == min(trail):
            message = f"campaigns and designs go in a circle: {' -> '.join([*trail, start])}"
            yield ("campaigns", start, "configurations", "from"), message


def _way_back(experiment: Experiment, start: str, trail: tuple[str, ...]) -> tuple[str, ...] | None:
    """Continues a trail of campaigns until the next one is its start; None where no way leads there."""
    for following in _campaigns_before(experiment, trail[-1]):
        if following == start:
            return trail
        if following not in trail:
            found = _way_back(experiment, start, (*trail, following))
            if found is not None:
                return found
    return None


def _campaigns_before(experiment: Experiment, name: str) -> Iterator[str]:
    """Campaigns that a campaign's designs read, themselves or through an earlier fit."""
    campaign = experiment.campaigns.get(name)
    for chooser in () if campaign is None else campaign.configurations.designs:
        design = experiment.designs.get(chooser)
        if design is not None:
            yield design.campaign
            fit = experiment.fits.get(design.prior or "")
            yield from () if fit is None else fit.campaigns


def named_designs(field: FieldPath, chosen: Configurations) -> _Found:
    """Yields every place where a design is named, and its name."""
    if isinstance(chosen.chosen_by, str):
        yield (*field, "from"), chosen.chosen_by
    elif chosen.chosen_by is not None:
        yield from (((*field, "from", index), name) for index, name in enumerate(chosen.chosen_by))
    if chosen.mirror is not None:
        yield (*field, "mirror"), chosen.mirror
    for index, part in enumerate(chosen.join or ()):
        yield from named_designs((*field, "join", index), part)


def check_reachable(field: FieldPath, chosen: Configurations, robot: RobotFile) -> _Found:
    """Yields listed angles beyond the joint limits, and lists of another length than the robot has joints."""
    n_joint = len(robot.joints)
    for index, part in enumerate(chosen.join or ()):
        yield from check_reachable((*field, "join", index), part, robot)
    for index, row in enumerate(chosen.list_deg or ()):
        if len(row) != n_joint:
            yield (*field, "list_deg", index), f"has {len(row)} angles for the {n_joint} joints of the robot"
            continue
        for joint, angle in enumerate(row):
            yield from _within((*field, "list_deg", index, joint), robot, joint, angle)
    if chosen.grid_deg is not None and len(chosen.grid_deg) != n_joint:
        yield (*field, "grid_deg"), f"has {len(chosen.grid_deg)} rows for the {n_joint} joints of the robot"
    elif chosen.grid_deg is not None:
        for joint, row in enumerate(chosen.grid_deg):
            for index, angle in enumerate(row):
                yield from _within((*field, "grid_deg", joint, index), robot, joint, angle)
    if chosen.random is not None:
        for section in robot.joints:
            if section.limits_deg is None:
                continue
            lower, upper = section.limits_deg
            if upper - lower < 2 * chosen.random.margin_deg:
                message = f"leaves nothing of the range of joint `{section.name}`, {lower:g} to {upper:g} deg"
                yield (*field, "random", "margin_deg"), message


def _within(field: FieldPath, robot: RobotFile, joint: int, angle: float) -> _Found:
    section = robot.joints[joint]
    if section.limits_deg is None:
        return
    lower, upper = section.limits_deg
    if not lower - _LIMIT_TOLERANCE_DEG <= angle <= upper + _LIMIT_TOLERANCE_DEG:
        message = f"{angle:g} deg is unreachable: joint `{section.name}` moves from {lower:g} to {upper:g} deg"
        yield field, message
