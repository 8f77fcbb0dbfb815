"""Residuals of a fitted elastic model over frequency, as its fit weighs them."""

from __future__ import annotations

import numpy as np

from robid.models.elastic.judge.fitted import ModelAt
from robid.results.line_residuals import LineResiduals


def line_residuals(fitted: ModelAt) -> LineResiduals:
    """Compares a model with its response in every element that carries weight.

    A deviation is what noise and the assumed model error give together, as in the cost of the fit: the mean square in
    deviations over all elements is the misfit where the weights are those of the deviations.
    """
    problem, internal = fitted.problem, fitted.internal
    kind, frf = problem.residual_kind, problem.frf
    modelled, measured = problem.model_response(internal), problem.measured(internal)
    used = (problem.weight > 0) & (modelled != 0)
    shown = np.where(modelled == 0, 1.0, modelled)
    variance = np.where(used, frf.element_variance() / np.abs(shown) ** 2, np.nan)
    # Expected squares of weighted residuals: of a relative error e, per^2 e^2, of which a real residual has half.
    scale = 0.5 * kind.parts * problem.weight * np.abs(kind.per_relative(shown)) ** 2
    by_noise, by_model = scale * variance, scale * problem.model_error**2
    expected = np.where(used & (by_noise + by_model > 0), by_noise + by_model, np.nan)
    weighted = np.abs(problem.weighted(problem.residual(internal, modelled)))
    return LineResiduals(
        relative=np.where(used, np.abs(measured - modelled) / np.abs(shown), np.nan),
        noise=np.sqrt(np.where(variance > 0, variance, np.nan)),
        deviations=weighted / np.sqrt(expected),
        noise_deviations=np.sqrt(np.where(variance > 0, by_noise, np.nan) / expected),
    )
