"""How elastic models and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.model import Parts, estimate_content, estimate_from_artifact, model_to_artifact
from robid.artifacts.validation import outcome_from_artifact, validation_to_artifact
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.resonances import ResonanceTable
from robid.models.elastic.judge.validating import Validation
from robid.results.grade import Grade

_NAME = "elastic"
_PARAMETER, _START, _CONFIGURATION = ("parameter",), ("start",), ("configuration",)
_DOUBT = ("doubt",)
_RESPONSE = ("configuration", "frequency", "output", "input")
_ELEMENT = ("configuration", "output", "input")
_OWN = "as in units"
_RESPONSE_UNITS = "rad/s^2 per torque"
_SOLUTION = {
    "elastic/internal/values": Column("1", _PARAMETER, "Optimizer's values"),
    "elastic/internal/covariance": Column("1", ("parameter", "parameter"), "Covariance of those that predict"),
    "elastic/internal/degrees_of_freedom": Column("1", _PARAMETER, "Of the Student distribution that goes with it"),
    "elastic/internal/singular_values": Column("1", _PARAMETER, "Of the scaled information matrix"),
    "elastic/costs/configuration": Column("1", _CONFIGURATION, "Cost of each configuration"),
    "elastic/costs/expected": Column("1", _CONFIGURATION, "Cost that the response's covariance alone gives"),
    "elastic/starts/cost": Column("1", _START, "Cost that each start ended at"),
    "elastic/starts/iterations": Column("1", _START, "Iterations of each start"),
    "elastic/starts/evaluations": Column("1", _START, "Points at which each start computed the cost"),
    "elastic/starts/status": Column("1", _START, "How each start ended"),
    "elastic/starts/minimum": Column("1", _START, "Which distinct minimum it ended in, 0 is the best"),
    "elastic/responses/configurations": Column("rad", ("configuration", "joint"), "Arm-side joint angles of the fit"),
    "elastic/responses/frequency_hz": Column("Hz", ("frequency",), "Frequencies of the fit"),
    "elastic/responses/measured": Column(_RESPONSE_UNITS, _RESPONSE, "Response after the fitted friction compensation"),
    "elastic/responses/modelled": Column(_RESPONSE_UNITS, _RESPONSE, "Parametric response"),
    "elastic/model_error/ratio": Column("1", _ELEMENT, "Cost by the covariance alone over its expectation"),
    "elastic/model_error/limit": Column("1", _ELEMENT, "What an exact model exceeds in 5 % of all cases"),
    "elastic/model_error/level": Column(
        "1", _ELEMENT, "Relative model error beyond the covariance, 0 within the limit"
    ),
    "elastic/model_error/correlation": Column("1", _ELEMENT, "Correlation of residuals at neighbouring lines"),
    "elastic/model_error/correlation_limit": Column("1", _ELEMENT, "What white residuals exceed in 5 % of all cases"),
    "elastic/realization_relative_std": Column("1", _PARAMETER, "Relative deviation from each realization's influence"),
    "elastic/bootstrap/relative_std": Column("1", _PARAMETER, "Relative deviation from repeated fits"),
    "elastic/bootstrap/lower": Column(_OWN, _PARAMETER, "Lower end of the bootstrap's interval"),
    "elastic/bootstrap/upper": Column(_OWN, _PARAMETER, "Upper end of the bootstrap's interval"),
    "elastic/doubts/names": Column("1", _DOUBT, "What the robot file may have wrong"),
    "elastic/doubts/causes": Column("1", _DOUBT, "Likely cause that it stands for"),
    "elastic/doubts/units": Column("1", _DOUBT, "Unit of its amounts"),
    "elastic/doubts/prior_std": Column(_OWN, _DOUBT, "Deviation known beforehand, alike in all places"),
    "elastic/doubts/place_std": Column(_OWN, _DOUBT, "Deviation of what each place adds"),
    "elastic/doubts/value": Column(_OWN, _DOUBT, "Estimated amount, zero where the file is right"),
    "elastic/doubts/half_width": Column(_OWN, _DOUBT, "Half width of its interval"),
    "elastic/effective/between_std": Column("1", _PARAMETER, "Deviation of the optimizer's values between places"),
    "elastic/effective/degrees_of_freedom": Column("1", _PARAMETER, "Of what places really differ by"),
    "elastic/effective/dependence": Column("1", _PARAMETER, "Share of the information that a single place gives"),
}
_RESONANCE = ("resonance",)
_RESONANCES = {
    "elastic/resonances/configuration": Column("1", _RESONANCE, "Index of the configuration"),
    "elastic/resonances/channel": Column("1", _RESONANCE, "Motor whose own response has it"),
    "elastic/resonances/kind": Column("1", _RESONANCE, "Resonance or antiresonance"),
    "elastic/resonances/measured_hz": Column("Hz", _RESONANCE, "Measured peak or dip"),
    "elastic/resonances/lower_hz": Column("Hz", _RESONANCE, "Lower end of its interval"),
    "elastic/resonances/upper_hz": Column("Hz", _RESONANCE, "Upper end of its interval"),
    "elastic/resonances/model_hz": Column("Hz", _RESONANCE, "The model's peak or dip, read as the measured one"),
    "elastic/resonances/mode_hz": Column("Hz", _RESONANCE, "The model's own pole or zero there"),
    "elastic/resonances/mode_lower_hz": Column("Hz", _RESONANCE, "Lower end of its interval"),
    "elastic/resonances/mode_upper_hz": Column("Hz", _RESONANCE, "Upper end of its interval"),
    "elastic/resonances/damping": Column("1", _RESONANCE, "Damping ratio of the model's pole or zero"),
    "elastic/resonances/pole_hz": Column("Hz", _RESONANCE, "Measured pole or zero, of a local model"),
    "elastic/resonances/pole_lower_hz": Column("Hz", _RESONANCE, "Lower end of its interval"),
    "elastic/resonances/pole_upper_hz": Column("Hz", _RESONANCE, "Upper end of its interval"),
}
_NEW_RESONANCES = {f"elastic/new_resonances/{name.rpartition('/')[2]}": column for name, column in _RESONANCES.items()}
_VALIDATION = {
    "elastic/configurations": Column("rad", ("configuration", "joint"), "Arm-side joint angles"),
    "elastic/frequency_hz": Column("Hz", ("frequency",), "Frequencies"),
    "elastic/measured": Column(_RESPONSE_UNITS, _RESPONSE, "Response after the fitted friction compensation"),
    "elastic/modelled": Column(_RESPONSE_UNITS, _RESPONSE, "Parametric response"),
    "elastic/cost": Column("1", _CONFIGURATION, "Weighted cost"),
    "elastic/expected_cost": Column("1", _CONFIGURATION, "Cost that the response's covariance alone gives"),
    "elastic/excess": Column("1", _CONFIGURATION, "Cost above it"),
    "elastic/elements": Column("1", _CONFIGURATION, "Response elements with weight"),
    "elastic/error_ratio": Column(
        "1", _CONFIGURATION, "Mean squared error over what noise and an assumed model error allow"
    ),
    "elastic/error_db": Column("dB", ("configuration", "input"), "Median magnitude error of the motors' own responses"),
}


def solution_content(solution: ElasticSolution) -> Parts:
    """Takes what a fit found apart: the parameters and what only elastic fits have."""
    estimate, own = estimate_content(solution.estimate), _own(solution)
    return {**estimate[0], **own[0]}, {**estimate[1], **own[1]}


def solution_from_artifact(artifact: Artifact) -> ElasticSolution:
    """The inverse of `solution_content`, from an artifact that holds it."""
    return from_datasets(ElasticSolution, artifact, "elastic/", {"estimate": estimate_from_artifact(artifact)})


def model_of(solution: ElasticSolution, grade: Grade, resonances: ResonanceTable) -> Artifact:
    """Turns a fit's solution, what it is worth by itself, and its resonances into an artifact."""
    datasets, attributes = _own(solution)
    table = to_datasets(resonances, _RESONANCES, "elastic/resonances/")[0]
    return model_to_artifact(_NAME, solution.estimate, grade, ({**datasets, **table}, attributes))


def resonances_from_artifact(artifact: Artifact) -> ResonanceTable:
    """Resonances of the fit's own data."""
    return from_datasets(ResonanceTable, artifact, "elastic/resonances/")


def validation_of(validation: Validation, resonances: ResonanceTable) -> Artifact:
    """Turns a validation and the resonances of its data into an artifact."""
    datasets, attributes = to_datasets(validation, _VALIDATION, "elastic/", without=("outcome",))
    table = to_datasets(resonances, _NEW_RESONANCES, "elastic/new_resonances/")[0]
    return validation_to_artifact(_NAME, validation.outcome, ({**datasets, **table}, attributes))


def new_resonances_from_artifact(artifact: Artifact) -> ResonanceTable | None:
    """Resonances of a validation's data; None in validations of old."""
    if "elastic/new_resonances/measured_hz" not in artifact.datasets:
        return None
    return from_datasets(ResonanceTable, artifact, "elastic/new_resonances/")


def validation_from_artifact(artifact: Artifact) -> Validation:
    """The inverse of `validation_of`."""
    return from_datasets(Validation, artifact, "elastic/", {"outcome": outcome_from_artifact(artifact)})


def _own(solution: ElasticSolution) -> Parts:
    return to_datasets(solution, _SOLUTION, "elastic/", without=("estimate",))
