"""Which measurements were made in the same robot configuration, as those of two amplitudes are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from robid.arrays import ComplexArray, FloatArray

_SAME_CONFIGURATION_RAD = 1e-3
Values = TypeVar("Values", FloatArray, ComplexArray)


def group_places(configurations: FloatArray) -> list[list[int]]:
    """Indices of the measurements in each place: joint angles (n_conf, n_joint) [rad] that agree."""
    places: list[list[int]] = []
    for index, angles in enumerate(configurations):
        for place in places:
            if np.abs(configurations[place[0]] - angles).max() < _SAME_CONFIGURATION_RAD:
                place.append(index)
                break
        else:
            places.append([index])
    return places


def spread_over(places: Sequence[Sequence[int]], values: Values) -> Values:
    """Values (n_conf, ...) of configurations from those of their places (n_place, ...)."""
    spread = np.empty((sum(map(len, places)), *values.shape[1:]), values.dtype)
    for place, own in zip(places, values, strict=True):
        spread[list(place)] = own
    return spread
