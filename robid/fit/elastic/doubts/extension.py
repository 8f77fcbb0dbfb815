"""A fit's own problem for a robot with one spring more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.parameters import map_parameters
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.rest_model import rest_model
from robid.robot.description import Robot
from robid.robot.parameters import names_of
from robid.robot.response import ElasticParameters, nominal_parameters


def extend_options(options: ElasticOptions, robot: Robot) -> ElasticOptions:
    """Returns options with which stiffness and damping of a robot's last spring are free, its location is not."""
    free = tuple(dict.fromkeys([*options.free, "stiffness", "damping"]))
    located = names_of("location", robot.springs[-1:], []) if "location" in free else []
    fixed = (*options.fixed, *(name for name in located if name is not None))
    return replace(options, free=free, fixed=fixed, statics="updates")


def extend_problem(problem: Problem, internal: FloatArray, robot: Robot, options: ElasticOptions) -> Problem:
    """Returns a problem, weights included, for a robot with one spring more.

    Args:
        problem: The problem of the robot without its last spring.
        internal (n_param,): Its internal parameters, with whose values the robot rests.
        robot: The robot with the spring.
        options: What `extend_options` returned.

    Raises:
        DataError: If the robot does not rest with the spring.
    """
    now, spring = problem.parameters.parameters(internal), robot.springs[-1]
    values = replace(
        now,
        stiffness=np.append(now.stiffness, spring.stiffness),
        damping=np.append(now.damping, spring.damping),
        cubic=np.append(now.cubic, spring.cubic),
        location=np.append(now.location, spring.point_m),
    )
    return problem_at(problem, values, robot, options)


def problem_at(problem: Problem, values: ElasticParameters, robot: Robot, options: ElasticOptions) -> Problem:
    """Returns a problem, weights included, for another robot that rests with some values of its parameters."""
    frf, delay_s = problem.frf, float(problem.parameters.nominal.delay[0])
    model = rest_model(robot, frf, options, delay_s, values)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, nominal_parameters(robot, model, delay_s), options, *known)
    return replace(problem, model=model, parameters=parameters)


def carry_over(target: Problem, source: Problem, internal: FloatArray) -> FloatArray:
    """Returns internal parameters of a problem, those that another one has too from there, others at nominal.

    The same names have the same nominal values in both.
    """
    before = dict(zip(source.parameters.names, internal.tolist(), strict=True))
    return np.array([before.get(name, 0.0) for name in target.parameters.names])
