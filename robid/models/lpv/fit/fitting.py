"""A fit from responses to what is kept of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.agreement import agree
from robid.models.lpv.fit.bands import rescaled
from robid.models.lpv.fit.basis import make_basis
from robid.models.lpv.fit.blocks import measure
from robid.models.lpv.fit.estimation import LpvResult, estimate_lpv
from robid.models.lpv.fit.options import BasisOptions, LpvOptions
from robid.models.lpv.fit.parameters import estimate_poles
from robid.models.lpv.fit.path import Path
from robid.models.lpv.fit.responses import LocalResponses
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
from robid.models.lpv.fit.uncertainty import ResponseUncertainty


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
    """Identifies a model.

    Args:
        own: What is fitted; the basis holds over the range of its positions.
        choosing: What chooses the structure.
        ports: Channels and scheduling parameters.
        basis: Options of the basis functions.
        options: Options of the fit.
        degrees_of_freedom: Behind the responses' variances.
        confidence: Level of the intervals.
        identifiable_relative_std: Relative deviation up to which a parameter counts as identifiable.

    Raises:
        DataError: If weights are asked for and the variance is unknown, there are too few positions or lines, a
            position lies outside the range, or a local model is unstable.
    """
    for each in (own, choosing):
        if options.weighted and (each.variance is None or not np.all(each.variance > 0)):
            message = "The responses have no covariance that could weigh them."
            raise DataError(message, remedy="measure several realizations or periods, or set `weighted: false`")
    found = estimate_lpv(own, choosing, make_basis(own.points, basis), options)
    found = _widened(found) if options.weighted else found
    best, covariance = found.path.best, found.parameters.covariance
    norms = measure(found.core.parameters, found.core.basis.largest, found.core.sizes)
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
        dense=Dense(found.smile.parameters, _full(found)),
        blocks=BlockTable(found.kept, norms.absolute, norms.relative),
        path=_tabulated(found.path),
        own=_held(found, own, degrees_of_freedom),
        choosing=_held(found, choosing, degrees_of_freedom),
        misfit=found.parameters.misfit,
        largest_pole=found.stability.radius,
        largest_pole_at=found.stability.point,
    )


def hold(responses: LocalResponses, model: ResponseUncertainty, degrees_of_freedom: float, *, seen: bool) -> Held:
    """Holds a model against responses.

    Args:
        responses: What was measured.
        model: The model's response there.
        degrees_of_freedom: Behind the responses' variances.
        seen: Whether the fit saw them; if not, what the parameters may be off counts too.
    """
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


def _widened(found: LpvResult) -> LpvResult:
    """Widens intervals by what the residual is beyond its weights: the model, or the variances, are off by as much."""
    parameters = found.parameters
    covariance = parameters.covariance * max(1.0, parameters.misfit)
    return replace(found, parameters=replace(parameters, covariance=covariance))


def _held(found: LpvResult, responses: LocalResponses, degrees_of_freedom: float) -> Held:
    model = found.uncertainty(responses.points, responses.frequency_hz)
    return hold(responses, model, degrees_of_freedom, seen=True)


def _full(found: LpvResult) -> FloatArray:
    """The model without prices, outputs in their own units."""
    return rescaled(found.path.points[0].parameters, found.core.sizes, found.scales)


def _tabulated(path: Path) -> PathTable:
    points = path.points
    return PathTable(
        gamma=np.array([point.gamma for point in points]),
        kept=np.array([point.kept for point in points]),
        relative=np.array([point.relative for point in points]),
        refit_cost=np.array([point.refit_cost for point in points]),
        validation_cost=np.array([point.validation_cost for point in points]),
        steps=np.array([point.steps for point in points]),
        status=tuple(point.status for point in points),
        chosen=path.chosen,
    )
