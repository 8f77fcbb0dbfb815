"""Robots whose files say something else, off by an amount, and the springs that a file may lack.

Every fit allows for missing bearings and base springs; a fit can free, and a search for causes try, further ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias, TypeVar

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.options import ElasticOptions, spring_of
from robid.robot.description import HarmonicBalance, Inertial, Joint, Robot, Spring, SpringPlace
from robid.robot.zeros import with_zeros

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


def with_zero(index: int, robot: Robot, more_deg: float) -> Robot:
    """The robot one of whose joints stands further about its axis than its encoder shows."""
    return with_zeros(robot, {robot.joints[index].name: more_deg})


def _with(parts: tuple[_Part, ...], index: int, part: _Part) -> tuple[_Part, ...]:
    return (*parts[:index], part, *parts[index + 1 :])


def _shared(factor: float, body: Inertial) -> Inertial:
    return Inertial(body.mass_kg * factor, body.com_m, body.inertia_kgm2 * factor)


def _turned(factor: float, body: Inertial) -> Inertial:
    return replace(body, inertia_kgm2=body.inertia_kgm2 * factor)


def _shifted(shift_m: FloatArray, body: Inertial) -> Inertial:
    return replace(body, com_m=body.com_m + shift_m)


_ALONG = 0.9  # cosine above which two axes are one
_TIME_S = 5e-4  # damping over stiffness
_SAME_M = 1e-3  # between axes that are one
_UNKNOWN_NM_RAD = 1e6  # where no gear is stated
_STIFFER = 3.0  # than the gear nearby: where a trial starts
_RIGID_HZ = 30.0  # where a rotor would swing on a trial gear
_SHOWN = 4  # digits of an axis
_OUTBOARD = 0.6  # share of a link beyond a split
_BELOW_M, _OTHER_M = 2, (1, 4)  # where a base may tilt about, below its origin: what is tried, and what then
_BEFORE, _OTHERWISE = 30, (10, 50)  # percent of a link between gear and hinge: what is tried, and what then


@dataclass(frozen=True)
class FurtherSpring:
    """A spring that a robot file may lack."""

    spring: Spring  # The spring, as stiff as a trial of it starts; its name frees it
    title: str  # What it is, for a sentence
    after: str = ""  # Name of the one that must help before it is tried, for a search; empty for one tried at once


def with_estimated_springs(robot: Robot, options: ElasticOptions) -> Robot:
    """Returns a robot with the springs that a fit frees though the robot file lacks them.

    Args:
        robot: The robot file's robot.
        options: Options of the fit; their names may end as those of the nuisances do, on `.compliance`.
    """
    wanted = {spring_of(name) for name in options.estimated}
    more = [each.spring for each in further_springs(robot) if each.spring.name in wanted] if wanted else []
    return replace(robot, springs=(*robot.springs, *more)) if more else robot


def is_spring(robot: Robot, name: str) -> bool:
    """Whether a name is that of a spring of the robot, or of one that it may lack."""
    own = {spring.name for spring in robot.springs} | {each.spring.name for each in further_springs(robot)}
    return spring_of(name) in own


def further_springs(robot: Robot) -> Iterator[FurtherSpring]:
    """Yields the springs that a robot file may lack."""
    stiffness = _gear_stiffness(robot)
    last = len(robot.joints) - 1
    for index, joint in enumerate(robot.joints):
        stiff = _STIFFER * stiffness[index]
        if robot.rigid[index] and robot.rotor == "spong":
            reflected = joint.motor.gear_ratio**2 * joint.motor.inertia_kgm2
            gear = (2 * np.pi * _RIGID_HZ) ** 2 * reflected
            spring = _trial_spring(f"gear_{joint.name}", index, "transmission", np.eye(3)[2], gear)
            yield FurtherSpring(spring, f"gear of {joint.name}")
        if not robot.rigid[index] and joint.type == "revolute":
            yield from _hinges(robot, index, stiff)
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            if index == 0 and not _is_there(robot, "base", 0, axis):
                yield FurtherSpring(_trial_spring(f"base_{letter}", 0, "base", axis, stiff), f"base about {letter}")
                yield from _far_bases(robot, letter, axis)
            if letter != "z" and not _is_there(robot, "bearing", index, axis):
                spring = _trial_spring(f"bearing_{joint.name}_{letter}", index, "bearing", axis, stiff)
                yield FurtherSpring(spring, f"bearing of {joint.name} about {letter}")
            if index < last and not _is_there(robot, "split", index, None):
                split = _trial_spring(
                    f"link_{joint.name}_{letter}", index, "split", axis, _STIFFER * stiffness[index + 1]
                )
                split = replace(
                    split, outboard=_part(joint.link, _OUTBOARD), point_m=_middle(robot.joints[index + 1], axis)
                )
                title = f"link of {joint.name} about its {letter} axis"
                yield FurtherSpring(split, title + _in_file(robot.link_axes(index), axis))
            if (
                index == last
                and letter != "z"
                and robot.payload.mass_kg > 0
                and not _is_there(robot, "payload", last, axis)
            ):
                spring = _trial_spring(f"payload_mount_{letter}", last, "payload", axis, stiff)
                yield FurtherSpring(spring, f"payload mount about {letter}" + _in_file(robot.payload_axes, axis))


def _in_file(axes: FloatArray, axis: FloatArray) -> str:
    """How the file writes an axis (3,) of a joint frame, where its own axes (3, 3) are others."""
    stated = (axes.T @ axis).round(_SHOWN) + 0.0
    return "" if np.allclose(stated, axis) else f" (`axis: [{', '.join(f'{x:g}' for x in stated.tolist())}]` there)"


def _middle(following: Joint, axis: FloatArray) -> FloatArray:
    """Where a link is split: a link that twists along the next joint's axis does so about that very line."""
    along = abs(float(axis @ following.rotation[:, 2])) > _ALONG
    return following.position_m if along else np.zeros(3)


def _far_bases(robot: Robot, letter: str, axis: FloatArray) -> Iterator[FurtherSpring]:
    """Yields bases that tilt about a level axis metres below the origin, as on a long column or a soft foundation."""
    bodies = (*(joint.link for joint in robot.joints), robot.payload, *((robot.base,) if robot.base else ()))
    mass_kg = sum(body.mass_kg for body in bodies)
    for metres in (_BELOW_M, *_OTHER_M) if letter != "z" else ():
        # All of the robot swings on it, by the distance squared; so it begins where that would be of some frequency.
        stiffness = (2 * np.pi * _RIGID_HZ) ** 2 * max(mass_kg, 1.0) * metres**2
        far = _trial_spring(f"base_{letter}_{metres}m", 0, "base", axis, stiffness)
        far = replace(far, point_m=np.array([0.0, 0.0, -float(metres)]))
        first = "" if metres == _BELOW_M else f"base_{letter}_{_BELOW_M}m"
        yield FurtherSpring(far, f"base about {letter}, {metres} m below", first)


def _hinges(robot: Robot, index: int, stiffness: float) -> Iterator[FurtherSpring]:
    """Yields hinges in line with a gear, with some of the joint's link between: what lies there tells them apart.

    A link without weight has nothing there, and one whose split says what lies beyond keeps at least that.
    """
    joint, name = robot.joints[index], f"hinge_{robot.joints[index].name}"
    upright = np.array([0.0, 0.0, 1.0])
    kept = [spring for spring in robot.springs if spring.joint == index and spring.place == "split"]
    least = max((spring.outboard.mass_kg for spring in kept if spring.outboard is not None), default=0.0)
    if joint.link.mass_kg <= 0 or any(abs(float(spring.axis @ upright)) > _ALONG for spring in kept):
        return
    for percent in (_BEFORE, *_OTHERWISE):
        beyond = _part(joint.link, 1 - percent / PERCENT)
        if beyond.mass_kg > least:
            spring = replace(_trial_spring(f"{name}_{percent}", index, "split", upright, stiffness), outboard=beyond)
            title = f"hinge in line with the gear of {joint.name}, {percent} % of the link before it"
            yield FurtherSpring(spring, title, "" if percent == _BEFORE else f"{name}_{_BEFORE}")


def _part(link: Inertial, share: float) -> Inertial:
    return Inertial(share * link.mass_kg, link.com_m, share * link.inertia_kgm2)


def missing_springs(robot: Robot) -> Iterator[Spring]:
    """Yields bearings and base springs that a robot file lacks, each as stiff as the gear of its joint.

    A base that turns about an axis through the origin of a first joint that turns too does what bearings and gear of
    that joint do, and is none of its own.
    """
    stiffness = _gear_stiffness(robot)
    first = robot.joints[0]
    for letter, axis in zip("xyz", np.eye(3), strict=True):
        beside = np.linalg.norm(np.cross(axis, first.position_m)) > _SAME_M
        if not _is_there(robot, "base", 0, axis) and (beside or first.type == "prismatic"):
            yield _trial_spring(f"base_{letter}", 0, "base", axis, stiffness[0])
    for index, joint in enumerate(robot.joints):
        for letter, axis in zip("xy", np.eye(3), strict=False):
            if not _is_there(robot, "bearing", index, axis):
                yield _trial_spring(f"bearing_{joint.name}_{letter}", index, "bearing", axis, stiffness[index])


def _gear_stiffness(robot: Robot) -> list[float]:
    """What a torsional spring at each joint is measured by: its gear, else the stiffest one [N m/rad]."""
    gears = {s.joint: s.stiffness for s in robot.springs if s.place == "transmission" and not robot.is_linear(s)}
    others = [s.stiffness for s in robot.springs if not robot.is_linear(s)]
    else_ = max(gears.values(), default=max(others, default=_UNKNOWN_NM_RAD))
    return [gears.get(index, else_) for index in range(len(robot.joints))]


def _is_there(robot: Robot, place: str, joint: int, axis: FloatArray | None) -> bool:
    """Whether the robot has such a spring, about this axis or, for None, about any."""
    own = [spring.axis for spring in robot.springs if spring.place == place and spring.joint == joint]
    return any(axis is None or abs(float(axis @ each)) > _ALONG for each in own)


def stiffened(spring: Spring, factor: float) -> Spring:
    """A spring that is stiffer by a factor, its damper too."""
    return replace(spring, stiffness=factor * spring.stiffness, damping=factor * spring.damping)


def _trial_spring(name: str, joint: int, place: SpringPlace, axis: FloatArray, stiffness: float) -> Spring:
    """Returns a spring that a file may lack, with a damper of its size."""
    return Spring(name, joint, place, axis, stiffness, _TIME_S * stiffness)
