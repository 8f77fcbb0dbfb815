"""The rigid bodies of a robot as a tree whose joint positions are affine in a few independent ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import LoopLink, Robot

Side = Literal["motor", "arm"]
PAYLOAD = "payload"
"""Name of the payload as a body of its own."""


@dataclass(frozen=True)
class Body:
    """A body about or along the z axis of whose frame it moves.

    Attributes:
        name: Name of its joint, loop link or motor, or `payload`.
        parent: Index of the body that carries it, -1 for the base.
        position_m (3,): Origin of its frame in the parent's frame [m].
        rotation (3, 3): Orientation of its frame in the parent's frame at zero position.
        slides: Whether it slides instead of turning.
        is_rotor: Whether it is a rotor that rides on its parent.
        is_payload: Whether it is the payload as a body of its own.
    """

    name: str
    parent: int
    position_m: FloatArray
    rotation: FloatArray
    slides: bool = False
    is_rotor: bool = False
    is_payload: bool = False


@dataclass(frozen=True)
class Tree:
    """Bodies, each after its parent, and how independent coordinates move them.

    Attributes:
        bodies: The links of the joints, loop links, rotors that ride on links, and the payload where it is a body
            of its own.
        turns (n_body, n_coordinate): Position of each body per unit of each independent coordinate; constant, as
            parallelograms keep sums of angles.
        offset (n_body,): Position of each body where the coordinates are zero.
        gravity_m_s2 (3,): Gravity in the base frame [m/s^2].
    """

    bodies: tuple[Body, ...]
    turns: FloatArray
    offset: FloatArray
    gravity_m_s2: FloatArray

    @property
    def reach(self) -> tuple[int, ...]:
        """How many of the coordinates, from the first on, can move each body or what carries it."""
        found: list[int] = []
        for body, row in zip(self.bodies, self.turns, strict=True):
            own = np.flatnonzero(row)
            last = int(own[-1]) + 1 if own.size else 0
            found.append(max(last, found[body.parent] if body.parent >= 0 else 0))
        return tuple(found)


def rigid_tree(robot: Robot, side: Side = "motor", *, rotors: bool = True, payload: bool = False) -> Tree:
    """Returns a robot's tree of rigid bodies.

    Args:
        robot: The robot; its springs are taken as rigid.
        side: Coordinates: motor angles, or arm positions of the joints.
        rotors: Whether rotors that ride on links are among the bodies, on the motor side; they turn with their motors.
        payload: Whether the payload is a body of its own.

    Source:
        Janot et al. (2009), the branch of the interface: independent coordinates and the loop's Jacobian.
    """
    n_joint = len(robot.joints)
    bodies = [
        Body(joint.name, index - 1, joint.position_m, joint.rotation, slides=joint.type == "prismatic")
        for index, joint in enumerate(robot.joints)
    ]
    names = [joint.name for joint in robot.joints]
    turns, offset = [*np.eye(n_joint)], [0.0] * n_joint
    for link in robot.loop_links:
        bodies.append(Body(link.name, _parent(link, bodies), link.position_m, link.rotation))
        turns.append(np.array([link.turns.get(name, 0.0) for name in names]))
        offset.append(link.offset_rad)
    moves = np.array(turns) if side == "arm" else np.array(turns) @ robot.arm_per_motor
    if rotors and side == "motor" and robot.rotor == "on_link":
        driven = [index for index, joint in enumerate(robot.joints) if joint.has_motor]
        for index in driven:
            joint = robot.joints[index]
            bodies.append(Body(joint.name, index - 1, joint.position_m, joint.rotation, is_rotor=True))
        moves = np.vstack([moves, np.eye(n_joint)[driven]])
    if payload:
        bodies.append(Body(PAYLOAD, n_joint - 1, np.zeros(3), np.eye(3), is_payload=True))
        moves = np.vstack([moves, np.zeros(n_joint)])
    still = np.zeros(len(bodies) - len(offset))
    return Tree(tuple(bodies), moves, np.concatenate([offset, still]), robot.gravity_m_s2)


def _parent(link: LoopLink, bodies: list[Body]) -> int:
    return -1 if link.parent is None else [body.name for body in bodies].index(link.parent)
