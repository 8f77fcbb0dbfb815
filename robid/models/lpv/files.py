"""How position-dependent models and their validations lie in their files."""

from __future__ import annotations

from collections.abc import Mapping

from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.model import estimate_from_artifact, model_to_artifact
from robid.artifacts.validation import outcome_from_artifact, validation_to_artifact
from robid.models.lpv.fit.solution import LpvSolution
from robid.models.lpv.judge.validating import LpvValidation
from robid.results.grade import Grade

_NAME = "lpv"
_FUNCTION, _SCHEDULING, _POINT = ("function",), ("scheduling",), ("price",)
_ALL = "function_or_constant"
_ELEMENT = ("position", "output", "input")
_RESPONSE = ("position", "frequency", "output", "input")
_GAIN, _OWN = "output over input", "as of scheduling"


def _held(prefix: str) -> Mapping[str, Column]:
    """Columns of responses that a model was held against."""
    return {
        f"{prefix}/points": Column(_OWN, ("position", "scheduling"), "Scheduling parameters"),
        f"{prefix}/frequency_hz": Column("Hz", ("frequency",), "Lines"),
        f"{prefix}/response": Column(_GAIN, _RESPONSE, "Measured response"),
        f"{prefix}/std": Column(_GAIN, _RESPONSE, "Its deviation, NaN where it is unknown"),
        f"{prefix}/modelled": Column(_GAIN, _RESPONSE, "The model's response"),
        f"{prefix}/modelled_std": Column(_GAIN, _RESPONSE, "Its deviation by the parameters"),
        f"{prefix}/agreement/share_within": Column("1", _ELEMENT, "Share of the lines within two deviations"),
        f"{prefix}/agreement/error_ratio": Column("1", _ELEMENT, "Error over deviation, root mean square"),
        f"{prefix}/agreement/error_db": Column("dB", _ELEMENT, "Median distance of the magnitudes"),
        f"{prefix}/agreement/relative_error": Column("1", _ELEMENT, "Error over response, root mean square"),
        f"{prefix}/agreement/excess": Column("1", _ELEMENT, "What deviations do not explain, over what is natural"),
    }


_SOLUTION = {
    "lpv/ports/inputs": Column("1", ("input",)),
    "lpv/ports/input_units": Column("1", ("input",)),
    "lpv/ports/outputs": Column("1", ("output",)),
    "lpv/ports/output_units": Column("1", ("output",)),
    "lpv/ports/scheduling": Column("1", _SCHEDULING, "Names of the scheduling parameters"),
    "lpv/ports/scheduling_units": Column("1", _SCHEDULING),
    "lpv/basis/names": Column("1", _FUNCTION, "Basis functions, the constant one not counted"),
    "lpv/basis/exponents": Column("1", ("power", "scheduling"), "Exponents of the powers"),
    "lpv/basis/center": Column(_OWN, _SCHEDULING, "What powers are counted from"),
    "lpv/basis/scale": Column(_OWN, _SCHEDULING, "What they are counted in"),
    "lpv/basis/knots": Column(_OWN, ("scheduling", "knot"), "Knots of the splines"),
    "lpv/basis/lower": Column(_OWN, _SCHEDULING, "Lower end of the range"),
    "lpv/basis/upper": Column(_OWN, _SCHEDULING, "Upper end of the range"),
    "lpv/matrices/A": Column("1", (_ALL, "state", "state"), "Matrices of each function, the constant one first"),
    "lpv/matrices/B": Column("1", (_ALL, "state", "input"), "The same of B"),
    "lpv/matrices/C": Column("1", (_ALL, "output", "state"), "The same of C"),
    "lpv/matrices/D": Column("1", (_ALL, "output", "input"), "The same of D"),
    "lpv/core/parameters": Column("1", (_ALL, "element"), "Matrices without integrators, row by row"),
    "lpv/core/covariance": Column("1", ("parameter", "parameter"), "Of all of them, outputs in units of scales"),
    "lpv/core/scales": Column("as of the output", ("output",), "Units of the outputs"),
    "lpv/core/integrators": Column("1", ("output",), "How often each output integrates"),
    "lpv/dense/smile": Column("1", (_ALL, "element"), "The local models interpolated, as the core's parameters"),
    "lpv/dense/full": Column("1", (_ALL, "element"), "The fit of all blocks, likewise"),
    "lpv/blocks/kept": Column("1", ("matrix", "function"), "Whether the model has each block of A, B, C, D"),
    "lpv/blocks/absolute": Column("1", ("matrix", _ALL), "Norm of each block"),
    "lpv/blocks/relative": Column("1", ("matrix", "function"), "What it contributes, relative to the constant one"),
    "lpv/path/gamma": Column("1", _POINT, "Price of a block"),
    "lpv/path/kept": Column("1", ("price", "matrix", "function"), "Blocks that are left"),
    "lpv/path/relative": Column("1", ("price", "matrix", "function"), "Their norms before the refit"),
    "lpv/path/refit_cost": Column("1", _POINT, "Cost of the exact refit"),
    "lpv/path/validation_cost": Column("1", _POINT, "Its cost on what chooses the structure"),
    "lpv/path/steps": Column("1", _POINT, "Cone programs"),
    "lpv/path/status": Column("1", _POINT, "How the refit ended"),
    **_held("lpv/own"),
    **_held("lpv/choosing"),
    "lpv/largest_pole_at": Column(_OWN, _SCHEDULING, "Where the largest pole of the range is"),
}
_VALIDATION = {**_held("lpv/held"), "lpv/new": Column("1", ("position",), "Whether the fit has not seen it")}


def model_of(solution: LpvSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, _SOLUTION, "lpv/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> LpvSolution:
    """What a fit found, from its model."""
    return from_datasets(LpvSolution, artifact, "lpv/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: LpvValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, _VALIDATION, "lpv/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> LpvValidation:
    """The inverse of `validation_of`."""
    return from_datasets(LpvValidation, artifact, "lpv/", {"outcome": outcome_from_artifact(artifact)})
