"""Names of the parameters that an elastic fit of a robot file has."""

from __future__ import annotations

from collections.abc import Iterable

from robid.robot.description import LOCATED
from robid.settings.robot import RobotFile


def parameter_names(robot: RobotFile, kinds: Iterable[str]) -> list[str]:
    """Returns the name of every parameter of these kinds that an elastic fit of this robot has."""
    return list(kinds_by_name(robot, kinds))


def kinds_by_name(robot: RobotFile, kinds: Iterable[str]) -> dict[str, str]:
    """Returns every parameter of these kinds with its kind; shifts along an axis too, which have no effect."""
    springs, joints = robot.all_springs, [joint.name for joint in robot.joints]
    found: dict[str, str] = {}
    for kind in kinds:
        owners = [spring.name for spring in springs] if kind in ("stiffness", "damping") else joints
        if kind == "cubic":
            owners = [spring.name for spring in springs if spring.place == "transmission"]
        if kind == "location":
            owners = [f"{s.name}.location_{axis}" for s in springs if s.place in LOCATED for axis in "xyz"]
        names = owners if kind == "location" else [f"{owner}.{kind}" for owner in owners]
        found |= dict.fromkeys(["delay"] if kind == "delay" else names, kind)
    return found
