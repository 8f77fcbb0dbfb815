"""The regressor's columns of links and rotors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial
from robid.robot.inertia import about_origin
from robid.robot.regressor.motion import BodyMotion, body_motions, empty_states
from robid.robot.regressor.tree import Tree

COMPONENTS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Standard parameters of a link: entries of its inertia about the frame's origin, first moments, mass."""
INERTIAS, MOMENTS = COMPONENTS[:6], COMPONENTS[6:9]
ROTOR = np.array([0.5, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
"""Standard parameters of a rotor per its inertia about the axis: a thin disc, weightless."""
_BLOCK = 3000  # samples whose arrays stay in the cache; a power of two would map rows onto each other there
_N_INERTIA, _N_TURNED = 6, 9


def standard_parameters(body: Inertial) -> FloatArray:
    """Returns a body's standard parameters (10,) in the order of `COMPONENTS` [kg m^2, kg m, kg]."""
    inertia = about_origin(body)
    return np.concatenate([inertia[np.triu_indices(3)], body.mass_kg * body.com_m, [body.mass_kg]])


def add_inertial_columns(
    tree: Tree,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    wanted: Sequence[Sequence[int]],
    out: FloatArray,
) -> None:
    """Writes the columns of a tree's bodies.

    Args:
        tree: The tree.
        position (n_coordinate, n_sample): Independent coordinates [rad, or m].
        velocity (n_coordinate, n_sample): Their speeds.
        acceleration (n_coordinate, n_sample): Their accelerations.
        wanted: For each body which of `COMPONENTS` are wanted, ascending; for a rotor that rides on a link its one
            column, 0, or none.
        out (n_coordinate, n_column, n_sample): Zeros, which the wanted columns replace one body after the other.

    Source:
        Janot et al. (2009), eq. 2; Newton and Euler about each frame's origin, projected on each coordinate's screw.
    """
    states: list[FloatArray] = []
    for start in range(0, position.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        n_sample = position[:, block].shape[1]
        if not states or states[0].shape[-1] != n_sample:
            states = empty_states(tree, n_sample)
        motions = body_motions(tree, position[:, block], velocity[:, block], acceleration[:, block], states)
        column = 0
        for body, chosen, motion in zip(tree.bodies, wanted, motions, strict=True):
            columns = out[: len(motion.turn), column : column + len(chosen), block]
            if chosen and body.is_rotor:
                columns[:, 0] = _rotor_column(motion)
            elif chosen:
                _write_link(motion, chosen, columns)
            column += len(chosen)


def _write_link(motion: BodyMotion, chosen: Sequence[int], out: FloatArray) -> None:
    """Writes a link's chosen columns (n_reach, n_chosen, n_sample)."""
    turned = [component for component in chosen if component < _N_TURNED]
    shifted = [component - _N_INERTIA for component in chosen if component >= _N_INERTIA]
    if turned:
        np.einsum("kcn,fcn->kfn", motion.turn, _moments(motion, turned), out=out[:, : len(turned)])
    if shifted:
        out[:, len(chosen) - len(shifted) :] += np.einsum("kcn,fcn->kfn", motion.shift, _forces(motion, shifted))


def _moments(motion: BodyMotion, chosen: Sequence[int]) -> FloatArray:
    """Torque (n_chosen, 3, n_sample) about the origin per unit of each inertia and first moment."""
    (x, y, z), (ax, ay, az), (lx, ly, lz) = motion.rate, motion.angular, motion.linear
    yz, xz, xy = y * z, x * z, x * y
    xx, yy, zz = motion.rate**2
    zero = np.zeros_like(x)
    # Deferred, so that only what is chosen is computed.
    rows: tuple[Callable[[], tuple[FloatArray, ...]], ...] = (
        lambda: (ax, xz, -xy),
        lambda: (ay - xz, ax + yz, xx - yy),
        lambda: (az + xy, zz - xx, ax - yz),
        lambda: (-yz, ay, xy),
        lambda: (yy - zz, az - xy, ay + xz),
        lambda: (yz, -xz, az),
        lambda: (zero, -lz, ly),
        lambda: (lz, zero, -lx),
        lambda: (-ly, lx, zero),
    )
    return np.array([rows[component]() for component in chosen])


def _forces(motion: BodyMotion, chosen: Sequence[int]) -> FloatArray:
    """Force (n_chosen, 3, n_sample) per unit of each first moment and of the mass."""
    (x, y, z), (ax, ay, az) = motion.rate, motion.angular
    yz, xz, xy = y * z, x * z, x * y
    xx, yy, zz = motion.rate**2
    rows: tuple[Callable[[], Sequence[FloatArray]], ...] = (
        lambda: (-yy - zz, xy + az, xz - ay),
        lambda: (xy - az, -xx - zz, yz + ax),
        lambda: (xz + ay, yz - ax, -xx - yy),
        lambda: tuple(motion.linear),
    )
    return np.array([rows[component]() for component in chosen])


def _rotor_column(motion: BodyMotion) -> FloatArray:
    """Torque (n_reach, n_sample) per unit of a disc's inertia about its axis."""
    (x, y, z), (ax, ay, az) = motion.rate, motion.angular
    xx, yy, zz = ROTOR[[0, 3, 5]]
    moment = np.array([xx * ax + (zz - yy) * y * z, yy * ay + (xx - zz) * x * z, zz * az + (yy - xx) * x * y])
    return np.asarray(np.einsum("kcn,cn->kn", motion.turn, moment))
