"""The regressor's columns of links and rotors."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial
from robid.robot.inertia import about_origin
from robid.robot.regressor.motion import BodyMotion, body_motions
from robid.robot.regressor.tree import Tree

COMPONENTS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Standard parameters of a link: entries of its inertia about the frame's origin, first moments, mass."""
INERTIAS, MOMENTS = COMPONENTS[:6], COMPONENTS[6:9]
_ACROSS = 0.5  # inertia of a rotor across its axis over the one about it, as of a thin disc
_BLOCK = 512  # samples whose arrays stay in the processor's cache


def standard_parameters(body: Inertial) -> FloatArray:
    """Returns a body's standard parameters (10,) in the order of `COMPONENTS` [kg m^2, kg m, kg]."""
    inertia = about_origin(body)
    return np.concatenate([inertia[np.triu_indices(3)], body.mass_kg * body.com_m, [body.mass_kg]])


def add_inertial_columns(
    tree: Tree, position: FloatArray, velocity: FloatArray, acceleration: FloatArray, out: FloatArray
) -> None:
    """Writes the columns of a tree's bodies.

    Args:
        tree: The tree.
        position (n_coordinate, n_sample): Independent coordinates [rad, or m].
        velocity (n_coordinate, n_sample): Their speeds.
        acceleration (n_coordinate, n_sample): Their accelerations.
        out (n_coordinate, n_column, n_sample): Zeros; ten columns for each link, one for each rotor, in the order
            of the tree.

    Source:
        Janot et al. (2009), eq. 2; Newton and Euler about each frame's origin, projected on each coordinate's screw.
    """
    for start in range(0, position.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        motions = body_motions(tree, position[:, block], velocity[:, block], acceleration[:, block])
        column = 0
        for body, motion in zip(tree.bodies, motions, strict=True):
            reach = motion.turn.shape[1]
            if body.is_rotor:
                out[:reach, column, block] = _rotor_column(motion)
                column += 1
            else:
                _write_link(motion, out[:reach, column : column + 10, block])
                column += 10


def _write_link(motion: BodyMotion, out: FloatArray) -> None:
    """Writes a link's columns (n_reach, 10, n_sample)."""
    (x, y, z), (ax, ay, az), (lx, ly, lz) = motion.rate, motion.angular, motion.linear
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    # Torque about the origin per unit of each inertia, and force per unit of each first moment.
    moments = (
        (ax, xz, -xy),
        (ay - xz, ax + yz, xx - yy),
        (az + xy, zz - xx, ax - yz),
        (-yz, ay, xy),
        (yy - zz, az - xy, ay + xz),
        (yz, -xz, az),
    )
    forces = ((-yy - zz, xy + az, xz - ay), (xy - az, -xx - zz, yz + ax), (xz + ay, yz - ax, -xx - yy))
    # Torque about the origin per unit of each first moment: -linear x, by its two entries.
    levers = (((1, -lz), (2, ly)), ((0, lz), (2, -lx)), ((0, -ly), (1, lx)))
    scratch = np.empty((out.shape[0], out.shape[2]))
    turn, shift = motion.turn, motion.shift
    for column, moment in enumerate(moments):
        _dot(turn, moment, out[:, column], scratch)
    for column, (force, lever) in enumerate(zip(forces, levers, strict=True), start=6):
        _dot(shift, force, out[:, column], scratch)
        for axis, arm in lever:
            np.multiply(turn[axis], arm, out=scratch)
            out[:, column] += scratch
    _dot(shift, (lx, ly, lz), out[:, 9], scratch)


def _dot(vectors: FloatArray, factors: tuple[FloatArray, ...], out: FloatArray, scratch: FloatArray) -> None:
    np.multiply(vectors[0], factors[0], out=out)
    for vector, factor in zip(vectors[1:], factors[1:], strict=True):
        np.multiply(vector, factor, out=scratch)
        out += scratch


def _rotor_column(motion: BodyMotion) -> FloatArray:
    """Torque (n_reach, n_sample) per unit of a disc's inertia about its axis."""
    (x, y, z), (ax, ay, az) = motion.rate, motion.angular
    about = 1 - _ACROSS
    turn = motion.turn
    return np.asarray(turn[0] * (_ACROSS * ax + about * y * z) + turn[1] * (_ACROSS * ay - about * x * z) + turn[2] * az)
