"""Doubts of springs that a robot file lacks: bearings about further axes, and what the base stands on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.robot.description import Robot, Spring, SpringPlace

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene

_PERCENT = 100.0
_STEP = 1e-3  # percent of the gear's compliance
_RIGID = 1e11  # times the gear's stiffness
ALONG = 0.9
"""Cosine above which two axes are one."""
_TIME_S = 5e-4  # damping over stiffness
_SAME_M = 1e-3  # between axes that are one
_UNKNOWN_NM_RAD = 1e6  # where no gear is stated


@dataclass(frozen=True)
class Compliance:
    """A spring that is there in truth, in percent of its joint's gear's compliance, statics included.

    Attributes:
        spring: The spring, as stiff as the gear.
    """

    spring: Spring

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        names = [spring.name for spring in scene.robot.springs]
        if self.spring.name in names:
            index = names.index(self.spring.name)
            amount = _PERCENT * self.spring.stiffness / scene.values.stiffness[index]
            return np.asarray(scene.compliance_slopes[..., index] / amount)
        factors = _RIGID, _PERCENT / _STEP, 0.5 * _PERCENT / _STEP
        rigid, stiff, softer = (scene.extended(stiffened(self.spring, factor)) for factor in factors)
        # One-sided differences, extrapolated: there is no negative compliance.
        return np.asarray((2 * np.log(stiff / rigid) - 0.5 * np.log(softer / rigid)) / _STEP)


def spring_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the doubts of springs that a robot file lacks."""
    for spring in missing_springs(robot):
        doubts = robot.doubts if spring.place == "base" else robot.joints[spring.joint].doubts
        if doubts.compliance > 0:
            std, names = _PERCENT * doubts.compliance, (f"{spring.name}.compliance", spring.name.replace("_", " "))
            unit = "% of its gear's compliance"
            yield DoubtColumn(*names, "missing_spring", unit, std, 0.0, Compliance(spring), least=0.0)


def missing_springs(robot: Robot) -> Iterator[Spring]:
    """Yields bearings and base springs that a robot file lacks, each as stiff as the gear of its joint.

    A base that turns about an axis through the origin of a first joint that turns too does what bearings and gear of
    that joint do, and is none of its own.
    """
    stiffness = gear_stiffness(robot)
    first = robot.joints[0]
    for letter, axis in zip("xyz", np.eye(3), strict=True):
        beside = np.linalg.norm(np.cross(axis, first.position_m)) > _SAME_M
        if not is_there(robot, "base", 0, axis) and (beside or first.type == "prismatic"):
            yield trial_spring(f"base_{letter}", 0, "base", axis, stiffness[0])
    for index, joint in enumerate(robot.joints):
        for letter, axis in zip("xy", np.eye(3), strict=False):
            if not is_there(robot, "bearing", index, axis):
                yield trial_spring(f"bearing_{joint.name}_{letter}", index, "bearing", axis, stiffness[index])


def gear_stiffness(robot: Robot) -> list[float]:
    """What a torsional spring at each joint is measured by: its gear, else the stiffest one [N m/rad]."""
    gears = {s.joint: s.stiffness for s in robot.springs if s.place == "transmission" and not robot.is_linear(s)}
    others = [s.stiffness for s in robot.springs if not robot.is_linear(s)]
    else_ = max(gears.values(), default=max(others, default=_UNKNOWN_NM_RAD))
    return [gears.get(index, else_) for index in range(len(robot.joints))]


def is_there(robot: Robot, place: str, joint: int, axis: FloatArray | None) -> bool:
    """Whether the robot has such a spring, about this axis or, for None, about any."""
    own = [spring.axis for spring in robot.springs if spring.place == place and spring.joint == joint]
    return any(axis is None or abs(float(axis @ each)) > ALONG for each in own)


def stiffened(spring: Spring, factor: float) -> Spring:
    """A spring that is stiffer by a factor, its damper too."""
    return replace(spring, stiffness=factor * spring.stiffness, damping=factor * spring.damping)


def trial_spring(name: str, joint: int, place: SpringPlace, axis: FloatArray, stiffness: float) -> Spring:
    """Returns a spring that a file may lack, with a damper of its size."""
    return Spring(name, joint, place, axis, stiffness, _TIME_S * stiffness)
