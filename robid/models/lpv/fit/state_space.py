"""Discrete-time state-space models, one per position, what changes only their basis, and their blocks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError

MATRICES = ("A", "B", "C", "D")


@dataclass(frozen=True)
class Sizes:
    """How many states, inputs and outputs a model has."""

    n_state: int
    n_in: int
    n_out: int

    @property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """Shape of each of the `MATRICES`."""
        n, r, m = self.n_state, self.n_in, self.n_out
        return (n, n), (n, r), (m, n), (m, r)

    @property
    def parts(self) -> tuple[slice, ...]:
        """Where each of the `MATRICES` lies in a packed model, row by row."""
        ends = np.cumsum([0, *(rows * columns for rows, columns in self.shapes)]).tolist()
        return tuple(slice(begin, end) for begin, end in pairwise(ends))

    @property
    def n_local(self) -> int:
        """Length of a packed model."""
        return sum(rows * columns for rows, columns in self.shapes)


@dataclass(frozen=True)
class StateSpace:
    """Models `x(t+1) = A x + B u`, `y = C x + D u`; all axes but the last two count models."""

    A: FloatArray  # (..., n_state, n_state): state matrix
    B: FloatArray  # (..., n_state, n_in): input matrix
    C: FloatArray  # (..., n_out, n_state): output matrix
    D: FloatArray  # (..., n_out, n_in): feedthrough

    @property
    def sizes(self) -> Sizes:
        """How many states, inputs and outputs."""
        return Sizes(self.A.shape[-1], self.B.shape[-1], self.C.shape[-2])

    @property
    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The four matrices."""
        return self.A, self.B, self.C, self.D

    @property
    def spectral_radius(self) -> FloatArray:
        """Largest absolute value of a pole of each model; below 1 where it is stable."""
        return np.asarray(np.abs(np.linalg.eigvals(self.A)).max(axis=-1, initial=0.0))

    def __getitem__(self, index: int | slice) -> StateSpace:
        return StateSpace(*(matrix[index] for matrix in self.matrices))


def pack(system: StateSpace) -> FloatArray:
    """Returns the matrices' elements in one row per model (..., n_local)."""
    return np.concatenate([matrix.reshape(*matrix.shape[:-2], -1) for matrix in system.matrices], axis=-1)


def unpack(packed: FloatArray, sizes: Sizes) -> StateSpace:
    """Undoes `pack`."""
    front = packed.shape[:-1]
    return StateSpace(
        *(packed[..., part].reshape(*front, *shape) for part, shape in zip(sizes.parts, sizes.shapes, strict=True))
    )


def stack(systems: list[StateSpace]) -> StateSpace:
    """Puts single models behind one another.

    Raises:
        DataError: If their numbers of states differ.
    """
    orders = sorted({system.sizes.n_state for system in systems})
    if len(orders) > 1:
        raise DataError(
            f"D173 The local models are of order {', '.join(str(order) for order in orders)}.",
            remedy="Fit all of them with the same order.",
        )
    return StateSpace(*(np.stack(group) for group in zip(*(system.matrices for system in systems), strict=True)))


def resolvent(A: FloatArray, z: ComplexArray) -> ComplexArray:
    """Returns `(z I - A)^-1` (..., n_freq, n_state, n_state) of each model at points `z` (n_freq,)."""
    return np.linalg.inv(z[:, None, None] * np.eye(A.shape[-1]) - A[..., None, :, :])


def response(system: StateSpace, z: ComplexArray) -> ComplexArray:
    """Returns the frequency response (..., n_freq, n_out, n_in) at points `z` (n_freq,)."""
    inner = system.C[..., None, :, :] @ resolvent(system.A, z) @ system.B[..., None, :, :]
    return np.asarray(inner + system.D[..., None, :, :])


def transform(system: StateSpace, T: FloatArray) -> StateSpace:
    """Returns each model with the states `T x` (T: (..., n_state, n_state))."""
    inverse = np.linalg.inv(T)
    return StateSpace(T @ system.A @ inverse, T @ system.B, system.C @ inverse, system.D)


def similarity_tangent(system: StateSpace) -> FloatArray:
    """Returns how packed models begin to change (..., n_local, n_state^2) with states `(I + G) x`, G row by row."""
    front, n = system.A.shape[:-2], system.A.shape[-1]
    eye = np.eye(n)
    parts = [
        np.einsum("ia,...bj->...ijab", eye, system.A) - np.einsum("...ia,bj->...ijab", system.A, eye),
        np.einsum("ia,...bj->...ijab", eye, system.B),
        -np.einsum("...ia,bj->...ijab", system.C, eye),
        np.zeros((*system.D.shape, n, n)),
    ]
    return np.concatenate([part.reshape(*front, -1, n * n) for part in parts], axis=-2)


def balance(system: StateSpace) -> tuple[StateSpace, FloatArray]:
    """Brings one stable model to the basis in which both Gramians are the same diagonal matrix.

    The transformation (n_state, n_state) that was applied comes along.

    Raises:
        DataError: If a state can neither be moved nor seen.
    """
    # Gramians P = A P A^T + B B^T and Q = A^T Q A + C^T C; with P = L L^T, Q = R R^T and R^T L = U S V^T, the states T
    # x of T = S^-1/2 U^T R^T have both equal to S.
    reached = solve_discrete_lyapunov(system.A, system.B @ system.B.T)
    seen = solve_discrete_lyapunov(system.A.T, system.C.T @ system.C)
    left, right = _root(reached), _root(seen)
    U, values, _ = np.linalg.svd(right.T @ left)
    if not values[-1] > np.finfo(float).eps * values[0]:
        raise DataError("D174 A state of the model can neither be moved nor seen.", remedy="Lower the order.")
    T = (U / np.sqrt(values)).T @ right.T
    return transform(system, T), T


def remap(system: StateSpace, a: float, b: float, c: float, d: float) -> StateSpace:
    """Returns the model in `z` of one in `w = (a z + b) / (c z + d)`."""
    # w x = A x + B u with w = (a z + b) / (c z + d): (a - c A) z x = (d A - b) x + (c z + d) B u; the part z u goes
    # into the states.
    E = a * np.eye(system.A.shape[-1]) - c * system.A
    A = np.linalg.solve(E, d * system.A - b * np.eye(system.A.shape[-1]))
    B = np.linalg.solve(E, system.B)
    return StateSpace(A, B, system.C @ (c * A + d * np.eye(len(A))), system.D + c * system.C @ B)


def _root(gramian: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))


@dataclass(frozen=True)
class Norms:
    """How large each block is."""

    absolute: FloatArray  # (4, n_function + 1): Euclidean norm of each of the matrices A, B, C, D of each function
    # (4, n_function): what a block's norm is multiplied by to be relative to the constant block: the largest value of
    # its function over the norm of the constant block.
    scale: FloatArray

    @property
    def relative(self) -> FloatArray:
        """What each block contributes at most, relative to the constant block (4, n_function)."""
        return self.absolute[:, 1:] * self.scale


def measure(parameters: FloatArray, largest: FloatArray, sizes: Sizes) -> Norms:
    """Measures the blocks of a model (n_function + 1, n_local), by the largest value (n_function,) of each function.

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
    """Which elements a penalty puts together."""

    free: IntArray  # (n_free,): places of the elements that may differ from zero, in the model row by row
    members: tuple[IntArray, ...]  # places of each penalised block's elements among the free ones
    where: IntArray  # (n_block, 2): matrix and function (counted from 0, without the constant one) of each block


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
