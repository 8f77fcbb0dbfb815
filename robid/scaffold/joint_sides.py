"""Whether the angles and torques of a log are those of the joints or of their motors, by their sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from robid.scaffold.sizes import drives

if TYPE_CHECKING:
    from robid.logs.inspection.channels import Entry
    from robid.logs.inspection.findings import Findings
    from robid.scaffold.chains import CarriedJoint

_REACH = 1.1  # of a joint's range that its angles may cover
_ENDLESS = 4 * math.pi  # range of a joint that states none [rad]
_STILL = 0.1  # rad that no joint moves further where motors, whose angles were read, drive it in a large motion


def behind_gears(found: Findings, joints: Sequence[CarriedJoint]) -> tuple[Findings, tuple[str, ...]]:
    """Names channels `<joint>.arm` where they are the joints', as metres and newtons of slides always are.

    Controllers of arms log large motions on either side. Angles are the joints' where every joint has the room for
    them and their motors would hardly move any. Torques are, where they are nearer to what the joints carry than to
    the same over their gear ratios.

    Args:
        found: What is in the log, its channels named after the joints.
        joints: The robot's, base to flange.

    Returns:
        The findings, and what is to be checked of them.
    """
    made = found.proposal
    ratios = {joint.name: drive.ratio for joint, drive in zip(joints, drives(joints), strict=True)}
    turning = {joint.name: joint for joint in joints if not joint.slides}
    is_motion = made.is_motion or made.one_shot
    angles, torques, commands = (
        set(turning) if is_motion and are_joints(entries, turning, ratios) else set[str]()
        for are_joints, entries in (
            (_are_joints_angles, made.outputs),
            (_are_joints_torques, made.inputs),
            (_are_joints_angles, made.references),
        )
    )
    slides = {joint.name for joint in joints if joint.slides}
    made = replace(
        made,
        inputs=_of_arms(made.inputs, torques, slides),
        outputs=_of_arms(made.outputs, angles, slides),
        references=_of_arms(made.references, commands, slides),
    )
    what = " and ".join(name for name, are_joints in (("angles", angles), ("torques", torques)) if are_joints)
    told = (
        f"{what} are taken for those of the joints, by their size: take `.arm` off their names if they are the motors'"
    )
    return replace(found, proposal=made), ((told,) if what else ())


def _of_arms(entries: tuple[Entry, ...], joints: set[str], slides: set[str]) -> tuple[Entry, ...]:
    def is_arms(one: Entry) -> bool:
        return one.name in joints or (one.name in slides and one.in_unit("m", "N", "m/s", "m/s^2") is not None)

    return tuple(replace(one, name=f"{one.name}.arm") if is_arms(one) else one for one in entries)


def _are_joints_angles(entries: Sequence[Entry], joints: dict[str, CarriedJoint], ratios: dict[str, float]) -> bool:
    moved, room = [], []
    for one in entries:
        values = one.in_unit("rad") if one.name in joints else None
        if values is not None:
            lower, upper = joints[one.name].range or (0.0, _ENDLESS)
            travel = float(np.nanmax(values) - np.nanmin(values))
            moved.append(travel / ratios[one.name])
            room.append(travel <= _REACH * (upper - lower))
    return bool(moved) and all(room) and max(moved) < _STILL


def _are_joints_torques(entries: Sequence[Entry], joints: dict[str, CarriedJoint], ratios: dict[str, float]) -> bool:
    shares = []
    for one in entries:
        values = one.in_unit("N m") if one.name in joints else None
        if values is not None and joints[one.name].moment > 0:
            share = float(np.nanmax(np.abs(values))) / joints[one.name].moment
            shares.append(math.log(max(share, 1e-12)) + 0.5 * math.log(ratios[one.name]))
    return bool(shares) and float(np.median(shares)) > 0
