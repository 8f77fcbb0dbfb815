"""Whether the links beside the chain close their loops."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot
from robid.robot.regressor.links import Tree, rigid_tree


def pin_gaps(robot: Robot, positions: FloatArray) -> FloatArray:
    """Returns how far each pinned loop link is from where it is held.

    Args:
        robot: The robot.
        positions (n_sample, n_joint): Arm positions of the joints [rad, or m].

    Returns:
        Distances (n_sample, n_pin), in the order of the loop links that have a pin [m].
    """
    tree = rigid_tree(robot, "arm")
    origins, turns = _poses(tree, positions)
    gaps = []
    for index, link in enumerate(robot.loop_links, start=len(robot.joints)):
        if link.pin is not None:
            here = origins[index] + turns[index] @ link.pin.point_m
            there = origins[link.pin.joint] + turns[link.pin.joint] @ link.pin.held_point_m
            gaps.append(np.linalg.norm(here - there, axis=-1))
    return np.array(gaps).reshape(-1, len(positions)).T


def _poses(tree: Tree, positions: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Origins (n_sample, 3) and orientations (n_sample, 3, 3) of all bodies in the base frame."""
    own = positions @ tree.turns.T + tree.offset
    origins: list[FloatArray] = []
    turns: list[FloatArray] = []
    for index, body in enumerate(tree.bodies):
        is_first = body.parent < 0
        origin = np.zeros((len(positions), 3)) if is_first else origins[body.parent]
        carried = np.eye(3) if is_first else turns[body.parent]
        frame = np.broadcast_to(carried @ body.rotation, (len(positions), 3, 3))
        origin = origin + carried @ body.position_m
        if body.slides:
            origins.append(origin + frame[:, :, 2] * own[:, index, None])
            turns.append(frame)
        else:
            cosine, sine = np.cos(own[:, index, None]), np.sin(own[:, index, None])
            x, y, z = np.moveaxis(frame, 2, 0)
            origins.append(origin)
            turns.append(np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=2))
    return origins, turns
