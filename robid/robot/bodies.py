"""The bodies of an elastic robot: which there are, what each weighs, and which robots differ in these alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial, Robot, Spring
from robid.robot.inertia import combine, cross_matrix, remove, steiner


@dataclass(frozen=True)
class Body:
    """What hangs together between springs and joints."""

    inertial: Inertial  # Mass properties in the frame of its joint; of base springs, in the world's
    origin: FloatArray  # (3,) Origin of the body's own frame there [m]

    @property
    def spatial_inertia(self) -> FloatArray:
        """Inertia (6, 6) by the speed of its origin and its turning rate, in its own frame [kg, kg m, kg m^2]."""
        # The energy is m v^2 / 2 + m v . (w x c) + w' I w / 2, with the inertia I about the origin and c from there.
        own, offset = self.inertial, self.inertial.com_m - self.origin
        moment, found = own.mass_kg * cross_matrix(offset), np.empty((6, 6))
        found[:3, :3], found[:3, 3:] = own.mass_kg * np.eye(3), -moment
        found[3:, :3], found[3:, 3:] = moment, own.inertia_kgm2 + own.mass_kg * steiner(offset)
        return found


def bodies_of(robot: Robot) -> dict[str, Body]:
    """Returns the bodies that the robot file gives mass properties to, by their names in MuJoCo."""
    found: dict[str, Body] = {}
    base, hung = springs_at(robot, "base"), springs_at(robot, "payload")
    if base and robot.base is not None:
        found[f"base_{base[-1].name}"] = Body(robot.base, base[-1].point_m)
    for index, joint in enumerate(robot.joints):
        # A split link keeps what lies before the split; each part beyond hangs on its spring, from the joint outwards.
        name, whole = joint.name, joint.link
        origin: FloatArray = np.zeros(3)
        for spring, outboard in splits_of(robot, index):
            found[name] = Body(remove(whole, outboard), origin)
            name, whole, origin = f"{joint.name}_{spring.name}", outboard, spring.point_m
        if index == len(robot.joints) - 1 and robot.payload.mass_kg > 0 and not hung:
            whole = combine(whole, robot.payload)
        found[name] = Body(whole, origin)
    if hung:
        found[f"payload_{hung[-1].name}"] = Body(robot.payload, hung[-1].point_m)
    return found


def springs_at(robot: Robot, place: str) -> list[Spring]:
    """Returns the springs of a place, in the order of the file."""
    return [spring for spring in robot.springs if spring.place == place]


def splits_of(robot: Robot, joint: int) -> list[tuple[Spring, Inertial]]:
    """Returns springs that split a link with what lies beyond each, the most first; where as much does, in order."""
    own = (spring for spring in robot.springs if spring.joint == joint and spring.place == "split")
    parts = [(spring, spring.outboard) for spring in own if spring.outboard is not None]
    return sorted(parts, key=lambda part: -part[1].mass_kg)


def differ_in_bodies(robot: Robot, *others: Robot) -> bool:
    """Whether robots that were derived from one have other links, base or payload, and all else from it."""
    return all(
        _shares(robot, other, "joints", "springs", "base", "payload")
        and len(robot.springs) == len(other.springs)
        and all(_shares(*pair, "link") for pair in zip(robot.joints, other.joints, strict=True))
        and all(_shares(*pair, "outboard") for pair in zip(robot.springs, other.springs, strict=True))
        for other in others
    )


def _shares(part: Any, other: Any, *but: str) -> bool:  # noqa: ANN401
    """Whether two parts have the very same values in all fields but some; equal arrays of their own do not count."""
    return all(getattr(part, f.name) is getattr(other, f.name) for f in fields(part) if f.name not in but)
