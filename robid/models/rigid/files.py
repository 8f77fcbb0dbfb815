"""How rigid models and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.model import estimate_from_artifact, model_to_artifact
from robid.artifacts.validation import outcome_from_artifact, validation_to_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.validating import RigidValidation
from robid.results.grade import Grade

_NAME = "rigid"
_BASE, _STANDARD, _JOINT, _ROW = ("parameter",), ("standard",), ("joint",), ("row",)
_ESTIMATOR, _BEND, _TRIAL = ("estimator",), ("bend",), ("trial",)
_MOMENT = ("moment",)
_TORQUE = "N m, or the drives' unit"
_SOLUTION = {
    "rigid/base/labels": Column("1", _BASE, "Each base parameter as its combination"),
    "rigid/base/standard": Column("1", _STANDARD, "Names of the standard parameters"),
    "rigid/base/combination": Column("units over units", ("parameter", "standard"), "Base parameters of standard ones"),
    "rigid/base/silent": Column("1", ("silent",), "Standard parameters without any effect"),
    "rigid/base/mixed": Column("1", ("mixed",), "Standard parameters known only together with others"),
    "rigid/estimators/names": Column("1", _ESTIMATOR),
    "rigid/estimators/values": Column("as in units", ("estimator", "parameter"), "Estimates"),
    "rigid/estimators/std": Column("as in units", ("estimator", "parameter"), "As if residuals were independent"),
    "rigid/estimators/deviation": Column(_TORQUE, ("estimator", "joint"), "Deviation of the residuals"),
    "rigid/estimators/iterations": Column("1", _ESTIMATOR, "Passes"),
    "rigid/estimators/status": Column("1", _ESTIMATOR, "How they ended"),
    "rigid/estimators/bends": Column("1", _BEND, "Bends of Huber's estimator"),
    "rigid/estimators/bent": Column("as in units", ("bend", "parameter"), "Huber's estimates at these"),
    "rigid/checks/huber_variation": Column("1", _BASE, "Relative difference from Huber's estimate"),
    "rigid/checks/huber_p": Column("1", _BASE, "Chance of it"),
    "rigid/checks/instrument_variation": Column("1", _BASE, "Relative difference from instrumental variables"),
    "rigid/checks/instrument_p": Column("1", _BASE, "Chance of it"),
    "rigid/checks/skewness": Column("1", _JOINT, "Of the residuals"),
    "rigid/checks/excess_kurtosis": Column("1", _JOINT, "Of the residuals"),
    "rigid/checks/outlier_share": Column("1", _JOINT, "Share beyond three deviations"),
    "rigid/checks/normality_p": Column("1", _JOINT, "Chance of a Gaussian to look as odd"),
    "rigid/checks/correlation": Column("1", ("joint", "lag"), "Autocorrelation, less the filter's own"),
    "rigid/checks/whiteness_p": Column("1", _JOINT, "Chance of white noise to look as correlated"),
    "rigid/filtered/excited_hz": Column("Hz", _JOINT, "Below it lies 99 % of the acceleration"),
    "rigid/filtered/trial_hz": Column("Hz", _TRIAL, "Cut-offs that were tried"),
    "rigid/filtered/trial_correlation": Column("1", ("trial", "joint"), "Correlation of the residuals that each left"),
    "rigid/residuals/time_s": Column("s", _ROW, "Time, shots after each other"),
    "rigid/residuals/torque": Column(_TORQUE, ("row", "joint"), "Filtered torque", compact=True),
    "rigid/residuals/residual": Column(_TORQUE, ("row", "joint"), "What least squares leaves", compact=True),
    "rigid/residuals/weight": Column("1", ("row", "joint"), "Huber's weight", compact=True),
    "rigid/against_nominal/share": Column("1", _JOINT, "Torque of the links over the measured one"),
    "rigid/against_nominal/ratio": Column("1", _JOINT, "The same over that by the robot file"),
    "rigid/against_nominal/likeness": Column("1", _JOINT, "Correlation of these two"),
    "rigid/against_nominal/whole_ratio": Column("1", _JOINT, "The ratio of links and motors together"),
    "rigid/travel/shot": Column("1", _MOMENT, "Shot of each moment"),
    "rigid/travel/time_s": Column("s", _MOMENT, "Time since the shot began"),
    "rigid/travel/position": Column("rad, or m", ("moment", "joint"), "Arm positions at some moments"),
    "rigid/travel/lowest": Column("rad, or m", _JOINT, "Lowest arm position of the record"),
    "rigid/travel/highest": Column("rad, or m", _JOINT, "Highest one"),
    "rigid/travel/lower_limit": Column("rad, or m", _JOINT, "The robot file's limit below"),
    "rigid/travel/upper_limit": Column("rad, or m", _JOINT, "The same above"),
    "rigid/standard/names": Column("1", _STANDARD),
    "rigid/standard/units": Column("1", _STANDARD),
    "rigid/standard/nominal": Column("as in units", _STANDARD, "Values of the robot file"),
    "rigid/standard/value": Column("as in units", _STANDARD, "Nearest real bodies with the base parameters"),
    "rigid/standard/covariance": Column("products of units", ("standard", "standard"), "By what was estimated"),
    "rigid/standard/moved": Column("1", _BASE, "How far base parameters moved, in deviations"),
    "rigid/standard/real": Column("1", ("body",), "Which of the robot file's bodies are real ones"),
}
_VALIDATION = {
    "rigid/prediction/time_s": Column("s", _ROW, "Time, shots after each other"),
    "rigid/prediction/measured": Column(_TORQUE, ("row", "joint"), "Measured torque", compact=True),
    "rigid/prediction/predicted": Column(_TORQUE, ("row", "joint"), "The model's", compact=True),
    "rigid/relative_error": Column("1", _JOINT, "Norm of the error over that of the torque"),
    "rigid/forward_error": Column("1", _JOINT, "Error of simulated positions over the motion"),
    "rigid/error_ratio": Column("1", _JOINT, "Error over what the fit left"),
}


def model_of(solution: RigidSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, _SOLUTION, "rigid/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> RigidSolution:
    """What a fit found, from its model."""
    return from_datasets(RigidSolution, artifact, "rigid/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: RigidValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, _VALIDATION, "rigid/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> RigidValidation:
    """The inverse of `validation_of`."""
    return from_datasets(RigidValidation, artifact, "rigid/", {"outcome": outcome_from_artifact(artifact)})
