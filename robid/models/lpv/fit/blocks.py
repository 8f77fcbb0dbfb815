"""The matrices of each basis function: blocks that a penalty keeps or drops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.models.lpv.fit.state_space import MATRICES, Sizes


@dataclass(frozen=True)
class Norms:
    """How large each block is.

    Attributes:
        absolute (4, n_function + 1): Euclidean norm of each of the matrices A, B, C, D of each function.
        scale (4, n_function): What a block's norm is multiplied by to be relative to the constant block: the largest
            value of its function over the norm of the constant block.
    """

    absolute: FloatArray
    scale: FloatArray

    @property
    def relative(self) -> FloatArray:
        """What each block contributes at most, relative to the constant block (4, n_function)."""
        return self.absolute[:, 1:] * self.scale


def measure(parameters: FloatArray, largest: FloatArray, sizes: Sizes) -> Norms:
    """Measures the blocks of a model.

    Args:
        parameters (n_function + 1, n_local): The model.
        largest (n_function,): Largest value of each function.
        sizes: Of the model.

    Source:
        Turk et al. (2018), eq. 13-15: relative to the constant block, or as it is where there is none.
    """
    absolute = np.array([np.linalg.norm(parameters[:, part], axis=1) for part in sizes.parts])
    constant = np.where(absolute[:, :1] > 0, absolute[:, :1], 1.0)
    return Norms(absolute, largest / constant)


def spread(kept: BoolArray, sizes: Sizes) -> BoolArray:
    """Returns which elements (n_function + 1, n_local) may differ from zero where blocks (4, n_function) are kept."""
    free = np.ones((kept.shape[1] + 1, sizes.n_local), bool)
    for part, one in zip(sizes.parts, kept, strict=True):
        free[1:, part] = one[:, None]
    return free


def block_names(kept: BoolArray) -> tuple[str, ...]:
    """Returns the names of the chosen blocks, `A1` to `D<n_function>`."""
    return tuple(f"{MATRICES[row]}{column + 1}" for row, column in zip(*np.nonzero(kept), strict=True))


@dataclass(frozen=True)
class Blocks:
    """Which elements a penalty puts together.

    Attributes:
        free (n_free,): Places of the elements that may differ from zero, in the model row by row.
        members: Places of each penalised block's elements among the free ones.
        where (n_block, 2): Matrix and function (counted from 0, without the constant one) of each block.
    """

    free: IntArray
    members: tuple[IntArray, ...]
    where: IntArray


def list_blocks(kept: BoolArray, sizes: Sizes) -> Blocks:
    """Lists the elements of the constant blocks and of those (4, n_function) that are kept."""
    n_function = kept.shape[1]
    owner = np.full((n_function + 1, sizes.n_local), -1)
    where = np.argwhere(kept)
    for index, (row, column) in enumerate(where):
        owner[column + 1, sizes.parts[row]] = index
    dropped = np.zeros(owner.shape, bool)
    for row, column in np.argwhere(~kept):
        dropped[column + 1, sizes.parts[row]] = True
    free = np.flatnonzero(~dropped)
    members = tuple(np.flatnonzero(owner.ravel()[free] == index) for index in range(len(where)))
    return Blocks(free, members, where)
