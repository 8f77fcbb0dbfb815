"""A step of the penalised fit as one would write it with cvxpy: all rows of the data in the program."""

import cvxpy
import numpy as np

from robid.models.lpv.fit.responses import local_jacobian


def stacked_rows(problem, point, free):
    """The real error and its derivative by the free elements, all positions, lines and elements."""
    error, slope = local_jacobian(problem, point)
    full = np.einsum("qk,qrl->qrkl", problem.values, slope).reshape(error.size, -1)[:, free]
    return np.concatenate([error.real.ravel(), error.imag.ravel()]), np.concatenate([full.real, full.imag])


def cvxpy_step(priced, point, damping):
    """The step by cvxpy and clarabel, from the stacked rows."""
    error, slope = stacked_rows(priced.problem, priced.place(point), priced.blocks.free)
    step = cvxpy.Variable(point.size)
    norms = [
        price * cvxpy.norm(point[own] + step[own])
        for price, own in zip(priced.prices, priced.blocks.members, strict=True)
    ]
    root = np.sqrt(damping) * np.linalg.norm(slope, axis=0)
    squares = cvxpy.sum_squares(slope @ step + error) + cvxpy.sum_squares(cvxpy.multiply(root, step))
    program = cvxpy.Problem(cvxpy.Minimize(squares + sum(norms)), [priced.basis_changes(point).T @ step == 0])
    program.solve(solver=cvxpy.CLARABEL)
    return step.value
