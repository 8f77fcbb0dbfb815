"""Zeros of joints that are off: the arm turns further than its encoder shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robid.robot.description import Joint, Robot, Spring
from robid.robot.inertia import turn_about


def with_zeros(robot: Robot, zeros_deg: Mapping[str, float]) -> Robot:
    """Returns a robot some of whose joints stand further about their axes than the encoders show.

    That is a joint frame that is turned about its own z axis, as by a larger `offset_deg`; what turns with the link
    follows, bearings stay where they are.

    Args:
        robot: The robot; joints that slide keep their zeros.
        zeros_deg: True angle less shown one, by joint [deg].
    """

    def turned(joint: Joint) -> Joint:
        zero = zeros_deg.get(joint.name, 0.0) if joint.type == "revolute" else 0.0
        return replace(joint, rotation=joint.rotation @ turn_about("z", zero)) if zero else joint

    def still(spring: Spring) -> Spring:
        # A bearing's axis is given in the frame that turns, and stays where it was.
        joint = robot.joints[spring.joint]
        zero = zeros_deg.get(joint.name, 0.0) if joint.type == "revolute" else 0.0
        if spring.place != "bearing" or not zero:
            return spring
        return replace(spring, axis=np.asarray(turn_about("z", -zero) @ spring.axis))

    return replace(robot, joints=tuple(map(turned, robot.joints)), springs=tuple(map(still, robot.springs)))
