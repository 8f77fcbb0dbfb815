"""A rigid model held against a motion that it never saw: its torques, its simulated motion, and its grade."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.errors import DataError
from robid.models.conclusions import outcome_of, refuse_other_rate
from robid.models.rigid.fit.cut_off import shot_of_rows
from robid.models.rigid.fit.fitting import Simulate
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.residuals import FEWEST_TESTED
from robid.models.rigid.fit.rows import Reading
from robid.models.rigid.fit.shots import Shot, motion_of, repeats
from robid.models.rigid.fit.sizes import LEAST_SHARE
from robid.models.rigid.fit.solution import RigidSolution, no_rows
from robid.models.rigid.judge.motors import MOTOR_ERROR_LIMIT, Motors
from robid.models.rigid.judge.plausible import TOTAL_ERROR_LIMIT, file_findings, motors_in
from robid.results.finding import Finding, two_digits
from robid.results.outcome import Outcome
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel, build_rigid_model


@dataclass(frozen=True)
class Prediction:
    """Measured and predicted torques, filtered alike; NaN where a row does not count."""

    time_s: Annotated[FloatArray, Quantity("s", "row", "Time, shots after each other")]
    measured: Annotated[FloatArray, Quantity("N m, or the drives' unit", "row joint", "Measured torque", compact=True)]
    predicted: Annotated[FloatArray, Quantity("N m, or the drives' unit", "row joint", "The model's", compact=True)]
    shot: Annotated[IntArray, Quantity("1", "row", "Index of the record that each row is of")] = field(
        default_factory=no_rows
    )
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Name of each record")] = ()

    @property
    def n_row(self) -> IntArray:
        """Rows of each joint (n_joint,) that count."""
        return np.asarray(np.isfinite(self.measured).sum(axis=0))

    @property
    def relative_error(self) -> FloatArray:
        """Norm of the error over that of the measured torque (n_joint,); NaN of a joint without rows."""
        error = np.nansum((self.measured - self.predicted) ** 2, axis=0)
        size = np.nansum(self.measured**2, axis=0)
        return np.asarray(np.sqrt(np.divide(error, size, out=np.full_like(error, np.nan), where=size > 0)))

    @property
    def total_error(self) -> float:
        """Norm of the error over that of the measured torque, all joints together."""
        error = np.nansum((self.measured - self.predicted) ** 2)
        return float(np.sqrt(error / np.nansum(self.measured**2)))

    @property
    def deviation(self) -> FloatArray:
        """Root mean square of the error (n_joint,); NaN of a joint without rows [N m]."""
        error = np.nansum((self.measured - self.predicted) ** 2, axis=0)
        count = self.n_row
        return np.asarray(np.sqrt(np.divide(error, count, out=np.full_like(error, np.nan), where=count > 0)))


def predict(
    model: RigidModel, parameters: FloatArray, shots: Sequence[Shot], filters: PreprocessingOptions
) -> Prediction:
    """Predicts torques along the measured motion of some shots by parameters (n_param,).

    Raises:
        ValueError: If a shot is too short for its filters.
    """
    decimator = filters.decimator(shots[0].sampling_period_s)
    motions = [motion_of(shot, model, filters) for shot in shots]
    measured, predicted = [], []
    for rows in Reading(motions, model, decimator):
        measured.append(np.where(rows.used, rows.torque, np.nan))
        predicted.append(np.where(rows.used, rows.columns @ parameters, np.nan))
    if not measured:
        raise ValueError("The filters leave no rows of the record: it is shorter than they reach.")
    whole = np.concatenate(measured)
    time_s = np.arange(len(whole)) * decimator.factor * shots[0].sampling_period_s
    names = tuple(shot.name for shot in shots)
    return Prediction(time_s, whole, np.concatenate(predicted), shot_of_rows(shots, filters), names)


_REFUTED = ("masses", "payload", "counterbalance", "filters", "model", "friction", "excitation")
_WORSE = 2.0  # times what the fit left
_MATTERS = 0.05  # of the torque


@dataclass(frozen=True)
class RigidValidation:
    """How well a rigid model predicts the torques of another motion."""

    outcome: Outcome  # whether it holds, its grade, and its parameters against the truth
    prediction: Prediction  # measured and predicted torques
    relative_error: Annotated[
        FloatArray, Quantity("1", "joint", "RMS of the error over max(that of the torque, a tenth of the rated one)")
    ]
    total_error: float  # the same of all joints together
    error_ratio: Annotated[FloatArray, Quantity("1", "joint", "Error over what the fit left")]
    same_motion: bool  # whether the fit has seen this motion already
    # Root mean square of simulated less measured positions over that of the measured ones about their mean, the model
    # in the robot's loop under the recorded commands; None where the loop or the commands are unknown, NaN where the
    # simulation is lost.
    forward_error: Annotated[
        FloatArray | None, Quantity("1", "joint", "Error of simulated positions over the motion")
    ] = None


def validate_rigid(
    robot: Robot,
    solution: RigidSolution,
    shots: Sequence[Shot],
    options: RigidFitOptions,
    findings: Sequence[Finding] = (),
    truth: Mapping[str, float] | None = None,
    simulate: Simulate | None = None,
) -> RigidValidation:
    """Validates a rigid model on another motion.

    The limits are absolute: torques may be off by 15 % of their size, those of a single motor by 30 % of max(its RMS
    torque, a tenth of its rated torque). A motor whose torque is off by more than 5 % and twice what the fit left is a
    reason for doubt. What holds is not condemned by a robot file, nor by what its own log let expect.

    Raises:
        DataError: If a shot is too short for the fit's filters.
    """
    whole = build_rigid_model(robot, options.model)
    model = whole.only([whole.names.index(name) for name in solution.estimate.names])
    chosen = solution.filtered
    filters = replace(options.filters, position_cut_hz=chosen.cut_hz, decimation=chosen.decimation)
    try:
        prediction = predict(model, solution.estimate.value, shots, filters)
    except ValueError as error:
        raise DataError(f"D256 {error}", where="validation", remedy="validate on a longer record") from error
    if not prediction.n_row.any():
        message = "D191 no row of the validation is left: all motors are slower than the fit's rows"
        remedy = "validate on a faster motion, or lower `filters.drop_below_rad_s` and `filters.drop_deviations`"
        raise DataError(message, where="validation", remedy=remedy)
    if not np.nansum(prediction.measured**2) > 0:
        message = "D601 the torques of the validation are zero throughout"
        raise DataError(message, where="validation", remedy="check that these channels were connected and recorded")
    refuse_other_rate(solution.filtered.sampling_period_s, [shot.sampling_period_s for shot in shots])
    units = {shot.torque_unit for shot in shots} - {solution.torque_unit}
    if units:
        message = f"D193 the validation's torques are in {units.pop()}, the fit's in {solution.torque_unit}"
        raise DataError(message, where="validation", remedy="validate on a record of the same quantity")
    own = np.sqrt(np.nanmean(solution.residuals.residual**2, axis=0))
    ratio = prediction.deviation / np.maximum(own, 1e-300)
    motors = motors_in(robot, solution, options)
    off = _error(prediction, solution)
    failures = _failures(prediction, solution, motors, off)
    same = any(repeats(solution.travel, robot, shot) for shot in shots)
    kept = findings if failures or same else _refuted(findings, robot, solution, motors)
    every = [*kept, *_doubts(motors, prediction, ratio, off, same=same)]
    verdict = _verdict(prediction, motors, ratio, failures, same=same)
    return RigidValidation(
        outcome=outcome_of(solution.estimate, every, failures, verdict, truth),
        prediction=prediction,
        relative_error=off,
        total_error=prediction.total_error,
        error_ratio=ratio,
        same_motion=same,
        forward_error=None if simulate is None else _forward(simulate(model, solution.estimate.value), shots),
    )


def _forward(simulated: Sequence[FloatArray], shots: Sequence[Shot]) -> FloatArray:
    """Relative error (n_joint,) of simulated positions over all shots."""
    error = np.concatenate([one - shot.position for one, shot in zip(simulated, shots, strict=True)])
    moved = np.concatenate([shot.position - shot.position.mean(axis=0) for shot in shots])
    return np.asarray(np.sqrt(np.mean(error**2, axis=0) / np.mean(moved**2, axis=0)))


def _error(prediction: Prediction, solution: RigidSolution) -> FloatArray:
    """Errors (n_joint,) over what a motor's error is related to."""
    rms = prediction.deviation / np.where(prediction.relative_error > 0, prediction.relative_error, np.nan)
    size = np.maximum(np.nan_to_num(rms), LEAST_SHARE * solution.expected.rated)
    return np.asarray(prediction.deviation / np.maximum(size, np.finfo(float).tiny))


def _failures(prediction: Prediction, solution: RigidSolution, motors: Motors, error: FloatArray) -> tuple[str, ...]:
    (name, index, worst), found = motors.worst(error), []
    if worst > MOTOR_ERROR_LIMIT:
        unit = motors.unit(index, solution.torque_unit)
        off = f"{worst:.0%} of its size ({two_digits(float(prediction.deviation[index]))} {unit})"
        found.append(f"the torque of {name} is off by {off}, limit {MOTOR_ERROR_LIMIT:.0%}")
    whole = motors.total(prediction.measured - prediction.predicted, prediction.measured)
    if whole > TOTAL_ERROR_LIMIT:
        found.append(f"torques are off by {whole:.0%} of their size, limit {TOTAL_ERROR_LIMIT:.0%}")
    return tuple(found)


def _refuted(findings: Sequence[Finding], robot: Robot, solution: RigidSolution, motors: Motors) -> Iterator[Finding]:
    """Yields findings of the fit as they stand where the model has predicted a new motion.

    What speaks of bias, of a poor motion or of what the model lacks is weaker evidence than that; that the robot file
    has other links is no fault of the fit.
    """
    of_file = {each.message for each in file_findings(robot, solution, motors.names)}
    for each in findings:
        weak = not each.scales and (each.cause in _REFUTED or each.message in of_file)
        strength = min(each.strength, 1.0) if each.message in of_file else each.strength
        yield replace(each, decisive=each.decisive and not weak, strength=strength)


def _doubts(
    motors: Motors, prediction: Prediction, ratio: FloatArray, error: FloatArray, *, same: bool
) -> Iterator[Finding]:
    """Yields what is doubtful: a motion seen already, a torque predicted much worse than there, too few rows."""
    if same:
        told = "the validation repeats the motion of the fit: it says nothing of other motions"
        yield Finding("same_motion", told, decisive=False, strength=2.0)
    telling = np.nan_to_num(np.where(error > _MATTERS, ratio, 0.0))
    name, _, worst = motors.worst(telling)
    if worst > _WORSE:
        told = f"the torque of {name} is off by {worst:.2g} times what the fit left"
        yield Finding("model", told, decisive=False, strength=worst / _WORSE)
    few = [name for name, count in zip(motors.names, prediction.n_row.tolist(), strict=True) if count < FEWEST_TESTED]
    if few:
        told = f"the validation leaves fewer than {FEWEST_TESTED} rows of {', '.join(few)}, too few to tell anything"
        yield Finding("excitation", told, decisive=False, strength=2.0)


def _verdict(
    prediction: Prediction, motors: Motors, ratio: FloatArray, failures: tuple[str, ...], *, same: bool
) -> str:
    motion = "the motion of its fit" if same else "a new motion"
    if failures:
        return f"does not predict {motion}: {'; '.join(failures)}"
    whole = motors.total(prediction.measured - prediction.predicted, prediction.measured)
    unjudged = [name for name, judged in zip(motors.names, motors.judged.tolist(), strict=True) if not judged]
    but = f" (those of {', '.join(unjudged)} not judged)" if unjudged else ""
    return (
        f"predicts {motion}: torques are off by {whole:.2g} of their size{but}, and by at most "
        f"{motors.worst(ratio)[2]:.2g} times what the fit left"
    )
