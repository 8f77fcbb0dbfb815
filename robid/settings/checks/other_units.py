"""Values that a file may mean, but that look like numbers of another unit: radians for degrees, rpm for rad/s."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from math import comb

from robid.settings.experiment import Campaign, Configurations, Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection

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
    """Configurations in degrees that look like radians."""
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
    """Limits in degrees that look like radians."""
    stated = [limit for joint in robot.joints for limit in joint.limits_deg or () if not joint.slides]
    example = _radians(stated) if len(stated) == 2 * sum(not joint.slides for joint in robot.joints) else None
    if example is not None:
        yield f"{robot.name}: joints.limits_deg: {_told(example)}"


def _told(value: float) -> str:
    return f"{value:g} looks like radians, but is taken for degrees: {value:g} rad are {math.degrees(value):.5g} deg"


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
                f"{robot.name}: joints[{index}].motor.max_speed_rad_s: {speed:g} rad/s is {turns:.3g} rpm,"
                f" more than motors of robots turn; {speed:g} {unit} would be {speed * factor:.4g} rad/s"
            )
