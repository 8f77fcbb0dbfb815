"""One state basis for local models: what lets them be interpolated."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.state_space import StateSpace, balance, stack, transform

_SINGULAR = 1e-8  # of the largest, a singular value of a transformation that loses a state


def align_neighbours(systems: StateSpace, points: FloatArray) -> StateSpace:
    """Brings local models to the basis of a middle one, balanced, each by way of a neighbour that is there already.

    A transformation makes a model as much like its neighbour as a basis can: linear least squares, from its own
    balanced basis, so that the basis it came in does not matter.

    Args:
        systems: Stable local models, one per position.
        points (n_pos, n_scheduling): Their positions.

    Raises:
        DataError: If a model has nothing in common with its neighbour.
    """
    reduced = (points - points.mean(axis=0)) / np.maximum(np.ptp(points, axis=0), np.finfo(float).tiny)
    distance = np.linalg.norm(reduced[:, None] - reduced, axis=2)
    middle = middle_position(points)
    balanced = [balance(systems[index])[0] for index in range(len(points))]
    aligned = {middle: balanced[middle]}
    while len(aligned) < len(points):
        done, left = list(aligned), [index for index in range(len(points)) if index not in aligned]
        near = distance[np.ix_(done, left)]
        row, column = np.unravel_index(np.argmin(near), near.shape)
        aligned[left[column]] = _like(balanced[left[column]], aligned[done[row]], left[column])
    return stack([aligned[index] for index in range(len(points))])


def middle_position(points: FloatArray) -> int:
    """Returns the position nearest to the mean of all."""
    reduced = (points - points.mean(axis=0)) / np.maximum(np.ptp(points, axis=0), np.finfo(float).tiny)
    return int(np.argmin(np.linalg.norm(reduced, axis=1)))


def _like(system: StateSpace, other: StateSpace, index: int) -> StateSpace:
    """The model in the states `T x` that minimise `|T A - A' T|^2 + |T B - B'|^2 + |C - C' T|^2`."""
    n = system.A.shape[0]
    eye = np.eye(n)
    rows = [
        np.kron(eye, system.A.T) - np.kron(other.A, eye),
        np.kron(eye, system.B.T),
        np.kron(other.C, eye),
    ]
    right = [np.zeros(n * n), other.B.ravel(), system.C.ravel()]
    T = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0].reshape(n, n)
    values = np.linalg.svd(T, compute_uv=False)
    if not values[-1] > _SINGULAR * values[0]:
        raise DataError(
            "No basis makes the local model resemble its neighbour's.",
            where=f"position {index}",
            remedy="Measure positions in between, or choose another order.",
        )
    return transform(system, T)
