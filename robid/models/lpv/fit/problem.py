"""The weighted error of a model against local frequency responses, and its derivative, reduced position by position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.lpv.fit.state_space import Sizes, resolvent, unpack
from robid.results.levenberg import Minimum, Normal, minimise

_MEANT_NOTHING = 1e-3  # decrease of the cost, in mean squared errors of one element


@dataclass(frozen=True)
class Problem:
    """What a model is held against. Its parameters are packed matrices (n_function + 1, n_local), a row a function."""

    z: ComplexArray  # (n_freq,): points of the unit circle
    response: ComplexArray  # (n_pos, n_freq, n_out, n_in): measured responses
    root_weight: FloatArray  # (n_pos, n_freq, n_out, n_in): root of each element's weight; 0 leaves an element out
    values: FloatArray  # (n_pos, n_function + 1): the basis functions at the positions, the constant one first
    sizes: Sizes  # of the model

    @property
    def n_data(self) -> int:
        """Complex elements that count."""
        return int(np.count_nonzero(self.root_weight))


@dataclass(frozen=True)
class Reduced:
    """Error and derivative with their rows reduced: `|e_q + J_q d|^2 = |right_q + factor_q d|^2 + rest`."""

    # (n_pos, n_local, n_local): triangular factor of each position's derivative by its local matrices.
    factor: FloatArray
    right: FloatArray  # (n_pos, n_local): the error, rotated alike
    cost: float  # the cost, all rows
    values: FloatArray  # (n_pos, n_function + 1): as in the problem

    @property
    def rows(self) -> FloatArray:
        """The derivative (n_pos n_local, n_param) by all parameters."""
        n_pos, n_local = self.right.shape
        full = np.einsum("qk,qij->qikj", self.values, self.factor)
        return np.asarray(full.reshape(n_pos * n_local, -1))


def errors(problem: Problem, parameters: FloatArray) -> ComplexArray:
    """Returns the weighted error (n_pos, n_freq, n_out, n_in) of a model.

    Source:
        Turk et al. (2018), eq. 9.
    """
    system = unpack(problem.values @ parameters, problem.sizes)
    inner = system.C[:, None] @ resolvent(system.A, problem.z) @ system.B[:, None]
    return (inner + system.D[:, None] - problem.response) * problem.root_weight


def cost(problem: Problem, parameters: FloatArray) -> float:
    """Returns the cost `V` of a model.

    Source:
        Turk et al. (2018), eq. 7.
    """
    return float(np.sum(np.abs(errors(problem, parameters)) ** 2))


def local_jacobian(problem: Problem, parameters: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Returns the weighted error (n_pos, n_row) and its derivative (n_pos, n_row, n_local) by the local matrices."""
    local = unpack(problem.values @ parameters, problem.sizes)
    inverse = resolvent(local.A, problem.z)
    ahead, behind = local.C[:, None] @ inverse, inverse @ local.B[:, None]
    error = (ahead @ local.B[:, None] + local.D[:, None] - problem.response) * problem.root_weight
    n_pos, n_freq, n_out, n_in = problem.response.shape
    shape = (n_pos, n_freq, n_out, n_in, problem.sizes.n_local)
    slope = np.zeros(shape, complex)
    parts = problem.sizes.parts
    slope[..., parts[0]] = np.einsum("qfoa,qfbi->qfoiab", ahead, behind).reshape(*shape[:4], -1)
    slope[..., parts[1]] = np.einsum("qfoa,ij->qfoiaj", ahead, np.eye(n_in)).reshape(*shape[:4], -1)
    slope[..., parts[2]] = np.einsum("op,qfbi->qfoipb", np.eye(n_out), behind).reshape(*shape[:4], -1)
    slope[..., parts[3]] = np.einsum("op,ij->oipj", np.eye(n_out), np.eye(n_in)).reshape(n_out, n_in, -1)
    slope *= problem.root_weight[..., None]
    return error.reshape(n_pos, -1), slope.reshape(n_pos, -1, problem.sizes.n_local)


def reduce_rows(problem: Problem, parameters: FloatArray) -> Reduced:
    """Reduces error and derivative to as many rows a position as a local model has elements.

    A local derivative does not know the basis functions: only the triangular factors are spread over them.
    """
    error, slope = local_jacobian(problem, parameters)
    n_local = problem.sizes.n_local
    rows = np.concatenate([slope, error[..., None]], axis=2)
    rows = np.concatenate([rows.real, rows.imag], axis=1)
    short = n_local + 1 - rows.shape[1]
    if short > 0:
        rows = np.concatenate([rows, np.zeros((len(rows), short, n_local + 1))], axis=1)
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    value = float(np.sum(np.abs(error) ** 2))
    return Reduced(triangle[:, :n_local, :n_local], triangle[:, :n_local, n_local], value, problem.values)


def normal(problem: Problem, parameters: FloatArray) -> Normal:
    """Returns cost, half gradient and half Gauss-Newton Hessian by all parameters, row by row."""
    reduced = reduce_rows(problem, parameters)
    rows = reduced.rows
    return Normal(reduced.cost, rows.T @ reduced.right.ravel(), rows.T @ rows)


def solve(
    problem: Problem, start: FloatArray, *, free: BoolArray | None = None, max_iterations: int = 200
) -> tuple[FloatArray, Minimum]:
    """Minimises the cost from a start.

    The states' basis is free, so some directions move no response: the gradient has no part in them, and damping
    keeps them out of every step.

    Args:
        problem: What the model is held against.
        start (n_function + 1, n_local): Where to start.
        free (n_function + 1, n_local): Which elements may move; all by default.
        max_iterations: Limit on steps.

    Returns:
        The model (n_function + 1, n_local) and how the descent ended.

    Source:
        Turk et al. (2018), eq. 11.
    """
    moved = np.ones(start.size, bool) if free is None else free.ravel()

    def place(inside: FloatArray) -> FloatArray:
        full = start.ravel().copy()
        full[moved] = inside
        return full.reshape(start.shape)

    def model(inside: FloatArray) -> Normal:
        here = normal(problem, place(inside))
        return Normal(here.cost, here.gradient[moved], here.hessian[np.ix_(moved, moved)])

    found = minimise(
        lambda inside: cost(problem, place(inside)),
        model,
        start.ravel()[moved],
        max_iterations=max_iterations,
        cost_tolerance=_MEANT_NOTHING / max(problem.n_data, 1),
    )
    return place(found.parameters), found
