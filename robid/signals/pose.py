"""Poses of a tool: their channels, angles A B C, and displacements from a home pose along its own axes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.signals.quantities import Channel

POSE = ("X", "Y", "Z", "A", "B", "C")
"""Names of a displacement's components, as robots call them."""
RAIL = "R"
"""Name of the rail that carries the robot's root."""
ANGLES = frozenset({"A", "B", "C"})

_LOCKED = 1e-9


def pose_command_channels(names: Iterable[str]) -> tuple[Channel, ...]:
    """Returns the channels of commanded displacements, from names of `POSE` and of axes that slide."""
    return tuple(Channel(name, "position_command", "rad" if name in ANGLES else "m", "tool") for name in names)


def pose_channels(names: Iterable[str]) -> tuple[Channel, ...]:
    """Returns the channels of measured displacements, from names of `POSE` and of axes that slide."""
    return tuple(
        Channel(name, "angle", "rad", "tool") if name in ANGLES else Channel(name, "position", "m", "tool")
        for name in names
    )


def rotation_from_zyx(abc: FloatArray) -> FloatArray:
    """Returns the rotation matrices of turns by A about z, then B about the new y, then C about the newest x.

    Args:
        abc (..., 3): Angles A, B, C [rad].

    Returns:
        Matrices (..., 3, 3) from the turned frame to the one that was turned from.
    """
    cosine, sine = np.cos(abc), np.sin(abc)
    (ca, cb, cc), (sa, sb, sc) = np.moveaxis(cosine, -1, 0), np.moveaxis(sine, -1, 0)
    rows = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def zyx_from_rotation(rotation: FloatArray) -> FloatArray:
    """Returns the angles A, B, C of rotation matrices, without jumps from sample to sample.

    B lies within -90 to 90 degrees. Where it is at an end, A and C turn about one axis; C is 0 there.

    Args:
        rotation (..., 3, 3) or (..., n_sample, 3, 3): Rotation matrices; the last axis before them is time.

    Returns:
        Angles (..., 3) [rad]; A and C may exceed a turn.
    """
    level = np.hypot(rotation[..., 0, 0], rotation[..., 1, 0])
    locked = level < _LOCKED
    a = np.arctan2(
        np.where(locked, -rotation[..., 0, 1], rotation[..., 1, 0]),
        np.where(locked, rotation[..., 1, 1], rotation[..., 0, 0]),
    )
    b = np.arctan2(-rotation[..., 2, 0], level)
    c = np.where(locked, 0.0, np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]))
    abc = np.stack([a, b, c], axis=-1)
    return abc if rotation.ndim == 2 else np.unwrap(abc, axis=-2)


def displacement(
    home_position: FloatArray, home_rotation: FloatArray, position: FloatArray, rotation: FloatArray
) -> FloatArray:
    """Returns how far poses lie from a home pose, along and about the axes of the home pose.

    Args:
        home_position (3,): Home position [m].
        home_rotation (3, 3): Home orientation.
        position (..., n_sample, 3): Positions in the same frame [m].
        rotation (..., n_sample, 3, 3): Orientations in the same frame.

    Returns:
        X, Y, Z [m], A, B, C [rad] (..., n_sample, 6).
    """
    check_shape("home_position", home_position, "axis", axis=3)
    check_shape("home_rotation", home_rotation, "axis axis_too", axis=3, axis_too=3)
    away = (position - home_position) @ home_rotation
    return np.concatenate([away, zyx_from_rotation(home_rotation.T @ rotation)], axis=-1)


def displaced_pose(
    home_position: FloatArray, home_rotation: FloatArray, displaced: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns the poses at displacements from a home pose; the inverse of `displacement`.

    Args:
        home_position (3,): Home position [m].
        home_rotation (3, 3): Home orientation.
        displaced (..., 6): X, Y, Z [m], A, B, C [rad] along and about the axes of the home pose.

    Returns:
        Positions (..., 3) [m] and orientations (..., 3, 3) in the frame of the home pose.
    """
    position = home_position + displaced[..., :3] @ home_rotation.T
    return np.asarray(position), np.asarray(home_rotation @ rotation_from_zyx(displaced[..., 3:]))
