"""Doubts of masses, centres of mass and inertias, of links, base, shafts and payload."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.robot.description import Inertial, Robot
from robid.robot.doubts import Doubts

_Change = Callable[[Robot, Callable[[Inertial], Inertial]], Robot]

_SHARE_STEP = 1e-4
_STEP_M = 1e-5
_FARTHEST_MM = 500.0
_PERCENT, _MM = 100.0, 1e3


def link_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the doubts of each link: its mass, with its inertia, its centre of mass, and its inertia alone."""
    for index, joint in enumerate(robot.joints):
        names = joint.name, f"link {joint.name}"
        yield from _body_doubts(names, joint.link, joint.doubts, partial(_with_link, index))


def base_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the same of what moves beneath the first joint: of the base on its springs, and of shafts."""
    if robot.base is not None and any(spring.place == "base" for spring in robot.springs):
        yield from _body_doubts(("base", "the base"), robot.base, robot.doubts, _with_base)
    for index, spring in enumerate(robot.springs):
        std = _PERCENT * robot.joints[spring.joint].doubts.inertia_relative_std
        if std > 0 and spring.inertia_kgm2 > 0:
            move = RobotMove(partial(_with_shaft_share, index), _PERCENT * _SHARE_STEP)
            names = f"{spring.name}.inertia", f"inertia of shaft {spring.name}"
            yield DoubtColumn(*names, "masses", "%", std, 0.0, move, least=-_PERCENT)


def payload_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the doubts of the payload: its mass, with its inertia, its centre of mass, and its inertia alone."""
    load, doubts = robot.payload, robot.doubts
    if load.mass_kg <= 0:
        return
    if doubts.payload_relative_std > 0:
        std = doubts.payload_relative_std * load.mass_kg
        move = RobotMove(_with_payload_mass, _SHARE_STEP * load.mass_kg)
        names = "payload.mass", "payload mass"
        limits = -load.mass_kg, load.mass_kg
        yield DoubtColumn(*names, "payload", "kg", std, 0.0, move, *limits, stated=load.mass_kg)
    if doubts.payload_com_m > 0:
        for axis, letter in enumerate("xyz"):
            move = RobotMove(partial(_with_payload_at, np.eye(3)[axis]), _MM * _STEP_M)
            yield _centre("payload", "the payload", letter, "payload", doubts.payload_com_m, move)
    if doubts.payload_inertia_relative_std > 0 and load.inertia_kgm2.any():
        std = _PERCENT * doubts.payload_inertia_relative_std
        move = RobotMove(_with_payload_inertia, _PERCENT * _SHARE_STEP)
        names = "payload.inertia", "inertia of the payload"
        yield DoubtColumn(*names, "payload", "%", std, 0.0, move, least=-_PERCENT)


def _body_doubts(names: tuple[str, str], body: Inertial, doubts: Doubts, of: _Change) -> Iterator[DoubtColumn]:
    owner, title = names
    if doubts.mass_relative_std > 0:
        move = RobotMove(partial(_with_share, of), _PERCENT * _SHARE_STEP)
        std, mass = _PERCENT * doubts.mass_relative_std, (f"{owner}.mass", f"mass of {title}")
        yield DoubtColumn(*mass, "masses", "%", std, 0.0, move, least=-_PERCENT, most=_PERCENT)
    if doubts.com_m > 0 and body.mass_kg > 0:
        for axis, letter in enumerate("xyz"):
            move = RobotMove(partial(_with_centre_at, of, np.eye(3)[axis]), _MM * _STEP_M)
            yield _centre(owner, title, letter, "masses", doubts.com_m, move)
    if doubts.inertia_relative_std > 0 and body.inertia_kgm2.any():
        move = RobotMove(partial(_with_inertia_share, of), _PERCENT * _SHARE_STEP)
        std, inertia = _PERCENT * doubts.inertia_relative_std, (f"{owner}.inertia", f"inertia of {title}")
        yield DoubtColumn(*inertia, "masses", "%", std, 0.0, move, least=-_PERCENT)


def _centre(owner: str, body: str, letter: str, cause: str, std_m: float, move: RobotMove) -> DoubtColumn:
    names = f"{owner}.com_{letter}", f"centre of mass of {body} along {letter}"
    return DoubtColumn(*names, cause, "mm", _MM * std_m, 0.0, move, least=-_FARTHEST_MM, most=_FARTHEST_MM)


def _shared(factor: float, body: Inertial) -> Inertial:
    """A body of the same shape with another mass."""
    return Inertial(body.mass_kg * factor, body.com_m, body.inertia_kgm2 * factor)


def _turned(factor: float, body: Inertial) -> Inertial:
    """A body of the same mass with another inertia about its centre."""
    return replace(body, inertia_kgm2=body.inertia_kgm2 * factor)


def _shifted(shift_m: FloatArray, body: Inertial) -> Inertial:
    return replace(body, com_m=body.com_m + shift_m)


def _with_link(index: int, robot: Robot, change: Callable[[Inertial], Inertial]) -> Robot:
    """The robot with another link, what lies beyond its splits changed alike."""
    joints = [
        replace(joint, link=change(joint.link)) if row == index else joint for row, joint in enumerate(robot.joints)
    ]
    springs = [
        replace(spring, outboard=change(spring.outboard)) if spring.joint == index and spring.outboard else spring
        for spring in robot.springs
    ]
    return replace(robot, joints=tuple(joints), springs=tuple(springs))


def with_carried_share(index: int, robot: Robot, percent: float) -> Robot:
    """The robot with a link that is heavier by some percent, the last one with the payload that it carries."""
    heavier = _with_share(partial(_with_link, index), robot, percent)
    last = index == len(robot.joints) - 1
    return replace(heavier, payload=_shared(1 + percent / _PERCENT, robot.payload)) if last else heavier


def _with_base(robot: Robot, change: Callable[[Inertial], Inertial]) -> Robot:
    return robot if robot.base is None else replace(robot, base=change(robot.base))


def _with_share(of: _Change, robot: Robot, percent: float) -> Robot:
    return of(robot, partial(_shared, 1 + percent / _PERCENT))


def _with_inertia_share(of: _Change, robot: Robot, percent: float) -> Robot:
    return of(robot, partial(_turned, 1 + percent / _PERCENT))


def _with_centre_at(of: _Change, axis: FloatArray, robot: Robot, shift_mm: float) -> Robot:
    return of(robot, partial(_shifted, shift_mm / _MM * axis))


def _with_shaft_share(index: int, robot: Robot, percent: float) -> Robot:
    shaft = robot.springs[index]
    heavier = replace(shaft, inertia_kgm2=shaft.inertia_kgm2 * (1 + percent / _PERCENT))
    return replace(robot, springs=(*robot.springs[:index], heavier, *robot.springs[index + 1 :]))


def _with_payload_mass(robot: Robot, added_kg: float) -> Robot:
    return replace(robot, payload=_shared(1 + added_kg / robot.payload.mass_kg, robot.payload))


def _with_payload_at(axis: FloatArray, robot: Robot, shift_mm: float) -> Robot:
    return replace(robot, payload=_shifted(shift_mm / _MM * axis, robot.payload))


def _with_payload_inertia(robot: Robot, percent: float) -> Robot:
    return replace(robot, payload=_turned(1 + percent / _PERCENT, robot.payload))
