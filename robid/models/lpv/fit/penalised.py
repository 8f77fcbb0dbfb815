"""The fit at fixed prices of its blocks: Levenberg-Marquardt steps that are cone programs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.lpv.fit.blocks import Blocks
from robid.models.lpv.fit.cone_program import minimise_model
from robid.models.lpv.fit.problem import Problem, cost, normal
from robid.models.lpv.fit.state_space import similarity_tangent, unpack

_FIRST_DAMPING = 1e-4
_LEAST_DAMPING = 1e-9
_MOST_DAMPING = 1e8
_SMALL_DAMPING = 1e-2  # a small decrease under more damping ends nothing


@dataclass(frozen=True)
class Penalised:
    """Cost plus prices times norms of blocks.

    Attributes:
        problem: What the model is held against.
        blocks: Elements that may move, and those that have a price together.
        price (4, n_function): What a block's norm costs.
    """

    problem: Problem
    blocks: Blocks
    price: FloatArray

    @property
    def prices(self) -> FloatArray:
        """What the norm of each kept block costs (n_block,)."""
        return np.asarray(self.price[self.blocks.where[:, 0], self.blocks.where[:, 1]])

    def place(self, point: FloatArray) -> FloatArray:
        """Returns the model (n_function + 1, n_local) of free elements (n_free,)."""
        full = np.zeros((self.problem.values.shape[1], self.problem.sizes.n_local))
        full.ravel()[self.blocks.free] = point
        return full

    def penalty(self, point: FloatArray) -> float:
        """Returns what the blocks cost."""
        norms = [np.linalg.norm(point[member]) for member in self.blocks.members]
        return float(self.prices @ np.array(norms))

    def objective(self, point: FloatArray) -> float:
        """Returns cost and penalty."""
        return cost(self.problem, self.place(point)) + self.penalty(point)

    def basis_changes(self, point: FloatArray) -> FloatArray:
        """Returns directions (n_free, n_state^2) in which the states' basis alone changes, orthonormal.

        They alter no structure and no response, but norms would drift along them.
        """
        tangent = similarity_tangent(unpack(self.place(point), self.problem.sizes))
        return np.asarray(np.linalg.qr(tangent.reshape(-1, tangent.shape[-1])[self.blocks.free])[0])


@dataclass(frozen=True)
class Descent:
    """Where a descent at fixed prices ended.

    Attributes:
        parameters (n_function + 1, n_local): The model.
        objective: Cost and penalty there.
        steps: Cone programs solved.
    """

    parameters: FloatArray
    objective: float
    steps: int


@dataclass(frozen=True)
class Quadratic:
    """The cost about one point.

    Attributes:
        cost: The cost there.
        gradient (n_free,): Half its gradient by the free elements.
        hessian (n_free, n_free): Half its Gauss-Newton Hessian.
        held (n_free, n_held): Directions that take no part in a step.
    """

    cost: float
    gradient: FloatArray
    hessian: FloatArray
    held: FloatArray

    def value(self, step: FloatArray) -> float:
        """Returns the quadratic model after a step."""
        return self.cost + float(step @ (2 * self.gradient + self.hessian @ step))


def descend(priced: Penalised, start: FloatArray, *, tolerance: float, step_limit: int) -> Descent:
    """Minimises cost plus prices times norms.

    Args:
        priced: What is minimised.
        start (n_function + 1, n_local): Where to start.
        tolerance: Relative decrease, had or foreseen, at which to stop.
        step_limit: Cone programs at most.
    """
    point = start.ravel()[priced.blocks.free]
    objective, here = priced.objective(point), _expand(priced, point)
    damping, growth, steps = _FIRST_DAMPING, 2.0, 0
    while steps < step_limit and damping < _MOST_DAMPING:
        steps += 1
        trial = point + take_step(priced, point, here, damping)
        foreseen = objective - here.value(trial - point) - priced.penalty(trial)
        had = objective - priced.objective(trial)
        small = tolerance * objective if damping <= _SMALL_DAMPING else 0.0
        if had > 0:
            point, objective = trial, objective - had
            gain = had / foreseen if foreseen > 0 else 1.0
            damping, growth = max(damping * max(1 / 5, 1 - (2 * gain - 1) ** 3), _LEAST_DAMPING), 2.0
        else:
            damping, growth = damping * growth, growth * 2
        if foreseen <= small or 0 < had <= small:
            break
        if had > 0:
            here = _expand(priced, point)
    return Descent(priced.place(point), objective, steps)


def _expand(priced: Penalised, point: FloatArray) -> Quadratic:
    full, free = normal(priced.problem, priced.place(point)), priced.blocks.free
    return Quadratic(full.cost, full.gradient[free], full.hessian[np.ix_(free, free)], priced.basis_changes(point))


def take_step(priced: Penalised, point: FloatArray, here: Quadratic, damping: float) -> FloatArray:
    """Returns the step (n_free,) from a point (n_free,) under a damping relative to the Hessian's diagonal."""
    curved = here.hessian + np.diag(damping * np.diag(here.hessian))
    return minimise_model(curved, here.gradient, point, priced.blocks.members, priced.prices, here.held)
