"""Validation of an elastic model on frequency responses that its fit never saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.fit.options import ElasticOptions
from robid.fit.problem import Problem
from robid.fit.result import expected_cost
from robid.fit.solution import Solution
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.validation.fitted import FittedModel, fitted_model
from robid.validation.recovery import median_spring_half_width, recover

_SAME_CONFIGURATION_RAD = 1e-3
_COST_RATIO_LIMIT = 1.5
_MEDIAN_LIMIT_DB = 1.0


@dataclass(frozen=True)
class Validation:
    """How well a fitted model predicts other configurations.

    Costs are weighted like the fit's and sum over the elements of one configuration. Costs per element divide
    by the elements that carry weight.

    Attributes:
        configurations (n_conf, n_joint): Validation configurations [rad].
        frequency_hz (n_freq,): Their frequencies [Hz].
        measured (n_conf, n_freq, n_out, n_in): Response after the fitted friction compensation.
        modelled (n_conf, n_freq, n_out, n_in): Parametric response.
        cost (n_conf,): Weighted cost.
        expected_cost (n_conf,): What the response's covariance alone would give.
        excess (n_conf,): Cost above it.
        elements (n_conf,): Response elements with weight.
        dropped: Response elements below 10 dB that the logarithm dropped.
        average_cost: Mean cost per element over the configurations.
        worst_cost: Largest cost per element.
        worst_configuration: Index of that configuration.
        estimation_cost: Mean cost per element of the fit's own data.
        cost_ratio: Worst cost per element over its reference, see `validate_elastic`.
        median_error_db: Median magnitude error of the motors' own responses, all lines and configurations [dB].
        worst_error_db: Largest one [dB].
        error_db (n_conf, n_in): Median per configuration and motor [dB].
        median_spring_half_width: Median half width of the springs' intervals over their estimates.
        truth_names: Parameters with a known truth; empty for a real robot, as the following.
        truth (n_known,): True values, each in its parameter's unit.
        relative_error (n_known,): Error over the true value; the error itself for friction.
        covered (n_known,): Whether the interval holds the truth.
        truth_identifiable (n_known,): Whether the parameter counts as identifiable, decided before the fit.
        coverage: Share of the identifiable parameters whose interval holds the truth.
        springs_within: Springs within 2 % of the truth.
        springs_known: Springs with a known truth.
        ok: Whether the model may be used in configurations like these.
        verdict: The same in words, to follow "the model".
    """

    configurations: FloatArray
    frequency_hz: FloatArray
    measured: ComplexArray
    modelled: ComplexArray
    cost: FloatArray
    expected_cost: FloatArray
    excess: FloatArray
    elements: IntArray
    dropped: int
    average_cost: float
    worst_cost: float
    worst_configuration: int
    estimation_cost: float
    cost_ratio: float
    median_error_db: float
    worst_error_db: float
    error_db: FloatArray
    median_spring_half_width: float | None
    truth_names: tuple[str, ...]
    truth: FloatArray
    relative_error: FloatArray
    covered: BoolArray
    truth_identifiable: BoolArray
    coverage: float | None
    springs_within: int
    springs_known: int
    ok: bool
    verdict: str


def validate_elastic(
    robot: Robot,
    solution: Solution,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    truth: dict[str, float] | None,
) -> Validation:
    """Validates a fitted elastic model in configurations that the fit did not see.

    The model passes when its worst configuration costs at most 1.5 times the reference per element, and the
    motors' own responses are off by at most 1 dB in the median. The reference is the largest of the fit's own
    average cost, the cost that noise alone gives there, and 1, what noise and the model error that the weights
    declare cost together. So a model is not blamed for noise nor for errors within its declaration; one that
    fits its own data badly is caught by the second condition. Below it, such a model still predicts responses, but
    its parameters may be off by more than their intervals, which the verdict then says.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: Frequency responses in other configurations.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].
        truth: True values by parameter name, of a simulated robot.

    Raises:
        DataError: If a configuration was used by the fit, or the data and the model do not belong together.

    Source:
        Zimmermann et al. (2023), sec. V-C and Table II; METHODS sec. 10.
    """
    _refuse_seen(solution, frf)
    fitted = fitted_model(robot, solution, frf, options, delay_s)
    costs = weighted_costs(robot, fitted)
    modelled, cost, expected, elements = costs.modelled, costs.cost, costs.expected, costs.elements
    per_element = cost / elements
    worst = int(np.argmax(per_element))
    estimation = _estimation_cost(solution, options)
    allowed = max(expected[worst] / elements[worst], 1.0)
    ratio = float(per_element[worst] / max(estimation, allowed))
    error = _errors_db(fitted.problem, fitted.measured, modelled)
    median_db = float(np.nanmedian(error))
    recovery = recover(solution, truth or {})
    ok = ratio <= _COST_RATIO_LIMIT and median_db <= _MEDIAN_LIMIT_DB
    return Validation(
        configurations=frf.configurations,
        frequency_hz=frf.frequency_hz,
        measured=fitted.measured,
        modelled=modelled,
        cost=cost,
        expected_cost=expected,
        excess=cost - expected,
        elements=elements,
        dropped=fitted.dropped,
        average_cost=float(per_element.mean()),
        worst_cost=float(per_element[worst]),
        worst_configuration=worst,
        estimation_cost=estimation,
        cost_ratio=ratio,
        median_error_db=median_db,
        worst_error_db=float(np.nanmax(error)),
        error_db=_median(error),
        median_spring_half_width=median_spring_half_width(solution),
        truth_names=recovery.names,
        truth=recovery.truth,
        relative_error=recovery.relative_error,
        covered=recovery.covered,
        truth_identifiable=recovery.identifiable,
        coverage=recovery.coverage,
        springs_within=recovery.springs_within,
        springs_known=recovery.springs_known,
        ok=ok,
        verdict=_verdict(ratio, worst, cost.size, median_db, estimation / allowed, ok=ok),
    )


@dataclass(frozen=True)
class WeightedCosts:
    """Costs of a model in the configurations of a response, as in `Validation`.

    Attributes:
        modelled (n_conf, n_freq, n_out, n_in): Parametric response.
        cost (n_conf,): Weighted cost.
        expected (n_conf,): What the response's covariance alone would give.
        elements (n_conf,): Response elements with weight.
    """

    modelled: ComplexArray
    cost: FloatArray
    expected: FloatArray
    elements: IntArray


def weighted_costs(robot: Robot, fitted: FittedModel) -> WeightedCosts:
    """Costs of a fitted model in a response's configurations.

    Raises:
        DataError: If no element of a configuration has weight.
    """
    problem = fitted.problem
    modelled = problem.model_response(fitted.internal)
    elements = np.asarray((problem.weight > 0).sum(axis=(1, 2, 3)))
    _refuse_empty(robot, elements)
    cost = problem.configuration_cost(modelled, fitted.internal)
    return WeightedCosts(modelled, cost, expected_cost(problem, modelled), elements)


def _refuse_seen(solution: Solution, frf: Frf) -> None:
    distance = np.abs(frf.configurations[:, None] - solution.configurations[None]).max(axis=2).min(axis=1)
    seen = np.flatnonzero(distance < _SAME_CONFIGURATION_RAD)
    if seen.size:
        shown = ", ".join(str(index + 1) for index in seen)
        message = f"the fit has already used validation configuration {shown}"
        remedy = "validate on a campaign with other configurations, such as `random` with another seed"
        raise DataError(message, where="validation", remedy=remedy)


def _refuse_empty(robot: Robot, elements: IntArray) -> None:
    empty = np.flatnonzero(elements == 0)
    if empty.size:
        shown = ", ".join(str(index + 1) for index in empty)
        message = f"all of the response in validation configuration {shown} lies below 10 dB or the low cut"
        raise DataError(message, where=robot.name, remedy="excite more, or measure more realizations")


def _estimation_cost(solution: Solution, options: ElasticOptions) -> float:
    """Mean cost per element of the fit's own data."""
    weighted = solution.frequency_hz >= options.weights.low_cut_hz
    elements = solution.modelled[:, weighted].size - solution.dropped
    return float(solution.configuration_cost.sum() / max(elements, 1))


def _errors_db(problem: Problem, measured: ComplexArray, modelled: ComplexArray) -> FloatArray:
    """Magnitude errors (n_conf, n_freq, n_in) of the motors' own responses; NaN where an element has no weight."""
    own = np.arange(measured.shape[3])
    error = np.abs(20 * np.log10(np.abs(measured[..., own, own] / modelled[..., own, own])))
    return np.asarray(np.where(problem.weight[..., own, own] > 0, error, np.nan))


def _median(error: FloatArray) -> FloatArray:
    """Median over the lines (n_conf, n_in); NaN for a motor whose lines all lack weight."""
    empty: BoolArray = np.all(np.isnan(error), axis=1)
    filled = np.where(np.expand_dims(empty, 1), 0.0, error)
    return np.asarray(np.where(empty, np.nan, np.nanmedian(filled, axis=1)))


def _verdict(ratio: float, worst: int, count: int, median_db: float, own: float, *, ok: bool) -> str:
    """Says what `ok` says; `own` is the fit's own average cost over what is allowed in the worst configuration."""
    where = f"{count} new configurations" if count > 1 else "a new configuration"
    place = f" (configuration {worst + 1})" if count > 1 else ""
    allowed = "what noise and the assumed model error allow"
    said = (
        f"{'holds' if ok else 'does not hold'} in {where}: worst cost {ratio:.2g} of "
        f"{allowed if own <= 1 else 'the average where it was fitted'}{place}, limit {_COST_RATIO_LIMIT:g}; "
        f"motors' own responses off by {median_db:.2g} dB in the median, limit {_MEDIAN_LIMIT_DB:g} dB"
    )
    if own <= _COST_RATIO_LIMIT:
        return said
    return (
        f"{said}. Where it was fitted, it costs {own:.2g} of {allowed}: it lacks something, and its parameters may be "
        "off by more than their intervals say"
    )
