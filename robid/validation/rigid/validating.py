"""Validation of a rigid model on a motion that its fit never saw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.fit.rigid.options import PreprocessingOptions, RigidFitOptions
from robid.fit.rigid.shots import Shot
from robid.fit.rigid.solution import RigidSolution
from robid.robot.description import Robot
from robid.robot.regressor.model import build_rigid_model
from robid.validation.doubt import Doubt
from robid.validation.outcome import Outcome
from robid.validation.recovery import recover
from robid.validation.rigid.grading import grade_rigid
from robid.validation.rigid.prediction import Prediction, predict

ERROR_RATIO_LIMIT = 1.5
TOTAL_ERROR_LIMIT = 0.2
_SAME = 0.02  # of a joint's range of motion


@dataclass(frozen=True)
class RigidValidation:
    """How well a rigid model predicts the torques of another motion.

    Attributes:
        outcome: Whether it holds, its grade, and its parameters against the truth.
        prediction: Measured and predicted torques.
        relative_error (n_joint,): Norm of the error over that of the torque.
        total_error: The same of all joints together.
        error_ratio (n_joint,): Root mean square of the error over what the fit's own residual was.
        same_motion: Whether the fit has seen this motion already.
    """

    outcome: Outcome
    prediction: Prediction
    relative_error: FloatArray
    total_error: float
    error_ratio: FloatArray
    same_motion: bool


def validate_rigid(
    robot: Robot,
    solution: RigidSolution,
    shots: Sequence[Shot],
    options: RigidFitOptions,
    doubts: Sequence[Doubt] = (),
    truth: Mapping[str, float] | None = None,
    seen: Sequence[Shot] = (),
) -> RigidValidation:
    """Validates a rigid model on another motion.

    The error of no motor may be 1.5 times what the fit left, and that of all together a fifth of the torque.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        shots: What was recorded anew.
        options: Options of the fit.
        doubts: Doubts about the fit, for the grade.
        truth: True values by parameter name, of a simulated robot.
        seen: What the fit was fitted to, where it is at hand.

    Raises:
        DataError: If a shot is too short for the fit's filters.
    """
    whole = build_rigid_model(robot, options.model)
    model = whole.only([whole.names.index(name) for name in solution.estimate.names])
    filters = PreprocessingOptions(
        solution.filtered.cut_hz,
        options.filters.position_order,
        solution.filtered.decimation,
        options.filters.drop_deviations,
    )
    try:
        prediction = predict(model, solution.estimate.value, shots, filters)
    except ValueError as error:
        raise DataError(str(error), where="validation", remedy="validate on a longer record") from error
    own = np.sqrt(np.nanmean(solution.residuals.residual**2, axis=0))
    ratio = prediction.deviation / np.maximum(own, 1e-300)
    failures = _failures(robot, ratio, prediction.total_error)
    same = any(is_same_motion(one, other) for one in shots for other in seen)
    every = [*doubts, *_seen_already(same)]
    return RigidValidation(
        outcome=Outcome(
            ok=not failures,
            verdict=_verdict(prediction, ratio, failures, same=same),
            grade=grade_rigid(solution, every, failures),
            recovery=recover(solution.estimate, truth or {}),
        ),
        prediction=prediction,
        relative_error=prediction.relative_error,
        total_error=prediction.total_error,
        error_ratio=ratio,
        same_motion=same,
    )


def is_same_motion(one: Shot, other: Shot) -> bool:
    """Whether two shots move alike: all positions within 2 % of the range of motion."""
    count = min(len(one.position), len(other.position))
    reach = np.maximum(np.ptp(other.position, axis=0), 1e-12)
    return bool((np.abs(one.position[:count] - other.position[:count]) / reach).max() < _SAME)


def _seen_already(same: bool) -> tuple[Doubt, ...]:
    if not same:
        return ()
    told = "the validation repeats the motion of the fit: it says nothing of other motions"
    return (Doubt("same_motion", told, decisive=False, strength=2.0),)


def _failures(robot: Robot, ratio: FloatArray, total: float) -> tuple[str, ...]:
    worst = int(np.argmax(ratio))
    found = []
    if ratio[worst] > ERROR_RATIO_LIMIT:
        found.append(
            f"the torque of {robot.joints[worst].name} is off by {ratio[worst]:.2g} times what the fit left, limit "
            f"{ERROR_RATIO_LIMIT:g}"
        )
    if total > TOTAL_ERROR_LIMIT:
        found.append(f"torques are off by {total:.0%} of their size, limit {TOTAL_ERROR_LIMIT:.0%}")
    return tuple(found)


def _verdict(prediction: Prediction, ratio: FloatArray, failures: tuple[str, ...], *, same: bool) -> str:
    motion = "the motion of its fit" if same else "a new motion"
    if failures:
        return f"does not hold on {motion}: {'; '.join(failures)}"
    return (
        f"holds on {motion}: torques are off by {prediction.total_error:.2g} of their size, and by at most "
        f"{ratio.max():.2g} times what the fit left"
    )
