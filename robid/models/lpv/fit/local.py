"""One linear model per position, by nonlinear least squares on its frequency response."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.problem import Problem, solve
from robid.models.lpv.fit.state_space import StateSpace, balance, pack, stack, unpack
from robid.models.lpv.fit.subspace import subspace_model
from robid.results.levenberg import Status


@dataclass(frozen=True)
class LocalModels:
    """Linear models at the positions, each in a basis of its own.

    Attributes:
        systems: One model per position.
        cost (n_pos,): What each leaves of its response.
        status: How each fit ended.
    """

    systems: StateSpace
    cost: FloatArray
    status: tuple[Status, ...]


def fit_local_models(problem: Problem, *, max_iterations: int = 100) -> LocalModels:
    """Fits one model of the problem's order at every position.

    Every fit starts from subspace models, then also from its neighbours' results: the better one stays, a stable one
    before any that is not.

    Args:
        problem: The responses; its basis functions play no part.
        max_iterations: Limit on steps of one descent.

    Raises:
        DataError: If there are too few lines for the order, or a model is unstable.
    """
    n_state, n_out, n_in = problem.sizes.n_state, problem.sizes.n_out, problem.sizes.n_in
    told = np.count_nonzero(problem.root_weight, axis=(1, 2, 3)) * 2
    # Subspace models, with which every fit begins, have a block row to spare.
    most = min((int(told.min()) - n_out * n_in) // (n_out + n_in), (len(problem.z) // 2 - 1) * n_out)
    if n_state > most:
        raise DataError(
            f"The lines are too few for {n_state} states.",
            where=f"position {int(np.argmin(told))}",
            remedy=f"Measure more lines, or lower `order` to {max(most, 1)} at most.",
        )
    n_pos = len(problem.response)
    found = [_fit(at_position(problem, index), max_iterations) for index in range(n_pos)]
    for index in [*range(1, n_pos), *range(n_pos - 2, -1, -1)]:
        for neighbour in {max(index - 1, 0), min(index + 1, n_pos - 1)} - {index}:
            again = _descend(at_position(problem, index), found[neighbour][0], max_iterations)
            found[index] = min(found[index], again, key=_rank)
    systems = [balanced_or_refused(system, index) for index, (system, _, _) in enumerate(found)]
    return LocalModels(stack(systems), np.array([one[1] for one in found]), tuple(one[2] for one in found))


def at_position(problem: Problem, index: int) -> Problem:
    """Returns the problem of one position alone: a model that does not change."""
    only = slice(index, index + 1)
    return replace(
        problem, response=problem.response[only], root_weight=problem.root_weight[only], values=np.ones((1, 1))
    )


def balanced_or_refused(system: StateSpace, index: int) -> StateSpace:
    """Returns a local model in its balanced basis.

    Raises:
        DataError: If the model is unstable, or has a state without effect.
    """
    radius = float(system.spectral_radius)
    if radius >= 1:
        raise DataError(
            f"The local model has a pole of absolute value {radius:.6g}: it is unstable.",
            where=f"position {index}",
            remedy="State the `integrators` that the response has, no fewer and no more; lower `order`; or measure more"
            " lines and periods there.",
        )
    return balance(system)[0]


def _fit(problem: Problem, max_iterations: int) -> tuple[StateSpace, float, Status]:
    """The best descent from subspace models of several depths."""
    n_state, n_freq = problem.sizes.n_state, len(problem.z)
    depths = {min(depth, n_freq // 2) for depth in (n_state + 1, 2 * n_state + 2, 4 * n_state + 4)}
    starts = [
        subspace_model(problem.z, problem.response[0], problem.root_weight[0], order=n_state, n_block=depth)
        for depth in sorted(depths)
    ]
    return min((_descend(problem, start, max_iterations) for start in starts), key=_rank)


def _rank(found: tuple[StateSpace, float, Status]) -> tuple[bool, float]:
    """Stable models first, then by cost: a pole outside the circle may fit noise no better than one inside."""
    return bool(found[0].spectral_radius >= 1), found[1]


def _descend(problem: Problem, start: StateSpace, max_iterations: int) -> tuple[StateSpace, float, Status]:
    if start.spectral_radius < 1:
        with suppress(DataError):  # a start may have more states than it needs
            start = balance(start)[0]
    parameters, minimum = solve(problem, pack(start)[None], max_iterations=max_iterations)
    return unpack(parameters[0], problem.sizes), minimum.cost, minimum.status
