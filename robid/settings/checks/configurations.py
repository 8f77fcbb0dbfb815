"""Configurations of a campaign: cycles, reach, and angles that look as if they were in another unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from math import comb

from robid.settings.experiment import Campaign, Configurations, Experiment
from robid.settings.problems import Found
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection
from robid.settings.yaml import FieldPath

_LIMIT_TOLERANCE = 1e-9


def configuration_count(experiment: Experiment, campaign: Campaign) -> int | None:
    """Returns the number of a campaign's configurations, None where its design is unknown; of logs without any 1."""
    if campaign.configurations is None:
        return 1 if campaign.is_one_shot or experiment.robot is None else None
    return count_of(experiment, campaign.configurations)


def count_of(experiment: Experiment, chosen: Configurations) -> int | None:
    """Returns the number of configurations that a choice makes, None where its design is unknown."""
    if chosen.list_rows is not None:
        return len(chosen.list_rows)
    if chosen.grid_rows is not None:
        return math.prod(len(row) for row in chosen.grid_rows)
    if chosen.random is not None:
        return chosen.random.count
    if chosen.join is not None:
        parts = [count_of(experiment, part) for part in chosen.join]
        return None if None in parts else sum(part or 0 for part in parts)
    designs = [experiment.designs.get(name) for name in chosen.designs]
    return None if None in designs else sum(0 if design is None else design.count for design in designs)


def check_cycles(experiment: Experiment) -> Found:
    """Follows each campaign to the campaigns that its designs read; a cycle is told once, at its first name."""
    for start in experiment.campaigns:
        trail = _way_back(experiment, start, (start,))
        if trail is not None and start == min(trail):
            message = f"S168 campaigns and designs go in a circle: {' -> '.join([*trail, start])}"
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


def named_designs(field: FieldPath, chosen: Configurations) -> Found:
    """Yields every place where a design is named, and its name."""
    if isinstance(chosen.chosen_by, str):
        yield (*field, "from"), chosen.chosen_by
    elif chosen.chosen_by is not None:
        yield from (((*field, "from", index), name) for index, name in enumerate(chosen.chosen_by))
    if chosen.mirror is not None:
        yield (*field, "mirror"), chosen.mirror
    for index, part in enumerate(chosen.join or ()):
        yield from named_designs((*field, "join", index), part)


def check_reachable(field: FieldPath, chosen: Configurations, robot: RobotFile) -> Found:
    """Yields listed angles beyond the joint limits, and lists of another length than the robot has joints."""
    n_joint = len(robot.joints)
    for index, part in enumerate(chosen.join or ()):
        yield from check_reachable((*field, "join", index), part, robot)
    if any(robot.slides) and chosen.key in ("list_deg", "grid_deg"):
        plain = chosen.key.removesuffix("_deg")
        yield (*field, chosen.key), f"S169 the robot has prismatic joints: write `{plain}`, with metres for these"
        return
    for index, row in enumerate(chosen.list_rows or ()):
        if len(row) != n_joint:
            what = "positions" if any(robot.slides) else "angles"
            yield (*field, chosen.key, index), f"S170 has {len(row)} {what} for the {n_joint} joints of the robot"
            continue
        for joint, position in enumerate(row):
            yield from _within((*field, chosen.key, index, joint), robot, joint, position)
    if chosen.grid_rows is not None and len(chosen.grid_rows) != n_joint:
        yield (*field, chosen.key), f"S171 has {len(chosen.grid_rows)} rows for the {n_joint} joints of the robot"
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
                yield (*field, "random", key), f"S172 leaves nothing of the range of joint `{section.name}`, {reach}"


def _within(field: FieldPath, robot: RobotFile, joint: int, position: float) -> Found:
    section = robot.joints[joint]
    if section.stated_limits is None:
        return
    lower, upper = section.stated_limits
    if not lower - _LIMIT_TOLERANCE <= position <= upper + _LIMIT_TOLERANCE:
        unit = section.limits_unit
        told = f"joint `{section.name}` moves from {lower:g} to {upper:g} {unit}"
        yield field, f"S173 {position:g} {unit} is unreachable: {told}"


_TURN = 2 * math.pi
_ROUND = (math.pi / 2, math.pi / 12, math.pi / 36)  # 90, 15 and 5 degrees
_CHANCE = 1e-2  # that so many numbers are whole parts of a turn by chance
_FEWEST = 4  # numbers without such parts that tell something
_LARGE = 0.5
_QUARTERS = 4  # of a degree: numbers that somebody writes who means degrees
_FRACTIONS = 0.75  # of the numbers
_MOST_DECIMALS = 12
_WIDE_DEG = 60.0
_FASTEST_RAD_S = 1500.0  # of motors
_USUAL_RAD_S = 1100.0
_FASTEST_ARM_RAD_S = 60.0
_USUAL_ARM_RAD_S = 40.0
_GEARED = 20.0
_SPEEDS = (("rpm", math.pi / 30), ("deg/s", math.pi / 180))


def other_units(experiment: Experiment, robot: RobotFile) -> list[str]:
    """Returns a sentence for each value that looks like one of another unit, with what it would be."""
    found = [text for name, campaign in experiment.campaigns.items() for text in _angles(name, campaign, robot)]
    return [*found, *_limits(robot), *_speeds(robot)]


def _angles(name: str, campaign: Campaign, robot: RobotFile) -> Iterator[str]:
    for chosen in _parts(campaign.configurations):
        listed, grid = chosen.list_rows, chosen.grid_rows
        # The rows of a grid are joints, those of a list are configurations.
        columns = tuple(zip(*listed, strict=True)) if listed else grid
        if not columns or len(columns) != len(robot.joints):
            continue
        wide = [own for own, joint in zip(columns, robot.joints, strict=True) if _is_wide(joint)]
        example = _radians([value for own in wide for value in own])
        if example is not None:
            yield f"campaigns.{name}.configurations.{chosen.key}: {_told(example)}"


def _parts(chosen: Configurations | None) -> Iterator[Configurations]:
    """A choice of configurations and what it joins."""
    if chosen is not None:
        yield chosen
        for part in chosen.join or ():
            yield from _parts(part)


def _limits(robot: RobotFile) -> Iterator[str]:
    stated = [limit for joint in robot.joints for limit in joint.limits_deg or () if not joint.slides]
    example = _radians(stated) if len(stated) == 2 * sum(not joint.slides for joint in robot.joints) else None
    if example is not None:
        yield f"{robot.name}: joints.limits_deg: {_told(example)}"


def _told(value: float) -> str:
    return (
        f"S581 {value:g} looks like radians, but is taken for degrees: {value:g} rad are {math.degrees(value):.5g} deg"
    )


def _is_wide(joint: JointSection) -> bool:
    """Whether a joint turns so far that numbers below two pi would be a small part of it."""
    if joint.slides or joint.stated_limits is None:
        return False
    return joint.stated_limits[1] - joint.stated_limits[0] > _WIDE_DEG


def _radians(values: Sequence[float]) -> float | None:
    """The number that shows best that degrees are radians; None where they are not, or nothing shows it.

    Radians lie within two pi. Those that somebody writes are parts of a turn, rounded to some digits, more of them than
    chance gives; or all of them have fractions that nobody writes who means degrees.
    """
    told = sorted((value for value in values if value != 0), key=abs, reverse=True)
    if not told or abs(told[0]) > _TURN * 1.001:
        return None
    for part in _ROUND:
        chances = {value: _chance(value, part) for value in told}
        meeting = [value for value, chance in chances.items() if chance is not None]
        chance = comb(len(chances), len(meeting)) * math.prod(chances[value] or 1.0 for value in meeting)
        if meeting and 2 * len(meeting) >= len(chances) and chance < _CHANCE:
            return meeting[0]
    odd = [value for value in told if _QUARTERS * value % 1]
    if len(odd) >= max(_FEWEST, _FRACTIONS * len(told)) and abs(told[0]) > _LARGE:
        return odd[0]
    return None


def _chance(value: float, part: float) -> float | None:
    """Chance that a number of as many decimals is a whole multiple of a part of a turn; None where it is none."""
    text = repr(float(value))
    decimals = 0 if "e" in text else min(len(text.partition(".")[2].rstrip("0")), _MOST_DECIMALS)
    reach = 0.6 * 10.0**-decimals
    off = abs(value - part * round(value / part))
    return 2 * reach / part if decimals >= 2 and round(value / part) and off <= reach else None


def _speeds(robot: RobotFile) -> Iterator[str]:
    """Speed limits in rad/s that no motor or arm has, and that another unit would make usual."""
    for index, joint in enumerate(robot.joints):
        speed = None if joint.motor is None else joint.motor.max_speed_rad_s
        ratio = abs(joint.motor.ratio or 1.0) if joint.motor is not None else 1.0
        if speed is None:
            continue
        # Without a gear, or along a line, nothing is known of how fast an arm may be.
        geared = not joint.slides and ratio >= _GEARED
        fits = [
            (unit, factor)
            for unit, factor in _SPEEDS
            if speed * factor <= _USUAL_RAD_S and not (geared and speed * factor / ratio > _USUAL_ARM_RAD_S)
        ]
        if fits and (speed > _FASTEST_RAD_S or (geared and speed / ratio > _FASTEST_ARM_RAD_S)):
            unit, factor = fits[0]
            turns = speed * 30 / math.pi
            yield (
                f"{robot.name}: joints[{index + 1}].motor.max_speed_rad_s: {speed:g} rad/s is {turns:.3g} rpm,"
                f" more than motors of robots turn; {speed:g} {unit} would be {speed * factor:.4g} rad/s"
            )
