"""Names of the parameters that an elastic fit of a robot file has."""

from __future__ import annotations

from collections.abc import Iterable

from robid.robot.parameters import names_of
from robid.settings.robot import RobotFile


def parameter_names(robot: RobotFile, kinds: Iterable[str]) -> list[str]:
    """Returns the name of every parameter of these kinds that an elastic fit of this robot has."""
    return list(kinds_by_name(robot, kinds))


def kinds_by_name(robot: RobotFile, kinds: Iterable[str]) -> dict[str, str]:
    """Returns every parameter of these kinds with its kind; shifts along an axis too, which have no effect."""
    joints = [joint.name for joint in robot.joints]
    pairs = ((name, kind) for kind in kinds for name in names_of(kind, robot.all_springs, joints))
    return {name: kind for name, kind in pairs if name is not None}
