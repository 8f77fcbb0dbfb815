"""Which joints of a rigid model are the robot's, and what each of them carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid.later import later

if TYPE_CHECKING:
    from robid.robot.foreign import ForeignModel

with later(__name__):
    from robid.robot.chain import extract_chain, frame_on_last

_FLANGES = ("tool0", "flange", "attachment_site", "tool", "ee_link", "ee")
_GRAVITY = 9.81
_PAYLOAD_SHARE = 0.15
_PAYLOAD_AT = np.array([0.045, 0.0, 0.065])
_PAYLOAD_RADIUS = 0.09


@dataclass(frozen=True)
class TestLoad:
    """A payload of the size that a robot carries."""

    mass_kg: float
    com_m: tuple[float, float, float]
    inertia_kgm2: float  # About each axis


@dataclass(frozen=True)
class CarriedJoint:
    """A joint of the robot and what hangs on it, stretched out, the test load included."""

    name: str
    slides: bool
    range: tuple[float, float] | None  # [rad, or m]; None where the model has none that can be used
    link_kg: float
    carried_kg: float
    moment: float  # Largest torque of gravity [N m], or the weight of what slides [N]
    speed: float | None  # Speed limit that the model states [rad/s, or m/s]
    torque: float | None  # Torque or force limit that it states [N m, or N]


@dataclass(frozen=True)
class Chain:
    """The chain of joints from base to flange."""

    joints: tuple[CarriedJoint, ...]
    flange: str | None
    load: TestLoad
    held: tuple[str, ...]  # Joints beside the chain, which do not move


def chain_of(model: ForeignModel) -> Chain:
    """Finds the chain of a model that is most likely the robot, and weighs it."""
    names = robot_joints(model)
    found = extract_chain(model, names, {})
    masses = np.array([one.link.mass_kg for one in found])
    reach = float(sum(np.linalg.norm(one.position_m) for one in found[1:])) or 0.5
    load = _load(float(masses.sum()), reach)
    joints = []
    for index, one in enumerate(found):
        distance, moment = 0.0, 0.0
        for later_one in found[index:]:
            distance += 0.0 if later_one is one else float(np.linalg.norm(later_one.position_m))
            moment += later_one.link.mass_kg * (distance + float(np.linalg.norm(later_one.link.com_m)))
        moment += load.mass_kg * (distance + float(np.linalg.norm(load.com_m)))
        carried = float(masses[index:].sum()) + load.mass_kg
        joints.append(
            CarriedJoint(
                name=one.name,
                slides=one.slides,
                range=None if one.name in model.limit_faults else one.range,
                link_kg=one.link.mass_kg,
                carried_kg=carried,
                moment=_GRAVITY * (carried if one.slides else moment),
                speed=model.speed.get(one.name),
                torque=model.torque.get(one.name),
            )
        )
    held = tuple(name for name in (*model.driven, *model.others) if name not in names)
    return Chain(tuple(joints), _flange(model, names), load, held)


def robot_joints(model: ForeignModel) -> list[str]:
    """Returns the longest chain of joints that motors can drive, base to flange, without what grips at its end."""
    followers = {tie.follower for tie in model.ties}
    chains = [_below(model, name) for name in model.driven if name not in followers]
    chains = [[name for name in chain if name not in followers] for chain in chains]
    longest = max(chains, key=len, default=[])
    if len(longest) < 3:
        return longest
    twins = [one for one in chains if len(one) == len(longest) and one[:-1] == longest[:-1] and one != longest]
    ties = {tie.leader for tie in model.ties}
    return longest[:-1] if twins or longest[-1] in ties else longest


def _below(model: ForeignModel, joint: str) -> list[str]:
    """A joint and the driven ones that carry it, base first."""
    compiled, found = model.compiled, []
    by_body: dict[int, list[str]] = {}
    for name in model.driven:
        by_body.setdefault(int(compiled.joint(name).bodyid[0]), []).append(name)
    body = int(compiled.joint(joint).bodyid[0])
    while body:
        found += by_body.get(body, [])[::-1]
        body = int(compiled.body_parentid[body])
    return found[::-1]


def _flange(model: ForeignModel, names: Sequence[str]) -> str | None:
    """A body or site on the last link that is called as flanges are."""
    known = model.frames()
    there = (name for name in _FLANGES if name in known)
    return next((name for name in there if frame_on_last(model, names, {}, name) is not None), None)


def _load(mass_kg: float, reach_m: float) -> TestLoad:
    load = float(f"{_PAYLOAD_SHARE * mass_kg:.2g}")
    x, y, z = (float(f"{value:.2g}") for value in (_PAYLOAD_AT * reach_m).tolist())
    return TestLoad(load, (x, y, z), float(f"{load * (_PAYLOAD_RADIUS * reach_m) ** 2:.2g}"))
