"""The figures of the study of estimators, from the results of its tasks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, require_controller
from robid.simulate.truth import true_robot, with_imperfections
from robid.studies.frf.estimators import elements, error_ratio, scatter
from robid.studies.frf.study import campaign_of


@dataclass(frozen=True)
class Found:
    """The tasks' results of all configurations together.

    Attributes:
        frequency_hz (n_freq,): Excited frequencies [Hz].
        configurations (n_conf, n_joint): Arm-side joint angles [rad].
        response (n_estimate, n_conf, n_group, n_freq, n_out, n_in): Each group's estimates; NaN where refused.
        variance: Variance that each reports, of the same shape.
        whole (n_compensation, n_conf, n_freq, n_out, n_in): Best linear approximation from all realizations.
        refusals (n_estimate + 1,): First reason of a refusal, or ""; that of `whole` last.
    """

    frequency_hz: FloatArray
    configurations: FloatArray
    response: ComplexArray
    variance: FloatArray
    whole: ComplexArray
    refusals: tuple[str, ...]


def gather(results: Sequence[Artifact]) -> Found:
    """Puts the tasks' results together, those of one configuration along the groups."""
    values = [{name: dataset.values for name, dataset in result.datasets.items()} for result in results]
    index = np.array([int(one["configuration"]) for one in values])
    rows = [[values[at] for at in np.flatnonzero(index == chosen)] for chosen in np.unique(index)]

    def joined(name: str) -> Any:  # noqa: ANN401
        return np.stack([np.concatenate([one[name] for one in row], axis=1) for row in rows], axis=1)

    whole = [
        np.average([one["whole"] for one in row], axis=0, weights=[float(one["realizations"]) for one in row])
        for row in rows
    ]
    return Found(
        frequency_hz=values[0]["frequency_hz"],
        configurations=np.array([row[0]["angles"] for row in rows]),
        response=joined("response"),
        variance=joined("variance"),
        whole=np.stack(whole, axis=1),
        refusals=tuple(
            next((reason for reason in reasons if reason), "")
            for reasons in zip(*(one["refusals"].tolist() for one in values), strict=True)
        ),
    )


def true_response(loaded: LoadedExperiment, found: Found) -> ComplexArray:
    """Returns the response of the true robot's frictionless linearisation (n_conf, n_freq, n_motor, n_motor)."""
    _, campaign, options = campaign_of(loaded)
    stated = loaded.robot.to_robot(campaign.payload_kg)
    robot = with_imperfections(true_robot(stated, options.truth), options.imperfections)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, found.configurations))
    parameters = nominal_parameters(robot, linear, delay_s(loaded, campaign))
    period_s = require_controller(loaded).sampling_period_s
    return response(linear, parameters, found.frequency_hz, period_s).sampled


@dataclass(frozen=True)
class EstimatorFigures:
    """One estimator against the best linear approximation.

    Attributes:
        name: Name of the estimator.
        error_hz (n_freq,): Median error on the diagonal at each line.
        std_ratio_hz (n_freq,): Median ratio of reported to true standard deviation there.
        figures: Figures by name, as they stand in summary.json.
    """

    name: str
    error_hz: FloatArray
    std_ratio_hz: FloatArray
    figures: dict[str, float]


def estimator_figures(
    name: str, estimates: ComplexArray, variance: FloatArray, reference: ComplexArray, default: ComplexArray
) -> EstimatorFigures:
    """Compares one estimator with the best linear approximation and with the default estimator.

    Args:
        name: Name of the estimator.
        estimates (n_conf, n_group, n_freq, n_out, n_in): Its estimates; NaN where refused.
        variance (n_conf, n_group, n_freq, n_out, n_in): Variance that each reports.
        reference (n_conf, n_freq, n_out, n_in): Best linear approximation.
        default (n_conf, n_group, n_freq, n_out, n_in): Estimates of the default estimator.
    """
    found = scatter(estimates, variance, reference)
    figures = {
        "median_error": _quantile(found.error, 0.5),
        "q90_error": _quantile(found.error, 0.9),
        "median_bias": _quantile(found.bias, 0.5),
        "std_ratio": _quantile(found.std_ratio, 0.5),
    }
    for part, on_diagonal in (("diagonal", True), ("off_diagonal", False)):
        error = elements(found.error, diagonal=on_diagonal)
        figures[f"{part}.median_error"] = _quantile(error, 0.5)
        figures[f"{part}.q90_error"] = _quantile(error, 0.9)
        figures[f"{part}.std_ratio"] = _quantile(elements(found.std_ratio, diagonal=on_diagonal), 0.5)
    ratio = error_ratio(estimates, default, reference)
    figures |= dict(zip(("over_default", "over_default_lower", "over_default_upper"), ratio, strict=True))
    figures["refused"] = float(np.isnan(estimates).any(axis=(2, 3, 4)).sum())
    return EstimatorFigures(name, _per_line(found.error), _per_line(found.std_ratio), figures)


@dataclass(frozen=True)
class BiasFigures:
    """What one compensation leaves of the bias; fields as for `EstimatorFigures`."""

    name: str
    bias_hz: FloatArray
    figures: dict[str, float]


def bias_figures(name: str, whole: ComplexArray, estimates: ComplexArray, truth: ComplexArray) -> BiasFigures:
    """Compares the responses under one compensation with the true robot's frictionless linearisation.

    Args:
        name: Name of the compensation.
        whole (n_conf, n_freq, n_out, n_in): Best linear approximation; NaN where refused.
        estimates (n_conf, n_group, n_freq, n_out, n_in): Estimates from the groups.
        truth (n_conf, n_freq, n_out, n_in): True response.
    """
    bias = np.abs(whole / truth - 1)
    diagonal = elements(bias, diagonal=True)
    single = elements(np.abs(estimates / truth[:, None] - 1), diagonal=True)
    figures = {
        "median_diagonal": _quantile(diagonal, 0.5),
        "q90_diagonal": _quantile(diagonal, 0.9),
        "median_off_diagonal": _quantile(elements(bias, diagonal=False), 0.5),
        "median_diagonal_of_group": _quantile(single, 0.5),
        "refused": float(np.isnan(estimates).any(axis=(2, 3, 4)).sum()),
    }
    return BiasFigures(name, _per_line(bias), figures)


def _per_line(values: FloatArray) -> FloatArray:
    """Median over configurations and diagonal elements (n_freq,) of values (n_conf, n_freq, n_out, n_in)."""
    return np.asarray(np.median(elements(values, diagonal=True), axis=(0, 2)))


def _quantile(values: FloatArray, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if known.size else float("nan")
