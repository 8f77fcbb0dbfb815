"""Doubts as further columns of a least-squares problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.models.elastic.fit.doubts.scene import Scene, moves_matrices_alone
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.robot.description import Robot
from robid.robot.expand import shifts_between
from robid.robot.linearize import LinearModel, Shifts

_PERCENT = 100.0


def doubt_columns(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    doubts: Sequence[DoubtColumn],
    *,
    amounts: FloatArray | None = None,
    all_rest: bool = True,
    shifts: Shifts | None = None,
) -> ComplexArray:
    """Derivatives of the residual by the amounts of doubts, with the sign and scale of `Problem.linear`'s.

    Args:
        problem: The problem.
        internal (n_param,): Where to evaluate.
        robot: The robot that the doubts were listed for.
        options: Options of the fit.
        doubts: The doubts.
        amounts (n_doubt,): By how much this robot is off already; nothing when not given.
        all_rest: Whether robots that are a little off must rest; otherwise nothing is said of doubts where they do not.
        shifts: How the matrices of the robot, which is at rest, move with those doubts that are moves of it; found here
            when not given, together with how loaded springs stiffen.

    Returns:
        Negative derivatives (n_conf, n_freq, n_out, n_in, n_doubt), to be put beside those by the parameters.

    Raises:
        DataError: If a robot must rest and does not.
    """
    scene, kind = Scene(problem, internal, robot, options), problem.residual_kind
    columns = np.empty((*problem.frf.response.shape, len(doubts)), complex)
    if not doubts:
        return columns
    known = shifts is not None or moves_matrices_alone(problem, internal)
    together = np.array([known and isinstance(doubt.direction, RobotMove) for doubt in doubts])
    with np.errstate(divide="ignore", invalid="ignore"):  # what is exactly zero has no relative change
        for index in np.flatnonzero(~together).tolist():
            columns[..., index] = _column(doubts[index], scene, must_rest=all_rest)
        if together.any():
            moves = [doubt for doubt in doubts if isinstance(doubt.direction, RobotMove)]
            rested = scene.settled() if shifts is None else scene
            columns[..., together] = rested.along(shifts or find_shifts(rested, moves, must_rest=all_rest))
    columns[scene.response.sampled == 0] = 0.0
    if amounts is not None and shifts is None:
        columns /= _more_of_it(doubts, amounts)
    return kind.part(columns * kind.per_relative(scene.response.sampled)[..., None])


def _more_of_it(doubts: Sequence[DoubtColumn], amounts: FloatArray) -> FloatArray:
    """How much more a per cent of a body (n_doubt,) is that is off, than of the one that the file states."""
    shares = np.array([isinstance(doubt.direction, RobotMove) and doubt.unit == "%" for doubt in doubts])
    return np.where(shares, 1 + amounts / _PERCENT, 1.0)


def find_shifts(scene: Scene, moves: Sequence[DoubtColumn], *, must_rest: bool = True) -> Shifts:
    """Finds how the matrices of a robot move with doubts that are moves of it.

    Args:
        scene: The robot.
        moves: The doubts.
        must_rest: Whether robots near it must rest; otherwise nothing moves with doubts where they do not.

    Raises:
        DataError: If a robot near it must rest and does not.
    """
    directions = [doubt.direction for doubt in moves if isinstance(doubt.direction, RobotMove)]
    pairs = [_sides(scene, direction, must_rest=must_rest) for direction in directions]
    width = 2 * np.array([direction.step for direction in directions])
    nothing = np.zeros((len(pairs), len(scene.robot.joints)))
    return shifts_between(pairs, width, nothing[:, 0], nothing)


def _sides(scene: Scene, direction: RobotMove, *, must_rest: bool) -> tuple[LinearModel, LinearModel]:
    """The robot with a little less and a little more of a doubt; as it is where one of them does not rest."""
    try:
        behind, ahead = (
            scene.rested(direction.moved(scene.robot, step), scene.values)[0]
            for step in (-direction.step, direction.step)
        )
    except DataError:
        if must_rest:
            raise
        return scene.problem.model, scene.problem.model
    return behind, ahead


def _column(doubt: DoubtColumn, scene: Scene, *, must_rest: bool) -> ComplexArray:
    try:
        return doubt.direction.column(scene)
    except DataError:
        if must_rest:
            raise
        return np.zeros(scene.problem.frf.response.shape, complex)
