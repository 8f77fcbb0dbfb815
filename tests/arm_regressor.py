"""The arm side's regressor of links and loop links alone, for comparison with other programs."""

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot
from robid.robot.regressor.links import COMPONENTS, add_inertial_columns, rigid_tree


def arm_columns(robot: Robot, position: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Computes the arm side's regressor of links and loop links alone.

    Returns:
        Regressor (n_sample, n_joint, 10 n_body) of the joints' torques and forces, a view with samples last; each
        body's columns are those of `COMPONENTS`.
    """
    tree = rigid_tree(robot, "arm")
    out = np.zeros((len(robot.joints), len(COMPONENTS) * len(tree.bodies), len(position)))
    motion = [np.ascontiguousarray(array.T, float) for array in (position, velocity, acceleration)]
    add_inertial_columns(tree, motion[0], motion[1], motion[2], [range(len(COMPONENTS))] * len(tree.bodies), out)
    return np.moveaxis(out, 2, 0)
