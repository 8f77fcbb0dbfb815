"""Springs that a robot file may lack: gears, beneath the base, across joints, within links, at the payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.doubts.springs import ALONG, gear_stiffness, is_there, trial_spring
from robid.models.elastic.fit.options import ElasticOptions, spring_of
from robid.robot.description import Inertial, Joint, Robot, Spring

_STIFFER = 3.0  # than the gear nearby: where a trial starts
_RIGID_HZ = 30.0  # where a rotor would swing on a trial gear
_OUTBOARD = 0.6  # share of a link beyond a split


@dataclass(frozen=True)
class FurtherSpring:
    """A spring that a robot file may lack.

    Attributes:
        spring: The spring, as stiff as a trial of it starts; its name frees it.
        title: What it is, for a sentence.
    """

    spring: Spring
    title: str


def with_freed_springs(robot: Robot, options: ElasticOptions) -> Robot:
    """Returns a robot with the springs that a fit frees though the robot file lacks them.

    Args:
        robot: The robot file's robot.
        options: Options of the fit; their names may end as those of the doubts do, on `.compliance`.
    """
    wanted = {spring_of(name) for name in options.freed}
    more = [each.spring for each in further_springs(robot) if each.spring.name in wanted] if wanted else []
    return replace(robot, springs=(*robot.springs, *more)) if more else robot


def is_spring(robot: Robot, name: str) -> bool:
    """Whether a name is that of a spring of the robot, or of one that it may lack."""
    own = {spring.name for spring in robot.springs} | {each.spring.name for each in further_springs(robot)}
    return spring_of(name) in own


def further_springs(robot: Robot) -> Iterator[FurtherSpring]:
    """Yields the springs that a robot file may lack."""
    stiffness = gear_stiffness(robot)
    last = len(robot.joints) - 1
    for index, joint in enumerate(robot.joints):
        stiff = _STIFFER * stiffness[index]
        if robot.rigid[index] and robot.rotor == "spong":
            reflected = joint.motor.gear_ratio**2 * joint.motor.inertia_kgm2
            gear = (2 * np.pi * _RIGID_HZ) ** 2 * reflected
            spring = trial_spring(f"gear_{joint.name}", index, "transmission", np.eye(3)[2], gear)
            yield FurtherSpring(spring, f"gear of {joint.name}")
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            if index == 0 and not is_there(robot, "base", 0, axis):
                yield FurtherSpring(trial_spring(f"base_{letter}", 0, "base", axis, stiff), f"base about {letter}")
            if letter != "z" and not is_there(robot, "bearing", index, axis):
                spring = trial_spring(f"bearing_{joint.name}_{letter}", index, "bearing", axis, stiff)
                yield FurtherSpring(spring, f"bearing of {joint.name} about {letter}")
            if index < last and not is_there(robot, "split", index, None):
                split = trial_spring(
                    f"link_{joint.name}_{letter}", index, "split", axis, _STIFFER * stiffness[index + 1]
                )
                split = replace(split, outboard=_part(joint.link), point_m=_middle(robot.joints[index + 1], axis))
                yield FurtherSpring(split, f"link of {joint.name} about its {letter} axis")
            if (
                index == last
                and letter != "z"
                and robot.payload.mass_kg > 0
                and not is_there(robot, "payload", last, axis)
            ):
                spring = trial_spring(f"payload_mount_{letter}", last, "payload", axis, stiff)
                yield FurtherSpring(spring, f"payload mount about {letter}")


def _middle(following: Joint, axis: FloatArray) -> FloatArray:
    """Where a link is split: a link that twists along the next joint's axis does so about that very line."""
    along = abs(float(axis @ following.rotation[:, 2])) > ALONG
    return following.position_m if along else np.zeros(3)


def _part(link: Inertial) -> Inertial:
    return Inertial(_OUTBOARD * link.mass_kg, link.com_m, _OUTBOARD * link.inertia_kgm2)
