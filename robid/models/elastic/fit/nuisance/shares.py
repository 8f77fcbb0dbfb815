"""Friction whose amounts are shares of a rotor's inertia: it follows the rotor that a fit estimates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.elastic.fit.nuisance.columns import FRICTION
from robid.models.elastic.fit.nuisance.effects import MotorFriction, Nuisance, ValueOff

_Rows = TypeVar("_Rows", FloatArray, ComplexArray)


def are_shares(nuisances: Sequence[Nuisance]) -> BoolArray:
    """Tells which nuisances (n_nuisance,) are friction, in shares of what a joint's rotor asks for."""
    return np.array([_is_share(each) for each in nuisances], bool)


def _is_share(nuisance: Nuisance) -> bool:
    effect = nuisance.effect
    return isinstance(effect, MotorFriction) or (isinstance(effect, ValueOff) and effect.kind in FRICTION)


def following_rotors(
    derivative: _Rows, names: Sequence[str], nuisances: Sequence[Nuisance], columns: _Rows, amounts: FloatArray
) -> _Rows:
    """Returns derivatives by the parameters (n_conf, ..., n_param) when friction follows the estimated rotors.

    Springs, masses, rotors, friction and torques by one factor are the same response. As absolute amounts, friction of
    every cluster would be the less unlikely the smaller that factor is: together many of them pull all springs down.

    Args:
        derivative (n_conf, ..., n_param): Derivatives with absolute friction.
        names: Names of the parameters.
        nuisances: The nuisances.
        columns (n_conf, ..., n_nuisance): Derivatives by their amounts.
        amounts (n_conf, n_nuisance): What each configuration's amounts are.
    """
    found = derivative.copy()
    for index in np.flatnonzero(are_shares(nuisances)).tolist():
        rotor = f"{nuisances[index].name.rpartition('.')[0]}.motor_inertia"
        if rotor in names:
            shape = (-1, *(1,) * (columns.ndim - 2))
            # The logarithm of a rotor's inertia by one: as many times more of its friction as there is.
            found[..., list(names).index(rotor)] += columns[..., index] * amounts[:, index].reshape(shape)
    return found
