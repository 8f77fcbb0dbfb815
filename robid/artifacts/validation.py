"""The validation artifact: a model on data that its fit never saw.

Schema history:
    1.0: first version.
    2.0: `cost_ratio` is absolute, whatever the fit's own cost; `error_ratio`, errors of the worst motor, shift of the
        resonances, and the grade.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.grade import GRADE_COLUMNS
from robid.artifacts.mapping import Column, from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.validation.elastic import Validation

VALIDATION = Kind("validation", "2.0", "robid validate")

_CONFIGURATION, _KNOWN = ("configuration",), ("known",)
_RESPONSE = ("configuration", "frequency", "output", "input")
_TABLE = {
    "configurations": Column("rad", ("configuration", "joint"), "Arm-side joint angles"),
    "frequency_hz": Column("Hz", ("frequency",), "Frequencies"),
    "measured": Column("rad/s^2 per torque", _RESPONSE, "Response after the fitted friction compensation"),
    "modelled": Column("rad/s^2 per torque", _RESPONSE, "Parametric response"),
    "cost": Column("1", _CONFIGURATION, "Weighted cost"),
    "expected_cost": Column("1", _CONFIGURATION, "Cost that the response's covariance alone gives"),
    "excess": Column("1", _CONFIGURATION, "Cost above it"),
    "elements": Column("1", _CONFIGURATION, "Response elements with weight"),
    "error_ratio": Column("1", _CONFIGURATION, "Mean squared error over what noise and an assumed model error allow"),
    "error_db": Column("dB", ("configuration", "input"), "Median magnitude error of the motors' own responses"),
    "truth_names": Column("1", _KNOWN),
    "truth": Column("as in the model", _KNOWN, "True values"),
    "relative_error": Column("1", _KNOWN, "Error over the true value; the error itself for friction"),
    "covered": Column("1", _KNOWN, "Whether the interval holds the truth"),
    "truth_identifiable": Column("1", _KNOWN, "Whether the parameter counts as identifiable"),
    **GRADE_COLUMNS,
}


def validation_to_artifact(validation: Validation, provenance: Provenance) -> Artifact:
    """Turns a validation into an artifact."""
    return Artifact(VALIDATION, *to_datasets(validation, _TABLE), provenance)


def validation_from_artifact(artifact: Artifact) -> Validation:
    """The inverse of `validation_to_artifact`."""
    from robid.validation.elastic import Validation

    return from_datasets(Validation, artifact)
