"""Doubts as further columns of a least-squares problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.fit.elastic.doubts.column import DoubtColumn
from robid.fit.elastic.doubts.scene import Scene
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.problem import Problem
from robid.robot.description import Robot
from robid.robot.linearize import Shifts


def doubt_columns(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    doubts: Sequence[DoubtColumn],
    *,
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
        all_rest: Whether robots that are a little off must rest; otherwise nothing is said of doubts where they do not.
        shifts: How the robot's matrices move with the doubts, all of which are moves; found here when not given.

    Returns:
        Negative derivatives (n_conf, n_freq, n_out, n_in, n_doubt), to be put beside those by the parameters.

    Raises:
        DataError: If a robot must rest and does not.
    """
    scene, kind = Scene(problem, internal, robot, options), problem.residual_kind
    if not doubts:
        return np.zeros((*problem.frf.response.shape, 0), complex)
    with np.errstate(divide="ignore", invalid="ignore"):  # what is exactly zero has no relative change
        if shifts is not None:
            columns = scene.along(shifts)
        else:
            columns = np.stack([_column(doubt, scene, must_rest=all_rest) for doubt in doubts], axis=-1)
    columns[scene.response.sampled == 0] = 0.0
    return kind.part(columns * kind.per_relative(scene.response.sampled)[..., None])


def _column(doubt: DoubtColumn, scene: Scene, *, must_rest: bool) -> ComplexArray:
    try:
        return doubt.direction.column(scene)
    except DataError:
        if must_rest:
            raise
        return np.zeros(scene.problem.frf.response.shape, complex)
