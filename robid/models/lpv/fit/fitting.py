"""A fit from responses to what is kept of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.local import (
    LocalModels,
    align_neighbours,
    check_positions,
    fit_local_models,
    interpolate,
    middle_position,
)
from robid.models.lpv.fit.model import Basis, LpvModel, add_integrators, different_positions, largest_pole, make_basis
from robid.models.lpv.fit.options import BasisOptions, LpvOptions
from robid.models.lpv.fit.path import Path, find_sparse_bases, follow_path
from robid.models.lpv.fit.responses import (
    LocalResponses,
    Problem,
    agree,
    make_problem,
    output_scales,
    remove_integrators,
    solve,
)
from robid.models.lpv.fit.solution import (
    BlockTable,
    Core,
    Dense,
    Held,
    LpvSolution,
    Matrices,
    PathTable,
    Ports,
    tabulate_basis,
)
from robid.models.lpv.fit.state_space import StateSpace, measure, spread
from robid.models.lpv.fit.uncertainty import (
    ParameterUncertainty,
    ResponseUncertainty,
    estimate_poles,
    model_response,
    parameter_uncertainty,
    rescaled,
)

_FIRST_STEPS = 10


@dataclass(frozen=True)
class LpvResult:
    """What a fit found."""

    local: LocalModels  # the local models, outputs in units of `scales`, each in its balanced basis
    smile: LpvModel  # their interpolation without integrators, in the outputs' own units
    core: LpvModel  # the chosen model without integrators, in the outputs' own units
    model: LpvModel  # the chosen model with its integrators
    path: Path  # the regularisation path, outputs in units of `scales`
    kept: BoolArray  # (4, n_function): blocks of A, B, C and D that the chosen model has
    scales: FloatArray  # (n_out,): units of the outputs during the fit
    parameters: ParameterUncertainty  # how far the chosen model's parameters may be off, outputs in units of `scales`
    largest_pole: tuple[float, FloatArray]  # of the chosen model over the range, integrators not counted; and where
    integrators: tuple[int, ...]  # how often each output integrates

    def uncertainty(self, points: FloatArray, frequency_hz: FloatArray) -> ResponseUncertainty:
        """Returns the response at points (n_pos, n_scheduling), integrators included, with its deviations.

        Raises:
            DataError: If a point lies outside the range.
        """
        covariance = self.parameters.covariance
        return model_response(self.core, self.scales, covariance, self.integrators, points, frequency_hz)


def estimate_lpv(responses: LocalResponses, validation: LocalResponses, basis: Basis, options: LpvOptions) -> LpvResult:
    """Identifies one sparse model from frequency responses at several positions; others choose the structure.

    Raises:
        DataError: If there are too few positions or lines, a position lies outside the range, or a local model is
            unstable.

    Source:
        Turk et al. (2018), sec. II-C and III-B.
    """
    integrators = options.integrators or (0,) * responses.response.shape[2]
    reduced, held_out = remove_integrators(responses, integrators), remove_integrators(validation, integrators)
    scales = output_scales(reduced)
    problem, judge = (
        make_problem(one, basis, options.order, scales, weighted=options.weighted, window=options.weight_window)
        for one in (reduced, held_out)
    )
    check_positions(problem.values[different_positions(responses.points)])
    local = fit_local_models(problem)
    aligned = align_neighbours(local.systems, responses.points)
    path = follow_path(
        problem,
        judge,
        _starts(problem, aligned, responses, basis, options),
        basis.largest,
        options.path,
        options.sparsity,
    )
    # The problem is posed in units of the outputs' scales, so variances are, too.
    variance = None if reduced.variance is None else reduced.variance / scales[:, None] ** 2
    free = spread(path.best.kept, problem.sizes)
    smile, core = (
        LpvModel(rescaled(parameters, problem.sizes, scales), problem.sizes, basis, responses.sampling_period_s)
        for parameters in (interpolate(aligned, problem.values), path.best.parameters)
    )
    return LpvResult(
        local=local,
        smile=smile,
        core=core,
        model=add_integrators(core, integrators),
        path=path,
        kept=path.best.kept,
        scales=scales,
        parameters=parameter_uncertainty(problem, path.best.parameters, free, variance),
        largest_pole=largest_pole(core),
        integrators=integrators,
    )


def _starts(
    problem: Problem, aligned: StateSpace, responses: LocalResponses, basis: Basis, options: LpvOptions
) -> tuple[FloatArray, ...]:
    """Begins fits without prices, from the interpolation in each basis in which few blocks vary.

    Only begins: with more positions than functions, a fit goes on for long and far from that basis for next to nothing.
    """
    fixed = middle_position(responses.points)
    bases = find_sparse_bases(aligned, problem.values, basis.largest, fixed=fixed, options=options.sparse_basis)
    guesses = (interpolate(one, problem.values) for one in bases)
    return tuple(solve(problem, guess, max_iterations=_FIRST_STEPS)[0] for guess in guesses)


def fit_lpv(
    own: LocalResponses,
    choosing: LocalResponses,
    ports: Ports,
    basis: BasisOptions,
    options: LpvOptions,
    *,
    degrees_of_freedom: float,
    confidence: float,
    identifiable_relative_std: float,
) -> LpvSolution:
    """Identifies a model; the basis holds over the range of the fitted positions, other responses choose the structure.

    Raises:
        DataError: If weights are asked for and the variance is unknown, there are too few positions or lines, a
            position lies outside the range, or a local model is unstable.
    """
    for each in (own, choosing):
        if options.weighted and (each.variance is None or not np.all(each.variance > 0)):
            message = "D167 The responses have no covariance that could weigh them."
            raise DataError(message, remedy="measure several realizations or periods, or set `weighted: false`")
    found = estimate_lpv(own, choosing, make_basis(own.points, basis), options)
    if options.weighted:
        # What the residual is beyond its weights widens intervals: the model, or the variances, are off by as much.
        wider = found.parameters.covariance * max(1.0, found.parameters.misfit)
        found = replace(found, parameters=replace(found.parameters, covariance=wider))
    best, covariance = found.path.best, found.parameters.covariance
    norms = measure(found.core.parameters, found.core.basis.largest, found.core.sizes)
    full = rescaled(found.path.points[0].parameters, found.core.sizes, found.scales)
    return LpvSolution(
        estimate=estimate_poles(
            found.core,
            covariance,
            own.points,
            best.status,
            confidence=confidence,
            identifiable_relative_std=identifiable_relative_std,
        ),
        ports=ports,
        basis=tabulate_basis(found.core.basis),
        matrices=Matrices(*found.model.coefficients.matrices),
        core=Core(found.core.parameters, covariance, found.scales, found.integrators, found.core.sizes.n_state),
        dense=Dense(found.smile.parameters, full),
        blocks=BlockTable(found.kept, norms.absolute, norms.relative),
        path=_tabulated(found.path),
        own=_held(found, own, degrees_of_freedom),
        choosing=_held(found, choosing, degrees_of_freedom),
        misfit=found.parameters.misfit,
        largest_pole=found.largest_pole[0],
        largest_pole_at=found.largest_pole[1],
    )


def hold(responses: LocalResponses, model: ResponseUncertainty, degrees_of_freedom: float, *, seen: bool) -> Held:
    """Holds a model against responses; where no fit saw them, what the parameters may be off counts too."""
    unknown = np.full(responses.response.shape, np.nan)
    std = unknown if responses.variance is None else np.sqrt(responses.variance)
    expected = std if seen else np.hypot(std, model.total)
    agreement = agree(responses.response, model.response, expected, std)
    return Held(
        points=responses.points,
        frequency_hz=responses.frequency_hz,
        response=responses.response,
        std=std,
        modelled=model.response,
        modelled_std=model.total,
        degrees_of_freedom=degrees_of_freedom,
        agreement=agreement,
    )


def _held(found: LpvResult, responses: LocalResponses, degrees_of_freedom: float) -> Held:
    model = found.uncertainty(responses.points, responses.frequency_hz)
    return hold(responses, model, degrees_of_freedom, seen=True)


def _tabulated(path: Path) -> PathTable:
    numbers = ("gamma", "kept", "relative", "refit_cost", "validation_cost", "steps")
    columns: dict[str, Any] = {name: np.array([getattr(point, name) for point in path.points]) for name in numbers}
    return PathTable(**columns, status=tuple(point.status for point in path.points), chosen=path.chosen)
