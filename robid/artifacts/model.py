"""The model artifact: what a fit found.

Schema history:
    1.0: first version.
    1.1: tied parameters; `undetermined`, `model_error`, deviations from realizations and from the bootstrap.
    1.2: `start_evaluations`.
    1.3: `degrees_of_freedom`, `interval_rule`, what was known beforehand and the relative half width; `covariance` and
        `relative_std` hold no quantile any more where a jackknife set them.
    1.4: the grade of the fit by itself.
    1.5: its resonances and antiresonances beside the measured ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.grade import GRADE_COLUMNS
from robid.artifacts.mapping import Column, from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.fit.solution import Solution
    from robid.validation.grade import Grade
    from robid.validation.resonances import ResonanceTable

MODEL = Kind("model", "1.5", "robid fit")

_PARAMETER, _START, _TIED = ("parameter",), ("start",), ("tied",)
_RESPONSE = ("configuration", "frequency", "output", "input")
_ELEMENT = ("configuration", "output", "input")
_OWN = "as in units"
_TABLE = {
    "names": Column("1", _PARAMETER),
    "kinds": Column("1", _PARAMETER),
    "units": Column("1", _PARAMETER, "Unit of each parameter"),
    "nominal": Column(_OWN, _PARAMETER, "Value of the robot file"),
    "estimate": Column(_OWN, _PARAMETER, "Estimated value"),
    "lower": Column(_OWN, _PARAMETER, "Lower end of the interval"),
    "upper": Column(_OWN, _PARAMETER, "Upper end of the interval"),
    "relative_std": Column("1", _PARAMETER, "Relative standard deviation"),
    "predicted_relative_std": Column("1", _PARAMETER, "The same, predicted before the fit"),
    "identifiable": Column("1", _PARAMETER, "Whether the prediction was small enough"),
    "internal": Column("1", _PARAMETER, "Optimizer's values"),
    "covariance": Column("1", ("parameter", "parameter"), "Covariance of the optimizer's values"),
    "degrees_of_freedom": Column("1", _PARAMETER, "Of Student's distribution that the intervals follow"),
    "prior_relative_std": Column("1", _PARAMETER, "What was known beforehand, as predicted_relative_std"),
    "relative_half_width": Column("1", _PARAMETER, "Half width of the interval over the estimate"),
    "singular_values": Column("1", _PARAMETER, "Of the scaled information matrix"),
    "configuration_cost": Column("1", ("configuration",), "Cost of each configuration"),
    "expected_cost": Column("1", ("configuration",), "Cost that the response's covariance alone gives"),
    "start_cost": Column("1", _START, "Cost that each start ended at"),
    "start_iterations": Column("1", _START, "Iterations of each start"),
    "start_evaluations": Column("1", _START, "Points at which each start computed the cost"),
    "start_status": Column("1", _START, "How each start ended"),
    "start_minimum": Column("1", _START, "Which distinct minimum it ended in, 0 is the best"),
    "configurations": Column("rad", ("configuration", "joint"), "Arm-side joint angles of the fit"),
    "frequency_hz": Column("Hz", ("frequency",), "Frequencies of the fit"),
    "measured": Column("rad/s^2 per torque", _RESPONSE, "Response after the fitted friction compensation"),
    "modelled": Column("rad/s^2 per torque", _RESPONSE, "Parametric response"),
    "undetermined": Column("1", ("combination",), "What the data do not determine"),
    "model_error/ratio": Column("1", _ELEMENT, "Cost by the covariance alone over its expectation"),
    "model_error/limit": Column("1", _ELEMENT, "What an exact model exceeds in 5 % of all cases"),
    "model_error/level": Column("1", _ELEMENT, "Relative model error beyond the covariance, 0 within the limit"),
    "model_error/correlation": Column("1", _ELEMENT, "Correlation of residuals at neighbouring lines"),
    "model_error/correlation_limit": Column("1", _ELEMENT, "What white residuals exceed in 5 % of all cases"),
    "realization_relative_std": Column("1", _PARAMETER, "Relative deviation from each realization's influence"),
    "bootstrap_relative_std": Column("1", _PARAMETER, "Relative deviation from repeated fits"),
    "bootstrap_lower": Column(_OWN, _PARAMETER, "Lower end of the bootstrap's interval"),
    "bootstrap_upper": Column(_OWN, _PARAMETER, "Upper end of the bootstrap's interval"),
    "tied_names": Column("1", _TIED, "Parameters that follow another one"),
    "tied_to": Column("1", _TIED, "Name of that one"),
    "tied_nominal": Column("as of tied_to", _TIED, "Values of the robot file"),
    "tied_estimate": Column("as of tied_to", _TIED, "Estimated values"),
    "tied_lower": Column("as of tied_to", _TIED, "Lower ends of their intervals"),
    "tied_upper": Column("as of tied_to", _TIED, "Upper ends of their intervals"),
}


_RESONANCE = ("resonance",)
_RESONANCES = {
    "resonances/configuration": Column("1", _RESONANCE, "Index of the configuration"),
    "resonances/channel": Column("1", _RESONANCE, "Motor whose own response has it"),
    "resonances/kind": Column("1", _RESONANCE, "Resonance or antiresonance"),
    "resonances/measured_hz": Column("Hz", _RESONANCE, "Measured frequency"),
    "resonances/lower_hz": Column("Hz", _RESONANCE, "Lower end of its interval"),
    "resonances/upper_hz": Column("Hz", _RESONANCE, "Upper end of its interval"),
    "resonances/model_hz": Column("Hz", _RESONANCE, "The model's frequency, found as the measured one"),
    "resonances/mode_hz": Column("Hz", _RESONANCE, "The model's own pole or zero there"),
    "resonances/mode_lower_hz": Column("Hz", _RESONANCE, "Lower end of its interval"),
    "resonances/mode_upper_hz": Column("Hz", _RESONANCE, "Upper end of its interval"),
    "resonances/damping": Column("1", _RESONANCE, "Damping ratio of the pole or zero"),
}


def model_to_artifact(
    solution: Solution, provenance: Provenance, grade: Grade | None = None, resonances: ResonanceTable | None = None
) -> Artifact:
    """Turns a fit's solution, what it is worth by itself, and its resonances into an artifact."""
    datasets, attributes = to_datasets(solution, _TABLE)
    if grade is not None:
        more = to_datasets(grade, GRADE_COLUMNS, "grade/")
        datasets, attributes = {**datasets, **more[0]}, {**attributes, **more[1]}
    if resonances is not None:
        datasets |= to_datasets(resonances, _RESONANCES, "resonances/")[0]
    return Artifact(MODEL, datasets, attributes, provenance)


def resonances_from_artifact(artifact: Artifact) -> ResonanceTable | None:
    """Resonances of the fit's own data; None in files of older versions."""
    from robid.validation.resonances import ResonanceTable

    known = "resonances/measured_hz" in artifact.datasets
    return from_datasets(ResonanceTable, artifact, "resonances/") if known else None


def grade_from_artifact(artifact: Artifact) -> Grade | None:
    """The grade of the fit by itself; None in files of older versions."""
    from robid.validation.grade import Grade

    return from_datasets(Grade, artifact, "grade/") if "grade/value" in artifact.attributes else None


def model_from_artifact(artifact: Artifact) -> Solution:
    """The inverse of `model_to_artifact`."""
    from robid.fit.solution import Solution

    return from_datasets(Solution, artifact)
