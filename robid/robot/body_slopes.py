"""How a linearised robot moves with its bodies' mass properties, in closed form: none is compiled or settled again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

import mujoco
import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.robot.bodies import bodies_of
from robid.robot.description import Robot
from robid.robot.inertia import cross_matrix
from robid.robot.linearize import Equilibrium, LinearModel, gives_way
from robid.robot.model import ElasticModel
from robid.robot.rest import MatrixSlopes

_FORCE, _TURN = slice(0, 3), slice(3, 6)


@dataclass(frozen=True)
class BodyChange:
    """What changes of a robot's bodies, per amount of a change."""

    inertia: Mapping[str, FloatArray]  # (6, 6) Spatial inertia of each body that changes, see `Body.spatial_inertia`
    axial: FloatArray  # (n_joint,) Links' own inertia about their joint's direction, or mass [kg m^2, or kg]


def body_change(behind: Robot, ahead: Robot, width: float) -> BodyChange:
    """Returns what changes between two robots that differ in bodies alone, per amount, of which they differ by a width.

    Spatial inertias are quadratic in whatever moves a mass, so that their central difference is exact.
    """
    sides = bodies_of(behind), bodies_of(ahead)
    inertia, axial = dict[str, FloatArray](), np.zeros(len(ahead.joints))
    for name in sides[0]:
        first, last = (side[name] for side in sides)
        if first.inertial is not last.inertial:
            moved = (last.spatial_inertia - first.spatial_inertia) / width
            inertia |= {name: moved} if moved.any() else {}
    for row, joint in enumerate(ahead.joints):
        own, other = (side[joint.name].inertial for side in sides)
        by_mass, by_inertia = other.mass_kg - own.mass_kg, (other.inertia_kgm2 - own.inertia_kgm2)[2, 2]
        axial[row] = (by_mass if joint.type == "prismatic" else by_inertia) / width
    return BodyChange(inertia, axial)


def slopes_along_bodies(
    model: ElasticModel,
    equilibrium: Equilibrium,
    linear: LinearModel,
    stiffness: FloatArray,
    changes: Sequence[BodyChange],
    known: BoolArray,
) -> MatrixSlopes:
    """Returns the slopes of the linearised matrices along changes of the bodies, the robot at rest anew.

    Args:
        model: The elastic model, none of whose springs is cubic or varies with a joint's position.
        equilibrium: Where it rests.
        linear: The model linearised there, with how it moves with the springs' deflections.
        stiffness (n_spring,): Stiffness of the springs [N m/rad, or N/m].
        changes: The changes.
        known (n_joint,): Links whose own inertia stays as it is, whatever the change.

    Raises:
        DataError: If the springs give way.
    """
    moves = linear.rest.moves
    assert moves is not None
    load, own = _at_rest(model, equilibrium, changes)
    taken = np.array([change.axial * known for change in changes])
    own["mass"] = own["mass"] - np.einsum("ml,clij->cmij", taken, linear.link_inertia)
    # (K + dg/dd) dd = -dg: how the springs' deflections follow their new load.
    springs = load[..., len(model.motor) :]
    try:
        moved = -np.linalg.solve(np.diag(stiffness) + linear.rest.gradient, np.swapaxes(springs, 1, 2))
    except np.linalg.LinAlgError as error:
        raise gives_way(model.robot) from error
    # The whole change: at the same place, and by the way to where the robot rests then.
    whole = {
        each.name: own.get(each.name, 0.0) + np.einsum("csm,csij->cmij", moved, getattr(moves, each.name))
        for each in fields(MatrixSlopes)
    }
    return MatrixSlopes(**whole)


def _at_rest(
    model: ElasticModel, equilibrium: Equilibrium, changes: Sequence[BodyChange]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Slopes of gravity's torque (n_conf, n_change, n), of inertia and gravity's gradient, where the robot is now."""
    to_spring, every = model.to_spring, _by_body(changes)
    shape = len(equilibrium.position), len(changes), len(to_spring), len(to_spring)
    load, mass, gradient = np.zeros(shape[:3]), np.zeros(shape), np.zeros(shape)
    for row, position in enumerate(equilibrium.position):
        for name, (motion, gravity) in _motions(model, position, every).items():
            columns, inertia = every[name]
            # Energy: M = J' I J of each body. Gravity's torque: -J' I (g, 0).
            momentum = inertia @ motion
            mass[row, columns] += motion.T @ momentum
            load[row, columns] -= (inertia[:, :, _FORCE] @ gravity) @ motion
            # What turns about an axis a turns the moment of what it carries: -(g x a) . moment, of axes before.
            turned = cross_matrix(gravity) @ motion[_TURN]
            later = -(turned.T @ momentum[:, _FORCE]) * model.carries
            gradient[row, columns] += later + np.swapaxes(np.triu(later, 1), 1, 2)
    found = {"mass": mass, "gravity_stiffness": gradient}
    return load @ to_spring, {name: to_spring.T @ each @ to_spring for name, each in found.items()}


def _by_body(changes: Sequence[BodyChange]) -> dict[str, tuple[list[int], FloatArray]]:
    """Which changes there are of each body, and the spatial inertias (n_own, 6, 6) of these."""
    names = dict.fromkeys(name for change in changes for name in change.inertia)
    columns = {name: [column for column, each in enumerate(changes) if name in each.inertia] for name in names}
    return {name: (own, np.array([changes[each].inertia[name] for each in own])) for name, own in columns.items()}


def _motions(
    model: ElasticModel, position: FloatArray, names: Iterable[str]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Speeds and turning rates (6, n_dof) of bodies per coordinate, and gravity (3,), each in the body's own frame."""
    data, found = model.scratch, {}
    data.qpos[:] = position
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    speed, turn = np.zeros((3, position.size)), np.zeros((3, position.size))
    for name in names:
        body = model.mujoco.body(name).id
        mujoco.mj_jacBody(model.mujoco, data, speed, turn, body)
        frame = data.xmat[body].reshape(3, 3)
        found[name] = np.vstack([frame.T @ speed, frame.T @ turn]), frame.T @ model.mujoco.opt.gravity
    return found
