"""What masses and inertias that come from elsewhere leave open of the elastic parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.parameters import ParameterMap, map_parameters
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.rest_model import rest_model
from robid.robot.description import Robot
from robid.robot.response import nominal_parameters


@dataclass(frozen=True)
class DoubtfulRobot:
    """A robot whose rigid parameters are off along one of several independent directions.

    Attributes:
        robot: The robot.
        deviations: By how many standard deviations; not zero.
    """

    robot: Robot
    deviations: float


def considered_covariance(
    problem: Problem, internal: FloatArray, options: ElasticOptions, delay_s: float, doubtful: Sequence[DoubtfulRobot]
) -> FloatArray:
    """Covariance (n_param, n_param) of the internal parameters by what the rigid parameters leave open.

    A fit to another robot would end elsewhere: to first order one step of Gauss and Newton from where this one ended.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        options: Options of the fit.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        doubtful: Robots that are off along independent directions.

    Source:
        Schmidt (1966), considered parameters, with finite differences of the gradient; METHODS sec. 11.
    """
    total = np.zeros((internal.size, internal.size))
    if not doubtful:
        return total
    here = problem.normal(internal)
    inverse = np.linalg.pinv(here.hessian, rcond=1e-14, hermitian=True)
    for other in doubtful:
        moved = _with_robot(problem, internal, options, delay_s, other.robot)
        start = same_values(moved.parameters, problem.parameters, internal)
        end = start - inverse @ (moved.normal(start).gradient - here.gradient)
        shift = (same_values(problem.parameters, moved.parameters, end) - internal) / other.deviations
        total += np.outer(shift, shift)
    return total


def same_values(target: ParameterMap, source: ParameterMap, internal: FloatArray) -> FloatArray:
    """Internal parameters (n_param,) of one map that have the values that another map's have.

    Args:
        target: The map whose internal parameters are wanted.
        source: The map of the same parameters, with other nominal values.
        internal (n_param,): Internal parameters of the source.
    """
    nominal, before = target.nominal_values(), source.nominal_values()
    logarithmic = target.logarithmic
    ratio = np.log(np.where(logarithmic, before, 1.0) / np.where(logarithmic, nominal, 1.0))
    linear = (source.values(internal) - nominal) / target.scale
    return np.where(logarithmic, internal + ratio, linear)


def _with_robot(
    problem: Problem, internal: FloatArray, options: ElasticOptions, delay_s: float, robot: Robot
) -> Problem:
    """The problem with another robot, its weights the same."""
    frf, values = problem.frf, problem.parameters.parameters(internal)
    model = rest_model(robot, frf, options, delay_s, values)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, nominal_parameters(robot, model, delay_s), options, *known)
    return replace(problem, model=model, parameters=parameters)
