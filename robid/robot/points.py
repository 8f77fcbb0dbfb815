"""Points along the elastic arm at rest, and how each moves with motors and springs, for shapes of modes."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.model import ElasticModel

_LEVER = 0.08  # Length of the tool's axes over that of the arm
_SHORTEST_M = 0.1  # Length of the axes of an arm without any


@dataclass(frozen=True)
class ArmPoints:
    """Points of an arm in some positions: along it from base to tool, then the ends of two axes of the tool.

    The tool's axes show what turns the tool about itself, which moves no point of the arm.
    """

    position_m: FloatArray  # (n_conf, n_point, 3) Where they are, in the base frame [m]
    # (n_conf, n_point, 3, n) By how much each moves with the motors' angles, then with the springs' deflections
    # [m/rad, or m/m]
    moves: FloatArray

    @property
    def length_m(self) -> FloatArray:
        """Length (n_conf,) of the line along the arm [m]."""
        along = self.position_m[:, :-2]
        return np.asarray(np.linalg.norm(np.diff(along, axis=1), axis=2).sum(axis=1))


def arm_points(model: ElasticModel, positions: FloatArray) -> ArmPoints:
    """Finds the points of an elastic arm, and their Jacobians by motor angles and spring deflections.

    The points are the base, joints, where links are split and the payload hangs on springs, and the payload's centre
    of mass.

    Args:
        model: The elastic model.
        positions (n_conf, n_dof): All its coordinates, as of an equilibrium [rad, or m].
    """
    data, to_spring = model.scratch, model.to_spring
    bodies, tool = _bodies(model)
    found = [_points(model, data, position, bodies, tool) for position in positions]
    located, moves = (np.array(each) for each in zip(*found, strict=True))
    return ArmPoints(located, moves @ to_spring)


def _bodies(model: ElasticModel) -> tuple[list[int], FloatArray]:
    """The bodies from base to tool, and the payload's centre of mass (3,) in the frame of the last one [m]."""
    compiled, robot = model.mujoco, model.robot
    last = compiled.body(robot.joints[-1].name).id
    chain = [last]
    # What is split off the last link, and the payload on its springs, follow each other without turning frames.
    for body in range(last + 1, compiled.nbody):
        if compiled.body_parentid[body] == chain[-1]:
            chain.append(body)
    tool = robot.payload.com_m - compiled.body_pos[chain[1:]].sum(axis=0)
    # Everything that carries the last link, down to the world.
    while compiled.body_parentid[chain[0]] > 0:
        chain.insert(0, int(compiled.body_parentid[chain[0]]))
    return chain, tool


def _points(
    model: ElasticModel, data: mujoco.MjData, position: FloatArray, bodies: list[int], tool: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points (n_point, 3) in one position (n_dof,), and their Jacobians (n_point, 3, n_dof) by its coordinates."""
    data.qpos[:] = position
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    last, turn = bodies[-1], data.xmat[bodies[-1]].reshape(3, 3)
    # The frames of bodies sit where joints and springs are; a base that tilts is drawn from where it does.
    still = 0 if any(spring.place == "base" for spring in model.robot.springs) else 1
    along = [*([(0, np.zeros(3))] * still), *((body, data.xpos[body].copy()) for body in bodies)]
    along.append((last, data.xpos[last] + turn @ tool))
    # What the bodies' frames are apart does not depend on where the joints are.
    apart = np.linalg.norm(np.vstack([model.mujoco.body_pos[bodies], tool]), axis=1)
    lever = _LEVER * float(apart.sum()) or _SHORTEST_M
    points = [*along, *((last, along[-1][1] + lever * turn[:, axis]) for axis in (0, 1))]
    jacobians = np.zeros((len(points), 3, model.mujoco.nv))
    for row, (body, point) in enumerate(points):
        mujoco.mj_jac(model.mujoco, data, jacobians[row], None, point, body)
    return np.array([point for _, point in points]), jacobians
