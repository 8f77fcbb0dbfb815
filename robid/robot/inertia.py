"""Rigid bodies: adding and subtracting mass properties in one frame, and rotation matrices from angles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial


def turn_about(axis: Literal["x", "y", "z"], angle_deg: float) -> FloatArray:
    """Returns the matrix (3, 3) of a turn about a coordinate axis by an angle [deg]."""
    half = math.radians(angle_deg) / 2
    # From the quaternion, digit by digit as scipy.spatial.transform.Rotation has it, which takes long to import.
    sine, cosine = math.sin(half), math.cos(half)
    along = "xyz".index(axis)
    first, second = (along + 1) % 3, (along + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[along, along] = sine * sine + cosine * cosine
    matrix[first, first] = matrix[second, second] = cosine * cosine - sine * sine
    matrix[second, first] = 2 * sine * cosine
    matrix[first, second] = -matrix[second, first]
    return matrix


def roll_pitch_yaw(angles_deg: tuple[float, float, float]) -> FloatArray:
    """Returns the matrix (3, 3) of turns about the fixed x, then y, then z axis [deg]."""
    roll, pitch, yaw = angles_deg
    return np.asarray(turn_about("z", yaw) @ turn_about("y", pitch) @ turn_about("x", roll))


def combine(first: Inertial, second: Inertial) -> Inertial:
    """Returns the mass properties of two bodies joined rigidly, in their common frame."""
    return _from_moments(
        # Mass, first moment and inertia about one origin add up.
        first.mass_kg + second.mass_kg,
        first.mass_kg * first.com_m + second.mass_kg * second.com_m,
        about_origin(first) + about_origin(second),
    )


def remove(whole: Inertial, part: Inertial) -> Inertial:
    """Returns what is left of a body when a part is taken away, in their common frame."""
    return _from_moments(
        whole.mass_kg - part.mass_kg,
        whole.mass_kg * whole.com_m - part.mass_kg * part.com_m,
        about_origin(whole) - about_origin(part),
    )


def about_origin(body: Inertial) -> FloatArray:
    """Returns the inertia (3, 3) about the frame's origin [kg m^2]."""
    return np.asarray(body.inertia_kgm2 + body.mass_kg * steiner(body.com_m))


def _from_moments(mass: float, first_moment: FloatArray, inertia: FloatArray) -> Inertial:
    com = first_moment / mass if mass != 0 else np.zeros(3)
    return Inertial(mass, com, np.asarray(inertia - mass * steiner(com)))


def steiner(offset: FloatArray) -> FloatArray:
    """Returns the inertia (3, 3) of a point of mass one at an offset (3,)."""
    # Steiner: m (c' c I - c c').
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Returns the matrix (3, 3) that takes a vector (3,) crosswise: `cross_matrix(a) @ b` is `a x b`."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def stretched_inertia(
    offsets: Sequence[FloatArray],
    links: Sequence[Inertial],
    slides: Sequence[bool] | None = None,
    travels_m: Sequence[float] | None = None,
) -> FloatArray:
    """Returns the largest inertia (n_joint,) that each joint can meet in what it moves, or its mass [kg m^2, or kg].

    Every offset is taken at its full length away from the axis, and every link about its largest principal axis.

    Args:
        offsets: Origin (3,) of each joint frame in the previous one [m].
        links: Mass properties of each link in its joint frame.
        slides: Which joints are prismatic; none by default.
        travels_m: How far each of these goes [m].
    """
    largest = np.zeros(len(links))
    prismatic = [False] * len(links) if slides is None else slides
    travel = [0.0] * len(links) if travels_m is None else travels_m
    for first in range(len(links)):
        if prismatic[first]:
            largest[first] = sum(link.mass_kg for link in links[first:])
            continue
        reach = 0.0
        for index in range(first, len(links)):
            reach += float(np.linalg.norm(offsets[index])) + travel[index] if index > first else 0.0
            # m (reach + |c|)^2 bounds Steiner's term for every position of the joints between.
            distance = reach + float(np.linalg.norm(links[index].com_m))
            largest[first] += np.linalg.eigvalsh(links[index].inertia_kgm2)[-1] + links[index].mass_kg * distance**2
    return largest


def about_z(angle: FloatArray) -> FloatArray:
    """Returns the matrices (n, 3, 3) of turns about the z axis by angles (n,) [rad]."""
    turn = np.zeros((angle.size, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn


def turned_about_z(turn: FloatArray, angle: FloatArray) -> FloatArray:
    """Returns orientations (..., 3, 3) after turns by angles (...,) about their own z [rad]."""
    cosine, sine = np.cos(angle)[..., None], np.sin(angle)[..., None]
    x, y = turn[..., 0], turn[..., 1]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, turn[..., 2]], axis=-1)
