"""Symmetric matrices of all lines at once, their upper triangles first: elimination, inverse, outer products."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray


def eliminate(
    constant: ComplexArray, diagonal: ComplexArray, matrix: ComplexArray, factors: ComplexArray, product: ComplexArray
) -> None:
    """Eliminates the first rows of symmetric matrices (n, n, n_line), upper triangle only.

    Args:
        constant: The matrices, but for a diagonal.
        diagonal (n_pivot, n_line): What the first elements of their diagonals have more.
        matrix: Where the eliminated triangle goes, what is left behind its first rows.
        factors (n_pivot, n, n_line): Where the first rows over their pivots go.
        product (n, n_line): Memory to work in.
    """
    n, pivots = len(matrix), len(factors)
    # Row by row, so that all that is taken off a row finds it in the cache.
    for row in range(n):
        own, rest = matrix[row, row:], product[: n - row]
        np.copyto(own, constant[row, row:])
        for pivot in range(min(row, pivots)):
            # Symmetric elimination without pivoting: dampers keep pivots away from zero.
            np.multiply(matrix[pivot, row:], factors[pivot, row], out=rest)
            own -= rest
        if row < pivots:
            own[0] += diagonal[row]
            np.multiply(own, 1 / own[0], out=factors[row, row:])


def invert(matrix: ComplexArray) -> ComplexArray:
    """Inverse of symmetric matrices (n, n, n_line) of which the upper triangle is given, by sweeping."""
    n = len(matrix)
    swept = matrix.copy()
    for row in range(n):
        swept[row + 1 :, row] = swept[row, row + 1 :]
    for pivot in range(n):
        # Sweep operator: each pivot exchanges an unknown with its right-hand side, and all of them give the inverse.
        column = swept[:, pivot].copy()
        inverse = 1 / column[pivot]
        scaled = column * inverse
        swept -= column[:, None] * scaled
        swept[pivot] = scaled
        swept[:, pivot] = scaled
        swept[pivot, pivot] = -inverse
    return np.negative(swept, out=swept)


def outer_products(motion: ComplexArray, scale: ComplexArray, out: ComplexArray) -> None:
    """Upper triangle of the outer product of each element's motion (n_element, n_motor, n_line), scaled."""
    n_motor = motion.shape[1]
    for own, found in zip(motion, out, strict=True):
        begin = 0
        for row in range(n_motor):
            end = begin + n_motor - row
            np.multiply(own[row], own[row:], out=found[begin:end])
            begin = end
        found *= scale
