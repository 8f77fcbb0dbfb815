"""The penalised fit: cone programs as steps, weights and estimate in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.lpv.fit.blocks import list_blocks, measure, spread
from robid.models.lpv.fit.options import SparsityOptions
from robid.models.lpv.fit.penalised import Penalised, descend
from robid.models.lpv.fit.problem import Problem


@dataclass(frozen=True)
class SparseFit:
    """Where a penalised fit ended.

    Attributes:
        parameters (n_function + 1, n_local): The model, vanished blocks exactly zero.
        kept (4, n_function): Which blocks are left.
        steps: Cone programs solved.
    """

    parameters: FloatArray
    kept: BoolArray
    steps: int


def fit_sparse(
    problem: Problem, start: FloatArray, largest: FloatArray, gamma: float, options: SparsityOptions
) -> SparseFit:
    """Fits a model whose blocks have a price, until the prices stay.

    A block that has vanished stays so.

    Args:
        problem: What the model is held against.
        start (n_function + 1, n_local): A fit without prices.
        largest (n_function,): Largest value of each basis function.
        gamma: Price of a block, in units of the cost.
        options: When to stop.

    Source:
        Turk et al. (2018), sec. II-C, eq. 12-16.
    """
    parameters, kept, steps, passes = start, np.ones((4, len(largest)), bool), 0, 0
    relative = measure(start, largest, problem.sizes).relative
    while kept.any() and passes < options.reweightings:
        passes += 1
        scale = measure(parameters, largest, problem.sizes).scale
        price = gamma * scale / (relative + options.epsilon)
        priced = Penalised(problem, list_blocks(kept, problem.sizes), price)
        descent = descend(priced, parameters, tolerance=options.tolerance, step_limit=options.step_limit)
        parameters, steps = descent.parameters, steps + descent.steps
        before, relative = relative, measure(parameters, largest, problem.sizes).relative
        kept = kept & (relative > options.zero)
        parameters = parameters * spread(kept, problem.sizes)
        if np.all(np.abs(relative - before) <= options.settled * (before + options.epsilon)):
            break
    return SparseFit(parameters, kept, steps)
