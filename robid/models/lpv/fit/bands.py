"""Responses of a model in its outputs' own units, integrators included, with their deviations."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.lpv.fit.model import LpvModel
from robid.models.lpv.fit.responses import LocalResponses, make_problem
from robid.models.lpv.fit.state_space import Sizes, StateSpace, pack, unpack
from robid.models.lpv.fit.uncertainty import ResponseUncertainty, response_uncertainty


def rescaled(parameters: FloatArray, sizes: Sizes, scales: FloatArray) -> FloatArray:
    """Multiplies the outputs of packed matrices (n_function + 1, n_local) by scales (n_out,)."""
    inside = unpack(parameters, sizes)
    return pack(StateSpace(inside.A, inside.B, inside.C * scales[:, None], inside.D * scales[:, None]))


def model_response(
    core: LpvModel,
    scales: FloatArray,
    covariance: FloatArray,
    integrators: tuple[int, ...],
    points: FloatArray,
    frequency_hz: FloatArray,
) -> ResponseUncertainty:
    """Returns the response, integrators included, with its deviations.

    Args:
        core: The model without integrators, in the outputs' own units.
        scales (n_out,): Units of the outputs in which the covariance is.
        covariance (n_param, n_param): Of the core's parameters.
        integrators: How often each output integrates.
        points (n_pos, n_scheduling): Scheduling parameters.
        frequency_hz (n_freq,): Lines.

    Raises:
        DataError: If a point lies outside the range.
    """
    empty = np.zeros((len(points), len(frequency_hz), core.sizes.n_out, core.sizes.n_in), complex)
    asked = LocalResponses(points, frequency_hz, empty, None, core.sampling_period_s)
    problem = make_problem(asked, core.basis, core.sizes.n_state, scales, weighted=False)
    scaled = response_uncertainty(problem, rescaled(core.parameters, core.sizes, 1 / scales), covariance)
    behind = ((asked.z[:, None] - 1) / asked.sampling_period_s) ** np.array(integrators)
    factor = (scales / behind)[..., None]
    return ResponseUncertainty(scaled.response * factor, scaled.total * np.abs(factor))
