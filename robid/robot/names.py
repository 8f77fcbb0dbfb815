"""Names of the robot's parameters."""

from __future__ import annotations

import numpy as np

from robid.robot.description import LOCATED, Robot

_AXIS_TOLERANCE = 1e-9


def element_names(robot: Robot, kind: str) -> list[str | None]:
    """Names of a kind's elements, in the order of its values; None for what no fit estimates."""
    if kind == "delay":
        return ["delay"]
    if kind == "cubic":
        return [f"{s.name}.cubic" if s.place == "transmission" else None for s in robot.springs]
    if kind == "location":
        # A spring that moves along its own axis stays the same spring.
        return [
            f"{spring.name}.location_{axis}" if spring.place in LOCATED and share < 1 - _AXIS_TOLERANCE else None
            for spring in robot.springs
            for axis, share in zip("xyz", np.abs(spring.axis).tolist(), strict=True)
        ]
    owners = robot.springs if kind in ("stiffness", "damping") else robot.joints
    return [f"{owner.name}.{kind}" for owner in owners]
