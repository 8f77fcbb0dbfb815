"""Validation of an elastic model on frequency responses that its fit never saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, Quantity
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.result import expected_cost
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.assessment import validation_findings
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.models.elastic.judge.grading import COST_RATIO_LIMIT, Measures, grade_validation, measure, own_errors
from robid.results.estimate import Estimate
from robid.results.finding import Finding
from robid.results.outcome import Outcome, recover
from robid.robot.description import Robot

_SAME_CONFIGURATION_RAD = 1e-3


_RESPONSE = "configuration frequency output input"


@dataclass(frozen=True)
class Validation:
    """How well a fitted elastic model predicts other configurations.

    Costs are weighted like the fit's and sum over the elements of one configuration. Costs per element divide
    by the elements that carry weight.
    """

    outcome: Outcome  # Whether it holds, its grade, and its parameters against the truth
    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side joint angles")]
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Frequencies")]
    measured: Annotated[
        ComplexArray, Quantity("rad/s^2 per torque", _RESPONSE, "Response after the fitted friction compensation")
    ]
    modelled: Annotated[ComplexArray, Quantity("rad/s^2 per torque", _RESPONSE, "Parametric response")]
    cost: Annotated[FloatArray, Quantity("1", "configuration", "Weighted cost")]
    expected_cost: Annotated[
        FloatArray, Quantity("1", "configuration", "Cost that the response's covariance alone gives")
    ]
    excess: Annotated[FloatArray, Quantity("1", "configuration", "Cost above it")]
    elements: Annotated[IntArray, Quantity("1", "configuration", "Response elements with weight")]
    dropped: int  # Response elements below 10 dB that the logarithm dropped
    average_cost: float  # Mean cost per element over the configurations
    worst_cost: float  # Largest cost per element
    worst_configuration: int  # Index of that configuration
    error_ratio: Annotated[
        FloatArray,
        Quantity("1", "configuration", "Mean squared error over what noise and an assumed model error allow"),
    ]
    cost_ratio: float  # The largest of them
    median_error_db: float  # Median magnitude error of the motors' own responses, all lines and configurations [dB]
    motor_error_db: float  # The same of the worst motor [dB]
    motor_error_deg: float  # Median phase error of the worst motor [deg]
    # Median relative distance of the model's resonances and antiresonances from the measured ones; None where no pair
    # was found
    resonance_shift: float | None
    resonances: int  # Pairs behind it
    worst_error_db: float  # Largest one [dB]
    error_db: Annotated[
        FloatArray, Quantity("dB", "configuration input", "Median magnitude error of the motors' own responses")
    ]
    median_spring_half_width: float | None  # Median half width of the springs' intervals over their estimates


def validate_elastic(
    robot: Robot,
    solution: ElasticSolution,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    truth: dict[str, float] | None,
    findings: Sequence[Finding] = (),
    campaign: str = "validation",
) -> Validation:
    """Validates a fitted elastic model on responses that the fit did not see.

    The limits are absolute: however badly a model was fitted, it is held to the same. In the worst configuration the
    mean squared error may be 1.5 times what the response's noise and an assumed model error allow (the one that the
    weights declare, at least 2 %); every motor's own response may be off by 1 dB and 7 degrees in the median over its
    lines, and resonances by 3 % in the median.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: Frequency responses of other records; where all configurations are the fit's own, the grade says so.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].
        truth: True values by parameter name, of a simulated robot.
        findings: Findings about the fit, for the grade; those about these data are added.
        campaign: Name of the campaign that these data come from.

    Raises:
        DataError: If the data and the model do not belong together.

    Source:
        Zimmermann et al. (2023), sec. V-C and Table II; docs/methods, sec. 10.
    """
    fitted = fitted_model(robot, solution, frf, options, delay_s)
    costs = weighted_costs(robot, fitted)
    per_element = costs.cost / costs.elements
    own = own_errors(fitted, costs.modelled)
    measures = measure(fitted, costs.modelled, options.weights.model_error)
    seen = _seen_already(solution, frf)
    every = (*validation_findings(findings, robot, solution.estimate, frf, campaign, delay_s), *seen)
    return Validation(
        outcome=_outcome(solution, measures, every, truth or {}, seen=bool(seen)),
        configurations=frf.configurations,
        frequency_hz=frf.frequency_hz,
        measured=fitted.measured,
        **vars(costs),
        excess=costs.cost - costs.expected_cost,
        dropped=fitted.dropped,
        average_cost=float(per_element.mean()),
        worst_cost=float(per_element.max()),
        worst_configuration=int(np.argmax(measures.error_ratio)),
        **vars(measures),
        cost_ratio=float(measures.error_ratio.max()),
        median_error_db=float(np.nanmedian(own.decibel)),
        worst_error_db=float(np.nanmax(own.decibel)),
        error_db=own.by_configuration,
        median_spring_half_width=median_spring_half_width(solution.estimate),
    )


def _outcome(
    solution: ElasticSolution, measures: Measures, findings: Sequence[Finding], truth: dict[str, float], *, seen: bool
) -> Outcome:
    failures = measures.failures()
    return Outcome(
        ok=not failures,
        verdict=_verdict(measures, failures, seen=seen),
        grade=grade_validation(solution, findings, failures),
        recovery=recover(solution.estimate, truth),
    )


@dataclass(frozen=True)
class WeightedCosts:
    """Costs of a model in the configurations of a response, as in `Validation`."""

    modelled: ComplexArray  # (n_conf, n_freq, n_out, n_in) Parametric response
    cost: FloatArray  # (n_conf,) Weighted cost
    expected_cost: FloatArray  # (n_conf,) What the response's covariance alone would give
    elements: IntArray  # (n_conf,) Response elements with weight


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


def median_spring_half_width(estimate: Estimate) -> float | None:
    """Median half width of the springs' intervals over their values; None without a fitted spring."""
    springs = np.array(estimate.kinds) == "stiffness"
    if not springs.any():
        return None
    return float(np.median(0.5 * (estimate.upper - estimate.lower)[springs] / estimate.value[springs]))


def _seen_already(solution: ElasticSolution, frf: Frf) -> tuple[Finding, ...]:
    """A finding where nothing was measured elsewhere than the fit's data, which says nothing of others."""
    mine, theirs = frf.configurations, solution.responses.configurations
    near = np.abs(mine[:, None] - theirs[None]).max(axis=2, initial=0.0) < _SAME_CONFIGURATION_RAD
    if not near.any(axis=1).all():
        return ()
    told = "the validation repeats configurations of the fit: nothing was tested in others"
    return (Finding("same_configuration", told, decisive=False, strength=2.0),)


def _refuse_empty(robot: Robot, elements: IntArray) -> None:
    empty = np.flatnonzero(elements == 0)
    if empty.size:
        shown = ", ".join(str(index + 1) for index in empty)
        message = f"D137 all of the response in validation configuration {shown} lies below 10 dB or the low cut"
        raise DataError(message, where=robot.name, remedy="excite more, or measure more realizations")


def _verdict(measures: Measures, failures: tuple[str, ...], *, seen: bool) -> str:
    count = len(measures.error_ratio)
    what = f"{count} new configurations" if count > 1 else "a new configuration"
    if seen:
        what = f"new data of {'configurations' if count > 1 else 'the configuration'} of the fit"
    if failures:
        return f"does not predict {what}: {'; '.join(failures)}"
    worst = float(measures.error_ratio.max())
    place = f" (configuration {int(np.argmax(measures.error_ratio)) + 1})" if count > 1 else ""
    shift = "" if measures.resonance_shift is None else f", resonances by {100 * measures.resonance_shift:.2g} %"
    return (
        f"predicts {what}: worst error {worst:.2g} of what noise and the assumed model error allow{place}, limit "
        f"{COST_RATIO_LIMIT:g}; the worst motor's own response is off by {measures.motor_error_db:.2g} dB and "
        f"{measures.motor_error_deg:.2g} degrees in the median{shift}"
    )
