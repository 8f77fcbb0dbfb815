"""Symmetric matrices as rows of their upper triangles, so that traces of products are matrix products."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from robid.arrays import FloatArray, IntArray

_CHUNK = 4096


@dataclass(frozen=True)
class Packed:
    """Information matrices of all candidates, half the memory of the full ones.

    Attributes:
        rows (n_draw, n_cand, n_param (n_param + 1) / 2): Upper triangles, off-diagonals times sqrt(2): the product of
            two rows is the trace of the product of their matrices.
        n_param: Size of a matrix.
    """

    rows: FloatArray
    n_param: int

    @property
    def n_cand(self) -> int:
        """Number of candidates."""
        return int(self.rows.shape[1])

    def total(self, weights: FloatArray) -> FloatArray:
        """Weighted sums (n_draw, n_param, n_param)."""
        return unpack(weights @ self.rows, self.n_param)

    def traces(self, factors: FloatArray) -> FloatArray:
        """Sum over the draws of `tr(factor H_i)` (n_cand,) for symmetric factors (n_draw, n_param, n_param)."""
        pairs = zip(self.rows, pack(factors), strict=True)
        return np.asarray(sum(rows @ factor for rows, factor in pairs))

    def matrices(self, indices: IntArray) -> FloatArray:
        """Full matrices (n_draw, n_index, n_param, n_param) of some candidates."""
        return unpack(self.rows[:, indices], self.n_param)


def pack(matrices: FloatArray) -> FloatArray:
    """Packs symmetric matrices (..., n, n) into rows (..., n (n + 1) / 2) as `Packed` holds them."""
    size = matrices.shape[-1]
    upper, scale, _ = _layout(size)
    flat = matrices.reshape(-1, size * size)
    rows = np.empty((len(flat), upper.size))
    for begin in range(0, len(flat), _CHUNK):
        np.multiply(flat[begin : begin + _CHUNK, upper], scale, out=rows[begin : begin + _CHUNK])
    return rows.reshape(*matrices.shape[:-2], upper.size)


def unpack(rows: FloatArray, size: int) -> FloatArray:
    """The inverse of `pack`."""
    _, scale, place = _layout(size)
    return np.asarray((rows / scale)[..., place].reshape(*rows.shape[:-1], size, size))


@lru_cache(maxsize=8)
def _layout(size: int) -> tuple[IntArray, FloatArray, IntArray]:
    """Flat indices of the upper triangle, its scales, and where each flat element stands in a row."""
    first, second = np.triu_indices(size)
    place = np.zeros((size, size), int)
    place[first, second] = place[second, first] = np.arange(first.size)
    return first * size + second, np.where(first == second, 1.0, np.sqrt(2)), place.ravel()
