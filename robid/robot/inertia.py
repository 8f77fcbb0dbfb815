"""Adding and subtracting mass properties of rigid bodies in one frame."""

from __future__ import annotations

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
    com = first_moment / mass
    return Inertial(mass, com, np.asarray(inertia - mass * _steiner(com)))


def _steiner(offset: FloatArray) -> FloatArray:
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))
