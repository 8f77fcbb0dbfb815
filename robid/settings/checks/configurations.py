"""What must hold of the configurations of campaigns: angles within the limits, designs that are there, no circles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from robid.settings.experiment import Campaign, Configurations, Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_LIMIT_TOLERANCE = 1e-9


def configuration_count(experiment: Experiment, campaign: Campaign) -> int | None:
    """Returns the number of a campaign's configurations, None where its design is unknown; of logs without any 1."""
    if campaign.configurations is None:
        return 1 if campaign.is_one_shot or experiment.robot is None else None
    return _count(experiment, campaign.configurations)


def _count(experiment: Experiment, chosen: Configurations) -> int | None:
    if chosen.list_rows is not None:
        return len(chosen.list_rows)
    if chosen.grid_rows is not None:
        return int(np.prod([len(row) for row in chosen.grid_rows]))
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
    for chooser in () if campaign is None else campaign.designs:
        design = experiment.designs.get(chooser)
        if design is not None:
            yield design.campaign
            read = experiment.campaigns.get(design.campaign)
            friction = None if read is None or design.information != "measured" else read.estimate.friction_fit
            for fit in (design.prior, design.between, friction):
                yield from campaigns_of_fit(experiment, fit or "")


def campaigns_of_fit(experiment: Experiment, name: str, seen: tuple[str, ...] = ()) -> Iterator[str]:
    """Yields the campaigns that a fit needs, those of fits that it or a response takes something of too."""
    fit = experiment.fits.get(name)
    if fit is None or name in seen:
        return
    yield from fit.campaigns
    read = [experiment.campaigns[campaign] for campaign in fit.campaigns if campaign in experiment.campaigns]
    for other in (*fit.takes.values(), *(campaign.estimate.friction_fit for campaign in read)):
        yield from campaigns_of_fit(experiment, other or "", (*seen, name))


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
    if any(robot.slides) and chosen.key in ("list_deg", "grid_deg"):
        plain = chosen.key.removesuffix("_deg")
        yield (*field, chosen.key), f"the robot has prismatic joints: write `{plain}`, with metres for these"
        return
    for index, row in enumerate(chosen.list_rows or ()):
        if len(row) != n_joint:
            what = "positions" if any(robot.slides) else "angles"
            yield (*field, chosen.key, index), f"has {len(row)} {what} for the {n_joint} joints of the robot"
            continue
        for joint, position in enumerate(row):
            yield from _within((*field, chosen.key, index, joint), robot, joint, position)
    if chosen.grid_rows is not None and len(chosen.grid_rows) != n_joint:
        yield (*field, chosen.key), f"has {len(chosen.grid_rows)} rows for the {n_joint} joints of the robot"
    elif chosen.grid_rows is not None:
        for joint, row in enumerate(chosen.grid_rows):
            for index, position in enumerate(row):
                yield from _within((*field, chosen.key, joint, index), robot, joint, position)
    if chosen.random is not None:
        for section in robot.joints:
            if section.stated_limits is None:
                continue
            lower, upper = section.stated_limits
            key = "margin_m" if section.slides else "margin_deg"
            if upper - lower < 2 * getattr(chosen.random, key):
                reach = f"{lower:g} to {upper:g} {section.limits_unit}"
                yield (*field, "random", key), f"leaves nothing of the range of joint `{section.name}`, {reach}"


def _within(field: FieldPath, robot: RobotFile, joint: int, position: float) -> _Found:
    section = robot.joints[joint]
    if section.stated_limits is None:
        return
    lower, upper = section.stated_limits
    if not lower - _LIMIT_TOLERANCE <= position <= upper + _LIMIT_TOLERANCE:
        unit = section.limits_unit
        message = f"{position:g} {unit} is unreachable: joint `{section.name}` moves from {lower:g} to {upper:g} {unit}"
        yield field, message
