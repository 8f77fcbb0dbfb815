"""The links of closed loops in a robot file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from robid.arrays import FloatArray
from robid.robot.description import LoopLink, Pin
from robid.settings.base import Assumed, Name, Section, Vector
from robid.settings.robot_frames import Frame
from robid.settings.robot_sections import Body, JointSection


class PinSection(Section):
    """Where a link that closes a loop is held."""

    point_m: Vector = Field(description="The point on this link, in its frame [m].")
    joint: Name = Field(description="Joint whose link holds it.")
    held_point_m: Vector = Field(description="The same point on that link, in its frame [m].")


class LoopLinkSection(Assumed):
    """A link beside the chain, in a closed loop that fixes its angle: a crank or a rod of a parallelogram."""

    name: Name = Field(description="Name of the link.")
    parent: Name | None = Field(
        default=None, description="Joint or loop link, listed before, that carries it; the base when not given."
    )
    frame: Frame = Field(
        default_factory=Frame, description="Its frame at zero angle, its axis along z, in the frame of that link."
    )
    turns: dict[Name, float] = Field(
        description="How far it turns against what carries it per turn of each joint, by the joint's name; the sum of"
        " the angles in a parallelogram stays the same, so that these are mostly 1 and -1."
    )
    offset_deg: float = Field(default=0.0, description="Its angle where all joints are at zero [deg].")
    link: Body = Field(description="Its mass properties, in its frame.")
    pin: PinSection | None = Field(
        default=None, description="Where it closes the loop; the file is refused where it does not close."
    )

    def loop_link(self, joints: Sequence[JointSection], base: FloatArray) -> LoopLink:
        """Returns the plain description, in joint frames.

        Args:
            joints: The robot's joints.
            base (3, 3): Orientation of the base in the world.
        """
        frames = {joint.name: joint.geometry.link_frame() for joint in joints}
        still = (np.zeros(3), base if self.parent is None else np.eye(3))
        position, rotation = frames.get(self.parent or "", still)
        offset, turn = self.frame.joint_frame()
        pin = None
        if self.pin is not None:
            index = [joint.name for joint in joints].index(self.pin.joint)
            origin, turned = frames[self.pin.joint]
            pin = Pin(np.array(self.pin.point_m), index, origin + turned @ np.array(self.pin.held_point_m))
        return LoopLink(
            name=self.name,
            parent=self.parent,
            position_m=position + rotation @ offset,
            rotation=rotation @ turn,
            link=self.link.inertial(),
            turns=dict(self.turns),
            offset_rad=float(np.deg2rad(self.offset_deg)),
            pin=pin,
        )
