"""Signs of torques and angles that a robot file or a log may have wrong, tried on a fit's own response."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.doubts.extension import problem_at
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.robot.description import Robot

_STEPS = 25
_GAIN = 0.2  # of the cost that each further sign must save
_NEARLY = 0.95  # of what two signs save is as good by one


@dataclass(frozen=True)
class Reversal:
    """Signs without which a fit would have explained more.

    Attributes:
        torques: Motors whose torques count the wrong way.
        angles: Signals of motion that do.
        joints: Joints that turn against their motors: both do.
        share: Share of the residual's cost that goes with them.
        moved (n_param,): How far the internal parameters would move.
    """

    torques: tuple[str, ...]
    angles: tuple[str, ...]
    joints: tuple[str, ...]
    share: float
    moved: FloatArray


def try_signs(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> Reversal | None:
    """Looks for the fewest signs that explain a residual; None where none does.

    A sign turns a column of the response around, or a row of it: no model is needed to see what that does to a
    residual. As a fit to reversed data is lost, the robot file's own values are heard beside the fitted ones. From
    there the fit goes on for some steps with the signs corrected.

    Args:
        robot: The robot file that the fit started from.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.
    """
    if fitted.problem.residual_kind.parts == 1:
        return None  # magnitudes have no sign
    found = None
    for problem, start in _starts(robot, fitted, options):
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
    share = 1 - end.cost / fitted.problem.cost(fitted.internal)
    return Reversal(*_named(robot, fitted.problem.frf, rows, columns), share, end.parameters - fitted.internal)


def _starts(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> Iterator[tuple[Problem, FloatArray]]:
    """The fitted values, and the robot file's with the robot at rest on its own springs."""
    yield fitted.problem, fitted.internal
    start = np.zeros_like(fitted.internal)
    values = fitted.problem.parameters.parameters(start)
    try:
        yield problem_at(fitted.problem, values, robot, options), start
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
        if now - best[0] < _GAIN * now:
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
