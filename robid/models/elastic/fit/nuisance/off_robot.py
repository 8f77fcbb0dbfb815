"""Robots that are not as their file says, and the fit's own problem for them: with further springs, or off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.elastic.fit.nuisance.columns import (
    FRICTION,
    clinging_stiffness,
    gear_share,
    rotor_ratios,
    value_of_one,
)
from robid.models.elastic.fit.nuisance.effects import (
    Compliance,
    GearShare,
    MotorFriction,
    Nuisance,
    ValueOff,
    moved_robot,
)
from robid.models.elastic.fit.nuisance.moves import PERCENT, stiffened
from robid.models.elastic.fit.nuisance.scene import Scene, extended_values, with_estimated_links
from robid.models.elastic.fit.options import BY_SPRING, ElasticOptions
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import Problem, without_coefficients
from robid.models.elastic.fit.rest_model import rest_model
from robid.robot.description import Robot, Spring
from robid.robot.parameters import element_names
from robid.robot.response import ElasticParameters, nominal_parameters

LEAST_COMPLIANCE = 0.001
"""Percent of a gear's compliance up to which a spring is as good as not there."""


def extend_options(options: ElasticOptions, robot: Robot, springs: Sequence[Spring], *, fixing: bool) -> ElasticOptions:
    """Returns options with which stiffness and damping of further springs are free, their locations are not.

    Args:
        options: Options of the fit.
        robot: The robot with the further springs.
        springs: The further springs.
        fixing: Whether springs and dampers that the fit does not estimate stay as they are. Free, they explain what a
            further spring does not; fixed, they stand in the way of a descent that has to go far.
    """
    free = tuple(dict.fromkeys([*options.kinds, *BY_SPRING, *options.estimated]))
    located = [name for spring in springs for name in _names_of(spring, robot, ("location",))]
    further = {spring.name for spring in springs}
    own = [spring.name for spring in robot.springs if spring.name not in further]
    names = [(kind, f"{name}.{kind}") for kind in BY_SPRING for name in own]
    kept = [name for kind, name in names if fixing and not options.frees(kind, name)]
    fixed = (*options.fixed, *kept, *(located if "location" in free else ()))
    return replace(options, free=free, fixed=fixed, statics="updates")


def fix_options(options: ElasticOptions, robot: Robot, spring: Spring) -> ElasticOptions:
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
    parameters, count = problem.parameters, internal.size - problem.parameters.n_friction
    still = replace(without_coefficients(problem.frf), response=problem.measured(internal))
    own = {name: getattr(parameters, name)[:count] for name in _PER_PARAMETER}
    return replace(problem, frf=still, parameters=replace(parameters, **own, friction_offset=np.zeros(0)))


_PER_PARAMETER = ("names", "kind_of", "units", "logarithmic", "prior_std", "lower", "upper")


@dataclass(frozen=True)
class OffRobot:
    """A robot that is off by its nuisances."""

    robot: Robot  # The robot, springs that it has more after its own
    options: ElasticOptions  # Options of the fit, with which these springs stay as they are
    problem: Problem  # The fit's problem, with that robot at rest


def are_put_in(nuisances: Sequence[Nuisance]) -> BoolArray:
    """Tells which of them (n_nuisance,) a robot can be off by; the others do to its response what their columns say."""
    return np.array([each.effect.put_in for each in nuisances], bool)


def may_differ(nuisances: Sequence[Nuisance]) -> BoolArray:
    """Tells which of them (n_nuisance,) may differ between its clusters."""
    return np.array([each.effect.by_cluster for each in nuisances], bool)


def put_in(
    problem: Problem,
    point: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    nuisances: Sequence[Nuisance],
    amounts: FloatArray,
    added: FloatArray | None = None,
) -> OffRobot:
    """Puts nuisances into a robot, which rests anew.

    Args:
        problem: The problem of the robot that is right.
        point (n_param,): Internal parameters.
        robot: The robot that the nuisances were listed for.
        options: Options of the fit.
        nuisances: The nuisances.
        amounts (n_nuisance,): By how much it is off.
        added (n_conf, n_nuisance): What each configuration adds to nuisances that may differ; nothing when not given.

    Raises:
        DataError: If that robot does not rest.
    """
    frf, delay_s = problem.frf, float(problem.parameters.nominal.delay[0])
    statics, every = options.statics, list(zip(nuisances, amounts.tolist(), strict=True))
    # A spring that the file lacks joins its springs, before geometry moves them alike; what changes masses and geometry
    # is put into the description; values, gears and friction follow below, where the model is linear.
    further = [
        stiffened(nuisance.effect.spring, PERCENT / amount)
        for nuisance, amount in every
        if isinstance(nuisance.effect, Compliance) and amount >= LEAST_COMPLIANCE
    ]
    for spring in further:
        options = fix_options(options, robot, spring)
    now, file = problem.parameters.parameters(point), robot.motor_inertia_kgm2
    rotors = file, rotor_ratios(problem, now)
    values = extended_values(_off_values(now, nuisances, amounts, rotors), further)
    robot = moved_robot(replace(robot, springs=(*robot.springs, *further)), nuisances, amounts)
    options = replace(options, statics=statics)
    model = with_estimated_links(rest_model(robot, frf, options, float(values.delay[0]), values), problem)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    nominal = _off_values(nominal_parameters(robot, model, delay_s), nuisances, amounts, rotors)
    own, free = problem.parameters, replace(options, bounds={})
    parameters = replace(
        map_parameters(robot, nominal, free, *known), element_scale=own.element_scale, lower=own.lower, upper=own.upper
    )
    # Scales and bounds are those of the problem without nuisances, so that its internal values mean the same.
    resting = replace(problem, model=model, parameters=parameters)
    off = amounts + (np.zeros((len(frf.configurations), 1)) if added is None else added)
    scene = Scene(resting, point, robot, options)
    model = replace(model, added=_added(scene, nuisances, off), clinging=_clinging(scene, nuisances, off))
    return OffRobot(robot, options, replace(resting, model=model))


def _off_values(
    values: ElasticParameters,
    nuisances: Sequence[Nuisance],
    amounts: FloatArray,
    rotors: tuple[FloatArray, FloatArray],
) -> ElasticParameters:
    """Values, of which those that no fit estimates are off; with the file's rotors (n_joint,), and the ratios to it."""
    stated = replace(values, motor_inertia=rotors[0])
    off: dict[str, FloatArray] = {}
    for each, amount in zip(nuisances, amounts.tolist(), strict=True):
        if isinstance(each.effect, ValueOff):
            own = off.setdefault(each.effect.kind, getattr(values, each.effect.kind).copy())
            if each.effect.kind in ("stiffness", "damping", "motor_inertia"):
                own[each.effect.element] *= 1 + amount / PERCENT
            else:
                more = float(rotors[1][each.effect.element]) if each.effect.kind in FRICTION else 1.0
                own[each.effect.element] += amount * more * value_of_one(each.effect, stated)
    return replace(values, **off)


def _added(scene: Scene, nuisances: Sequence[Nuisance], amounts: FloatArray) -> ComplexArray | None:
    """What springs (n_conf, n_freq, n_spring) have beyond their stiffness, over it; None for nothing."""
    added = np.zeros((*scene.problem.frf.response.shape[:2], len(scene.robot.springs)), complex)
    for each, off in zip(nuisances, amounts.T, strict=True):
        if isinstance(each.effect, GearShare) and off.any():
            added[..., each.effect.spring] += off[:, None] * gear_share(each.effect, scene)
    return added if added.any() else None


def _clinging(scene: Scene, nuisances: Sequence[Nuisance], amounts: FloatArray) -> ComplexArray | None:
    """Torques per motor's angle (n_conf, n_motor) [N m/rad]; None for none."""
    clinging = np.zeros((len(amounts), len(scene.robot.joints)), complex)
    for each, off in zip(nuisances, amounts.T, strict=True):
        if isinstance(each.effect, MotorFriction):
            clinging[:, each.effect.joint] += off * clinging_stiffness(each.effect, scene)
    return clinging if clinging.any() else None
