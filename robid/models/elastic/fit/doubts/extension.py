"""A fit's own problem for a robot with further springs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.options import BY_SPRING, ElasticOptions
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import rest_model
from robid.robot.description import Robot, Spring
from robid.robot.parameters import element_names
from robid.robot.response import ElasticParameters, nominal_parameters


def extend_options(
    options: ElasticOptions, robot: Robot, springs: Sequence[Spring], *, holding: bool
) -> ElasticOptions:
    """Returns options with which stiffness and damping of further springs are free, their locations are not.

    Args:
        options: Options of the fit.
        robot: The robot with the further springs.
        springs: The further springs.
        holding: Whether springs and dampers that the fit does not estimate stay as they are. Free, they explain what a
            further spring does not; held, they stand in the way of a descent that has to go far.
    """
    free = tuple(dict.fromkeys([*options.kinds, *BY_SPRING, *options.freed]))
    located = [name for spring in springs for name in _names_of(spring, robot, ("location",))]
    further = {spring.name for spring in springs}
    own = [spring.name for spring in robot.springs if spring.name not in further]
    names = [(kind, f"{name}.{kind}") for kind in BY_SPRING for name in own]
    held = [name for kind, name in names if holding and not options.frees(kind, name)]
    fixed = (*options.fixed, *held, *(located if "location" in free else ()))
    return replace(options, free=free, fixed=fixed, statics="updates")


def hold_options(options: ElasticOptions, robot: Robot, spring: Spring) -> ElasticOptions:
    """Returns options with which a further spring stays as it is."""
    return replace(options, fixed=(*options.fixed, *_names_of(spring, robot, options.kinds)), statics="updates")


def _names_of(spring: Spring, robot: Robot, kinds: Sequence[str]) -> list[str]:
    """What a fit could estimate of a spring."""
    alone = replace(robot, springs=(spring,))
    names = (name for kind in kinds for name in element_names(alone, kind) if name is not None)
    return [name for name in names if name.startswith(f"{spring.name}.")]


def extend_problem(problem: Problem, internal: FloatArray, robot: Robot, options: ElasticOptions) -> Problem:
    """Returns a problem, weights included, for a robot with further springs after its own.

    Args:
        problem: The problem of the robot without them.
        internal (n_param,): Its internal parameters, with whose values the robot rests.
        robot: The robot with the springs.
        options: What `extend_options` returned.

    Raises:
        DataError: If the robot does not rest with the springs.
    """
    now = problem.parameters.parameters(internal)
    return problem_at(problem, extended_values(now, robot.springs[now.stiffness.size :]), robot, options)


def extended_values(values: ElasticParameters, springs: Sequence[Spring]) -> ElasticParameters:
    """Returns values of parameters with those of further springs."""
    return replace(
        values,
        stiffness=np.append(values.stiffness, [spring.stiffness for spring in springs]),
        damping=np.append(values.damping, [spring.damping for spring in springs]),
        cubic=np.append(values.cubic, [spring.cubic for spring in springs]),
        location=np.append(values.location, [spring.point_m for spring in springs]),
    )


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


def freeze_friction(problem: Problem, internal: FloatArray) -> Problem:
    """Returns a problem whose friction scales stay as they are: its parameters are all others, many times faster.

    Args:
        problem: The problem.
        internal (n_param,): Internal parameters, friction scales last.
    """
    count, frf, parameters = internal.size - problem.parameters.n_friction, problem.frf, problem.parameters
    still = replace(
        frf,
        response=problem.measured(internal),
        sensitivity=frf.sensitivity[:, :0],
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        coefficient_offset=None,
    )
    fewer = replace(
        parameters,
        names=parameters.names[:count],
        kind_of=parameters.kind_of[:count],
        units=parameters.units[:count],
        logarithmic=parameters.logarithmic[:count],
        prior_std=parameters.prior_std[:count],
        lower=parameters.lower[:count],
        upper=parameters.upper[:count],
        friction_offset=np.zeros(0),
    )
    return replace(problem, frf=still, parameters=fewer)
