"""Adding and subtracting mass properties of rigid bodies in one frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial


def combine(first: Inertial, second: Inertial) -> Inertial:
    """Returns the mass properties of two bodies joined rigidly, in their common frame."""
    return _from_moments(
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
    return np.asarray(body.inertia_kgm2 + body.mass_kg * _steiner(body.com_m))


def _from_moments(mass: float, first_moment: FloatArray, inertia: FloatArray) -> Inertial:
    com = first_moment / mass if mass != 0 else np.zeros(3)
    return Inertial(mass, com, np.asarray(inertia - mass * _steiner(com)))


def _steiner(offset: FloatArray) -> FloatArray:
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))


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
            distance = reach + float(np.linalg.norm(links[index].com_m))
            largest[first] += np.linalg.eigvalsh(links[index].inertia_kgm2)[-1] + links[index].mass_kg * distance**2
    return largest
