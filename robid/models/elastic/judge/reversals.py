"""Signs and samples that a log may have stated wrongly, each put in its place on the response of the fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import get_args

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.nuisance.off_robot import problem_at
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import Explanation
from robid.robot.description import Robot
from robid.signals.quantities import SampledName

_STEPS = 25
_GAIN = 0.2  # of the cost that each further sign must save
_NEARLY = 0.95  # of what two signs save is as good by one


def try_signs(fitted: FittedModel) -> Explanation | None:
    """Looks for the fewest signs that explain a residual; None where none does.

    A sign turns a column of the response around, or a row of it: no model is needed to see what that does to a
    residual. As a fit to reversed data is lost, the robot file's own values are heard beside the fitted ones. From
    there the fit goes on for some steps with the signs corrected.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
    """
    if fitted.problem.residual_kind.parts == 1:
        return None  # magnitudes have no sign
    found = None
    for problem, start in _starts(fitted):
        rows, columns = _best_signs(problem, start)
        if (rows > 0).all() and (columns > 0).all():
            continue
        right = replace(problem, frf=turned(problem.frf, rows, columns))
        end = optimise(right, start, max_iterations=_STEPS)
        if found is None or end.cost < found[0].cost:
            found = end, rows, columns
    if found is None:
        return None
    end, rows, columns = found
    reversed_ = _named(fitted.robot, fitted.problem.frf, rows, columns)
    return _of_signs(fitted.robot, reversed_, 1 - end.cost / fitted.cost, end.parameters - fitted.internal)


def _of_signs(
    robot: Robot, reversed_: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]], share: float, moved: FloatArray
) -> Explanation:
    """What other signs of torques, of angles, and of joints both of whose signs are wrong would explain."""
    torques, angles, joints = reversed_
    told = [
        (f"reversed {kind} of {name}", f"`sign: -1` for the {kind} of {name} where its log is described")
        for kind, names in (("torque", torques), ("angle", angles))
        for name in names
    ]
    turning = (joint for joint in robot.joints if joint.name in joints)
    for joint in sorted(turning, key=lambda joint: joint.name):
        setting = "gear_ratio_rad_m" if joint.type == "prismatic" else "gear_ratio"
        what = f"motor of {joint.name} that turns against its joint"
        told.append((what, f"`{setting}: {-joint.motor.gear_ratio:.6g}` for {joint.name} in the robot file"))
    cause = "torque_sign" if torques else "angle_sign" if angles else "gear_ratio"
    names, correct = zip(*told, strict=True)
    units = ("",) * len(names)
    return Explanation(cause, names, np.zeros(len(names)), units, share, moved, correct=correct)


def _starts(fitted: FittedModel) -> Iterator[tuple[Problem, FloatArray]]:
    """The fitted values, and the robot file's with the robot at rest on its own springs."""
    yield fitted.problem, fitted.internal
    start = np.zeros_like(fitted.internal)
    values = fitted.problem.parameters.parameters(start)
    try:
        yield problem_at(fitted.problem, values, fitted.robot, fitted.options), start
    except DataError:  # it gives way under gravity
        return


def turned(frf: Frf, rows: FloatArray, columns: FloatArray) -> Frf:
    """Returns a response with the signs (n_out,) of its outputs and (n_in,) of its inputs the other way."""
    signs = rows[:, None] * columns
    return replace(frf, response=frf.response * signs, sensitivity=frf.sensitivity * signs)


def _best_signs(problem: Problem, internal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signs of rows and columns, one more at a time as long as each saves enough."""
    as_told, other = _costs(problem, internal)
    frf = problem.frf
    rows, columns = np.ones(len(frf.output_names)), np.ones(len(frf.input_names))
    now = float(as_told.sum())
    while True:
        tried = []
        for more_rows, more_columns in _moves(frf):
            signs = rows * more_rows, columns * more_columns
            cost = float(np.where(np.outer(*signs) > 0, as_told, other).sum())
            tried.append((cost, *signs))
        single = tried[: len(rows) + len(columns)]
        best, alone = min(tried, key=lambda one: one[0]), min(single, key=lambda one: one[0])
        if now - alone[0] > _NEARLY * (now - best[0]):
            best = alone
        if now <= 0 or now - best[0] < _GAIN * now:  # without any weight nothing is left to save
            return rows, columns
        now, rows, columns = best


def _costs(problem: Problem, internal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cost of each element (n_out, n_in), as it is and with the other sign."""
    modelled, measured = problem.model_response(internal), problem.measured(internal)

    def cost(sign: float) -> FloatArray:
        error = problem.weighted(problem.residual_kind.compare(sign * measured, modelled))
        return np.asarray((np.abs(error) ** 2).sum(axis=(0, 1)))

    return cost(1.0), cost(-1.0)


def _moves(frf: Frf) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Factors of rows and columns: each output, each input, then each motor with its own angle."""
    outputs, inputs = frf.output_names, frf.input_names
    for row in range(len(outputs)):
        yield _flip(len(outputs), row), np.ones(len(inputs))
    for column in range(len(inputs)):
        yield np.ones(len(outputs)), _flip(len(inputs), column)
    for column, name in enumerate(inputs):
        if name in outputs:
            yield _flip(len(outputs), outputs.index(name)), _flip(len(inputs), column)


def _flip(size: int, index: int) -> FloatArray:
    return np.where(np.arange(size) == index, -1.0, 1.0)


def _named(
    robot: Robot, frf: Frf, rows: FloatArray, columns: FloatArray
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Torques, angles, and joints both of whose signs are wrong."""
    angles = {name for name, sign in zip(frf.output_names, rows.tolist(), strict=True) if sign < 0}
    torques = {name for name, sign in zip(frf.input_names, columns.tolist(), strict=True) if sign < 0}
    both = {joint.name for joint in robot.joints} & angles & torques
    return tuple(sorted(torques - both)), tuple(sorted(angles - both)), tuple(sorted(both))


def try_samples(fitted: FittedModel) -> Explanation | None:
    """Takes all speeds for what they are not said to be, and lets the fit follow.

    Half a sample of delay tells them apart where no delay is estimated, and the size of high lines where it is.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.

    Returns:
        The samples that explain most; None where no speed was measured, or nothing explains more than what is stated.
    """
    found = [_try(fitted, sampled, problem) for sampled, problem in _others(fitted.problem)]
    best = max(found, key=lambda trial: trial.share, default=None)
    return best if best is not None and best.share > 0 else None


def _others(problem: Problem) -> Iterator[tuple[SampledName, Problem]]:
    """Other samples of all speeds, and the same problem with them."""
    frf, channels = problem.frf, problem.frf.measured_channels
    omega, period_s = 2 * np.pi * frf.frequency_hz, frf.sampling_period_s
    stated = {channel.sampled for channel in channels if channel.quantity == "speed"}
    names: tuple[SampledName, ...] = get_args(SampledName)
    for sampled in (name for name in names if name != "filtered" and stated and stated != {name}):
        told = tuple(replace(one, sampled=sampled) if one.quantity == "speed" else one for one in channels)
        new, old = (
            np.stack([each.to_acceleration(omega, period_s) for each in every], axis=-1) for every in (told, channels)
        )
        factor = new / old
        other = replace(
            frf,
            measured_channels=told,
            response=frf.response * factor[..., None],
            sensitivity=frf.sensitivity * factor[..., None],
        )
        # Relative residuals have the same errors, plain ones errors that are larger by the factor.
        scale = problem.residual_kind.divisor(factor) / factor
        whitening = problem.whitening
        if whitening is not None:
            whitening = whitening * np.repeat(scale, frf.response.shape[-1], axis=-1)[:, None]
        yield (
            sampled,
            replace(
                problem,
                frf=other,
                model=replace(problem.model, rates=other.output_rates),
                weight=problem.weight * np.abs(scale[..., None]) ** 2,
                whitening=whitening,
            ),
        )


def _try(fitted: FittedModel, sampled: SampledName, problem: Problem) -> Explanation:
    """What other samples of the speeds would explain."""
    end = optimise(problem, fitted.internal, max_iterations=_STEPS)
    speeds = ", ".join(one.name for one in problem.frf.measured_channels if one.quantity == "speed")
    words = {"instants": "values at their instants", "difference": "differences from the sample before"}
    told = f"reading of the speed of {speeds} as {words.get(sampled, 'differences across both neighbours')}"
    correct = (f"`sampled: {sampled}` for the speeds where their log is described",)
    share, moved = 1 - end.cost / fitted.cost, end.parameters - fitted.internal
    return Explanation("samples", (told,), np.zeros(1), ("",), share, moved, correct=correct)
