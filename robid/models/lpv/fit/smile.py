"""Interpolates local models in the basis functions of their positions."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.state_space import StateSpace, pack


def check_positions(values: FloatArray) -> None:
    """Refuses positions that do not tell the basis functions apart.

    Args:
        values (n_pos, n_function + 1): The functions at the positions.

    Raises:
        DataError: If there are fewer positions than functions, or they leave a combination of functions open.
    """
    n_pos, n_function = values.shape
    if n_pos < n_function:
        raise DataError(
            f"{n_pos} different positions cannot tell {n_function} basis functions apart (the constant one counted).",
            remedy="Fit more positions, or take fewer functions (`basis`).",
        )
    if np.linalg.matrix_rank(values / np.linalg.norm(values, axis=0)) < n_function:
        raise DataError(
            "At these positions some basis functions are combinations of others.",
            remedy="Take fewer functions (`basis`), or positions that vary every scheduling parameter.",
        )


def interpolate(systems: StateSpace, values: FloatArray) -> FloatArray:
    """Fits every element of the matrices over the positions by least squares.

    Args:
        systems: Local models in one basis.
        values (n_pos, n_function + 1): The basis functions at the positions.

    Returns:
        The packed matrices of each function (n_function + 1, n_local).

    Raises:
        DataError: If the positions do not tell the basis functions apart.

    Source:
        De Caigny, Camino and Swevers (2009), Interpolating model identification for SISO linear parameter-varying
        systems; Turk et al. (2018), sec. III-B.
    """
    check_positions(values)
    return np.asarray(np.linalg.lstsq(values, pack(systems), rcond=None)[0])
