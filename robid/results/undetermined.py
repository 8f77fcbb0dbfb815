"""Combinations of parameters that the data do not determine, in words."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from robid.arrays import FloatArray

_ALSO_MOVES = 0.3
_MOST = 3


def undetermined_combinations(
    names: tuple[str, ...], covariance: FloatArray, relative: FloatArray, limit: float
) -> tuple[str, ...]:
    """Writes out the directions in which the parameters are uncertain, one sentence each.

    Args:
        names: Name of each parameter.
        covariance (n_param, n_param): Covariance of the internal parameters, logarithms.
        relative (n_param,): What an internal parameter's change by 1 changes the value relatively; 1 for logarithms.
        limit: Relative deviation above which a direction counts as not determined.

    Returns:
        One sentence for each such direction, named after the parameter that shows it best.
    """
    scaled = covariance * np.outer(relative, relative)
    variance, directions = np.linalg.eigh(scaled)
    free = directions[:, variance > limit**2]
    if free.size == 0:
        return ()
    _, _, order = qr(free.T, pivoting=True, mode="economic")
    leaders = order[: free.shape[1]]
    moves = free @ np.linalg.inv(free[leaders])
    deviation = np.sqrt(np.diag(scaled))
    return tuple(
        _sentence(names, leader, column, deviation[leader]) for leader, column in zip(leaders, moves.T, strict=True)
    )


def _sentence(names: tuple[str, ...], leader: int, move: FloatArray, deviation: float) -> str:
    others = [index for index in np.argsort(-np.abs(move)) if index != leader and abs(move[index]) > _ALSO_MOVES]
    known = f"{names[leader]} is known only to {_factor(float(deviation))}"
    if not others:
        return known
    told = [
        f"{names[index]} {'rises' if move[index] > 0 else 'falls'} (exponent {move[index]:.2g})" for index in others
    ]
    more = f" and {len(others) - _MOST} more" if len(others) > _MOST else ""
    together = ", ".join(told[:_MOST])
    return f"{known}: where it rises, {together}{more}, and only the combination is determined"


def _factor(deviation: float) -> str:
    if deviation < 1:
        return f"{100 * deviation:.0f} %"
    return f"a factor of {np.exp(min(deviation, 20.0)):.3g}"
