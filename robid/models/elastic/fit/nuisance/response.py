"""How nuisance parameters act on a response: columns beside a fit's own, of all that were listed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.effects import (
    Effect,
    Nuisance,
    RobotMove,
)
from robid.models.elastic.fit.nuisance.moves import PERCENT
from robid.models.elastic.fit.nuisance.scene import Scene, moves_matrices_alone
from robid.models.elastic.fit.nuisance.shifts import find_shifts
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.robot.description import Robot
from robid.robot.linearize import Shifts


def nuisance_columns(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    nuisances: Sequence[Nuisance],
    *,
    amounts: FloatArray | None = None,
    all_rest: bool = True,
    shifts: Shifts | None = None,
) -> ComplexArray:
    """Derivatives of the residual by the amounts of nuisance parameters, as `Problem.linear`'s by its own.

    Args:
        problem: The problem.
        internal (n_param,): Where to evaluate.
        robot: The robot that they were listed for.
        options: Options of the fit.
        nuisances: The nuisance parameters.
        amounts (n_nuisance,): By how much this robot is off already; nothing when not given.
        all_rest: Whether robots that are a little off must rest; otherwise nothing is said of what they do not rest by.
        shifts: How the matrices of the robot, which is at rest, move with those that are moves of it; found here
            when not given, together with how loaded springs stiffen.

    Returns:
        Negative derivatives (n_conf, n_freq, n_out, n_in, n_nuisance), to be put beside those by the parameters.

    Raises:
        DataError: If a robot must rest and does not.
    """
    if not nuisances:
        return np.empty((*problem.frf.response.shape, 0), complex)
    scene, kind = Scene(problem, internal, robot, options), problem.residual_kind
    columns = _log_slopes(scene, nuisances, all_rest=all_rest, shifts=shifts)
    # What is exactly zero has no relative change.
    columns[scene.response.sampled == 0] = 0.0
    if amounts is not None and shifts is None:
        columns /= _more_of_it(nuisances, amounts)
    return kind.part(columns * kind.per_relative(scene.response.sampled)[..., None])


def _log_slopes(scene: Scene, nuisances: Sequence[Nuisance], *, all_rest: bool, shifts: Shifts | None) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_nuisance) of the log response by the amounts."""
    columns = np.empty((*scene.problem.frf.response.shape, len(nuisances)), complex)
    # Moves of the robot change its matrices alone where no stiffness grows with the load: then one analytic derivative
    # along the matrices' differences serves all of them, in place of two responses for each.
    known = shifts is not None or moves_matrices_alone(scene.problem, scene.internal)
    together = np.array([known and isinstance(each.effect, RobotMove) for each in nuisances])
    with np.errstate(divide="ignore", invalid="ignore"):
        for index in np.flatnonzero(~together).tolist():
            columns[..., index] = _column(nuisances[index].effect, scene, must_rest=all_rest)
        if together.any():
            rested = scene.settled() if shifts is None else scene
            columns[..., together] = rested.along(shifts or find_shifts(rested, nuisances, must_rest=all_rest))
    return columns


def _more_of_it(nuisances: Sequence[Nuisance], amounts: FloatArray) -> FloatArray:
    """How much more a per cent of a body (n_nuisance,) is that is off, than of the one that the file states."""
    shares = np.array([isinstance(each.effect, RobotMove) and each.unit == "%" for each in nuisances])
    return np.where(shares, 1 + amounts / PERCENT, 1.0)


def _column(effect: Effect, scene: Scene, *, must_rest: bool) -> ComplexArray:
    try:
        return column(effect, scene)
    except DataError:
        if must_rest:
            raise
        return np.zeros(scene.problem.frf.response.shape, complex)
