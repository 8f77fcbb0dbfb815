"""Robots whose files say something else: each function returns a robot that is off from another one by an amount."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeAlias, TypeVar

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import HarmonicBalance, Inertial, Robot

Change: TypeAlias = Callable[[Robot, Callable[[Inertial], Inertial]], Robot]
"""Returns a robot one of whose bodies is another."""
PERCENT, MM = 100.0, 1e3
_Part = TypeVar("_Part")


def with_link(index: int, robot: Robot, change: Callable[[Inertial], Inertial]) -> Robot:
    """The robot with another link, what lies beyond its splits changed alike."""
    joint = robot.joints[index]
    springs = tuple(
        replace(spring, outboard=change(spring.outboard)) if spring.joint == index and spring.outboard else spring
        for spring in robot.springs
    )
    joints = _with(robot.joints, index, replace(joint, link=change(joint.link)))
    return replace(robot, joints=joints, springs=springs)


def with_base(robot: Robot, change: Callable[[Inertial], Inertial]) -> Robot:
    """The robot with another base."""
    return robot if robot.base is None else replace(robot, base=change(robot.base))


def with_payload(robot: Robot, change: Callable[[Inertial], Inertial]) -> Robot:
    """The robot with another payload."""
    return replace(robot, payload=change(robot.payload))


def heavier(of: Change, robot: Robot, percent: float) -> Robot:
    """The robot one of whose bodies has more mass, in the same shape."""
    return of(robot, partial(_shared, 1 + percent / PERCENT))


def more_inert(of: Change, robot: Robot, percent: float) -> Robot:
    """The robot one of whose bodies has more inertia about its centre, of the same mass."""
    return of(robot, partial(_turned, 1 + percent / PERCENT))


def shifted(of: Change, axis: FloatArray, robot: Robot, shift_mm: float) -> Robot:
    """The robot one of whose centres of mass lies further along an axis (3,)."""
    return of(robot, partial(_shifted, shift_mm / MM * axis))


def with_carried_share(index: int, robot: Robot, percent: float) -> Robot:
    """The robot with a link that is heavier, the last one with the payload that it carries."""
    found = heavier(partial(with_link, index), robot, percent)
    return heavier(with_payload, found, percent) if index == len(robot.joints) - 1 else found


def with_shaft_share(index: int, robot: Robot, percent: float) -> Robot:
    """The robot with a shaft that has more inertia."""
    shaft = robot.springs[index]
    more = replace(shaft, inertia_kgm2=shaft.inertia_kgm2 * (1 + percent / PERCENT))
    return replace(robot, springs=_with(robot.springs, index, more))


def with_payload_mass(robot: Robot, added_kg: float) -> Robot:
    """The robot with a heavier payload of the same shape."""
    return with_payload(robot, partial(_shared, 1 + added_kg / robot.payload.mass_kg))


def with_coupling(index: int, other: int, robot: Robot, percent: float) -> Robot:
    """The robot with a joint that turns by more percent of what another joint's motor does to its own."""
    joint, driven = robot.joints[index], robot.joints[other]
    turn = joint.couplings.get(driven.name, 0.0) + percent / PERCENT / driven.motor.gear_ratio
    coupled = replace(joint, couplings={**joint.couplings, driven.name: turn})
    return replace(robot, joints=_with(robot.joints, index, coupled))


def with_balance(index: int, waves: FloatArray, robot: Robot, torque_nm: float) -> Robot:
    """The robot with more torque by the sine and the cosine (2,) of a joint's angle."""
    joint = robot.joints[index]
    own = joint.counterbalance
    sine, cosine = (own.sine_nm, own.cosine_nm) if isinstance(own, HarmonicBalance) else np.zeros((2, 1))
    more = torque_nm * waves
    balanced = replace(joint, counterbalance=HarmonicBalance(sine + more[0], cosine + more[1]))
    return replace(robot, joints=_with(robot.joints, index, balanced))


def with_gear_ratio(index: int, robot: Robot, more: float) -> Robot:
    """The robot one of whose gear ratios is larger."""
    joint = robot.joints[index]
    motor = replace(joint.motor, gear_ratio=joint.motor.gear_ratio + more)
    return replace(robot, joints=_with(robot.joints, index, replace(joint, motor=motor)))


def _with(parts: tuple[_Part, ...], index: int, part: _Part) -> tuple[_Part, ...]:
    return (*parts[:index], part, *parts[index + 1 :])


def _shared(factor: float, body: Inertial) -> Inertial:
    return Inertial(body.mass_kg * factor, body.com_m, body.inertia_kgm2 * factor)


def _turned(factor: float, body: Inertial) -> Inertial:
    return replace(body, inertia_kgm2=body.inertia_kgm2 * factor)


def _shifted(shift_m: FloatArray, body: Inertial) -> Inertial:
    return replace(body, com_m=body.com_m + shift_m)
