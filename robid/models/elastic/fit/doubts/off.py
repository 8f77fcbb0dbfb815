"""A robot that is off by its doubts, and the fit's problem for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.models.elastic.fit.doubts.drives import LaterTorque, MotorFriction, RotorShare, ViscousFriction
from robid.models.elastic.fit.doubts.extension import extended_values, hold_options
from robid.models.elastic.fit.doubts.gears import Hysteresis, LoadStiffness
from robid.models.elastic.fit.doubts.held import HeldSpring
from robid.models.elastic.fit.doubts.scene import Scene, with_estimated_links
from robid.models.elastic.fit.doubts.springs import Compliance, stiffened
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import rest_model
from robid.robot.description import Robot
from robid.robot.response import ElasticParameters, nominal_parameters

_PERCENT = 100.0
_OF_GEARS = (Hysteresis, LoadStiffness)
_OF_PLACES = (*_OF_GEARS, MotorFriction)
LEAST_COMPLIANCE = 0.001
"""Percent of a gear's compliance up to which a spring is as good as not there."""


@dataclass(frozen=True)
class OffRobot:
    """A robot that is off by its doubts.

    Attributes:
        robot: The robot, springs that it has more after its own.
        options: Options of the fit, with which these springs stay as they are.
        problem: The fit's problem, with that robot at rest.
    """

    robot: Robot
    options: ElasticOptions
    problem: Problem


def are_put_in(doubts: Sequence[DoubtColumn]) -> BoolArray:
    """Tells which doubts (n_doubt,) a robot can be off by; the others do to its response what their columns say."""
    kinds = (RobotMove, Compliance, HeldSpring, LaterTorque, RotorShare, ViscousFriction, *_OF_PLACES)
    return np.array([isinstance(doubt.direction, kinds) for doubt in doubts], bool)


def may_differ(doubts: Sequence[DoubtColumn]) -> BoolArray:
    """Tells which of them (n_doubt,) may differ between its places."""
    return np.array([isinstance(doubt.direction, _OF_PLACES) for doubt in doubts], bool)


def put_in(
    problem: Problem,
    point: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    doubts: Sequence[DoubtColumn],
    amounts: FloatArray,
    added: FloatArray | None = None,
) -> OffRobot:
    """Puts doubts into a robot, which rests anew.

    Args:
        problem: The problem of the robot that is right.
        point (n_param,): Internal parameters.
        robot: The robot that the doubts were listed for.
        options: Options of the fit.
        doubts: The doubts.
        amounts (n_doubt,): By how much it is off.
        added (n_conf, n_doubt): What each configuration adds to doubts that may differ; nothing when not given.

    Raises:
        DataError: If that robot does not rest.
    """
    frf, delay_s = problem.frf, float(problem.parameters.nominal.delay[0])
    statics, further = options.statics, []
    for doubt, amount in zip(doubts, amounts.tolist(), strict=True):
        if isinstance(doubt.direction, RobotMove) and amount:
            robot = doubt.direction.moved(robot, amount)
        elif isinstance(doubt.direction, Compliance) and amount >= LEAST_COMPLIANCE:
            further.append(stiffened(doubt.direction.spring, _PERCENT / amount))
    for spring in further:
        options = hold_options(options, robot, spring)
    values = extended_values(_off_values(problem.parameters.parameters(point), doubts, amounts), further)
    robot = replace(robot, springs=(*robot.springs, *further))
    options = replace(options, statics=statics)
    model = with_estimated_links(rest_model(robot, frf, options, float(values.delay[0]), values), problem)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    nominal = _off_values(nominal_parameters(robot, model, delay_s), doubts, amounts)
    own, free = problem.parameters, replace(options, bounds={})
    parameters = replace(
        map_parameters(robot, nominal, free, *known),
        element_scale=own.element_scale,
        lower=own.lower,
        upper=own.upper,
    )
    resting = replace(problem, model=model, parameters=parameters)
    off = amounts + (np.zeros((len(frf.configurations), 1)) if added is None else added)
    scene = Scene(resting, point, robot, options)
    model = replace(model, added=_added(scene, doubts, off), clinging=_clinging(scene, doubts, off))
    return OffRobot(robot, options, replace(resting, model=model))


def _off_values(values: ElasticParameters, doubts: Sequence[DoubtColumn], amounts: FloatArray) -> ElasticParameters:
    """Values, of which those that no fit estimates are off."""
    kinds = ("stiffness", "damping", "motor_inertia", "viscous", "arm_viscous", "delay")
    sizes = {kind: getattr(values, kind).copy() for kind in kinds}
    for doubt, amount in zip(doubts, amounts.tolist(), strict=True):
        direction = doubt.direction
        if isinstance(direction, HeldSpring):
            sizes[direction.kind][direction.spring] *= 1 + amount / _PERCENT
        elif isinstance(direction, LaterTorque):
            sizes["delay"] += direction.size(amount)
        elif isinstance(direction, RotorShare):
            sizes["motor_inertia"][direction.joint] *= 1 + amount / _PERCENT
        elif isinstance(direction, ViscousFriction):
            sizes[direction.kind][direction.joint] += amount * direction.size(values)
    return replace(values, **sizes)


def _added(scene: Scene, doubts: Sequence[DoubtColumn], amounts: FloatArray) -> ComplexArray | None:
    """What springs (n_conf, n_freq, n_spring) have beyond their stiffness, over it; None for nothing."""
    added = np.zeros((*scene.problem.frf.response.shape[:2], len(scene.robot.springs)), complex)
    for doubt, off in zip(doubts, amounts.T, strict=True):
        if isinstance(doubt.direction, _OF_GEARS) and off.any():
            added[..., doubt.direction.spring] += off[:, None] * doubt.direction.share(scene)
    return added if added.any() else None


def _clinging(scene: Scene, doubts: Sequence[DoubtColumn], amounts: FloatArray) -> ComplexArray | None:
    """Torques per motor's angle (n_conf, n_motor) [N m/rad]; None for none."""
    clinging = np.zeros((len(amounts), len(scene.robot.joints)), complex)
    for doubt, off in zip(doubts, amounts.T, strict=True):
        if isinstance(doubt.direction, MotorFriction):
            clinging[:, doubt.direction.joint] += off * doubt.direction.stiffness(scene)
    return clinging if clinging.any() else None
