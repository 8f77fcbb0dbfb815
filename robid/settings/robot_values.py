"""Robot files with other values: masses, inertias, friction, counterbalances of a plain description."""

from __future__ import annotations

import io
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel
from ruamel.yaml import YAML

from robid.robot.balances import GasBalance, HarmonicBalance, SpringBalance
from robid.robot.description import Inertial, Joint, Robot
from robid.settings.base import Assumed
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import Body, InertiaTensor, JointSection, MotorSection, SpringSection, moved

_Stated = TypeVar("_Stated", bound=Assumed)
_ENTRIES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
_SAME = 1e-9


def body_section(found: Inertial, stated: Body | None = None) -> Body:
    """Writes mass properties as a section of a robot file; what it says to be assumed stays so."""
    tensor = {key: float(found.inertia_kgm2[entry]) for key, entry in _ENTRIES.items()}
    return Body(
        mass_kg=found.mass_kg,
        com_m=tuple(found.com_m.tolist()),
        inertia_kgm2=InertiaTensor.model_validate(tensor),
        assumed=() if stated is None else stated.assumed,
    )


def with_values(file: RobotFile, robot: Robot) -> RobotFile:
    """Returns a robot file with the values of a robot of the same joints, links and springs, complete in itself.

    Masses, inertias, friction and counterbalances are the robot's; frames, limits and springs stay. What differs from
    the file is no longer assumed.
    """
    joints = tuple(_joint(section, joint) for section, joint in zip(file.joints, robot.joints, strict=True))
    outboard = {spring.name: spring.outboard for spring in robot.springs}
    springs = tuple(_spring(section, outboard.get(section.name), file.joints) for section in file.springs)
    loops = tuple(
        section.model_copy(update={"link": _known(section.link, body_section(link.link))})
        for section, link in zip(file.loop_links, robot.loop_links, strict=True)
    )
    payload = file.payload
    if payload is not None:
        payload = _known(payload, body_section(_into_link(robot.payload, file.joints[-1])))
    update: dict[str, Any] = {"joints": joints, "springs": springs, "loop_links": loops, "payload": payload}
    # Frames and links stand in the file itself, and their sum is no longer what a source stated.
    still: dict[str, Any] = {"model": None, "locked": None, "locked_deg": {}, "locked_m": {}}
    still |= {"flange": None, "total_mass_kg": None}
    return file.model_copy(update={**update, **still})


def robot_text(file: RobotFile, header: str) -> str:
    """Writes a robot file as YAML, what is at its default left out; `header` becomes the comment at the top."""
    plain = file.model_dump(mode="json", by_alias=True, exclude_defaults=True, exclude_none=True)
    yaml, text = YAML(typ="rt"), io.StringIO()
    yaml.default_flow_style = None
    yaml.width = 10_000
    yaml.dump({"schema_version": file.schema_version, **plain}, text)
    comment = "".join(f"# {line}".rstrip() + "\n" for line in header.splitlines())
    return comment + text.getvalue()


def _joint(section: JointSection, joint: Joint) -> JointSection:
    update: dict[str, Any] = {section.arm_viscous_key: joint.arm_viscous}
    if section.motor is not None:
        update["motor"] = _motor(section.motor, joint)
    if section.link is not None:
        update["link"] = _known(section.link, body_section(_into_link(joint.link, section)))
    balance = section.counterbalance
    if balance is not None and isinstance(joint.counterbalance, HarmonicBalance):
        levels = {"sine_nm": joint.counterbalance.sine_nm, "cosine_nm": joint.counterbalance.cosine_nm}
        found = {key: tuple(level.tolist()) for key, level in levels.items()}
        update["counterbalance"] = _known(balance, balance.model_copy(update=found))
    elif balance is not None and isinstance(joint.counterbalance, SpringBalance):
        spring = {key: getattr(joint.counterbalance, key) for key in ("stiffness_n_m", "preload_n")}
        update["counterbalance"] = _known(balance, balance.model_copy(update=spring))
    elif balance is not None and isinstance(joint.counterbalance, GasBalance):
        pressure = {"rest_pressure_pa": joint.counterbalance.rest_pressure_pa}
        update["counterbalance"] = _known(balance, balance.model_copy(update=pressure))
    return _known(section, section.model_copy(update=update))


def _motor(section: MotorSection, joint: Joint) -> MotorSection:
    law = joint.motor.friction
    found = {"viscous_nms_rad": law.viscous_nms_rad, "coulomb_nm": law.coulomb_nm, "relative_std": law.relative_std}
    static = None if section.friction.static_nm is None else law.static_nm
    friction = _known(section.friction, section.friction.model_copy(update={**found, "static_nm": static}))
    update = {"inertia_kgm2": joint.motor.inertia_kgm2, "inertia_relative_std": joint.motor.inertia_relative_std}
    return _known(section, section.model_copy(update={**update, "friction": friction}))


def _spring(section: SpringSection, outboard: Inertial | None, joints: tuple[JointSection, ...]) -> SpringSection:
    if section.outboard is None or outboard is None:
        return section
    owner = next(joint for joint in joints if joint.name == section.joint)
    return section.model_copy(update={"outboard": _known(section.outboard, body_section(_into_link(outboard, owner)))})


def _into_link(body: Inertial, section: JointSection) -> Inertial:
    position, rotation = section.geometry.link_frame()
    return moved(body, -rotation.T @ position, rotation.T)


def _known(stated: _Stated, found: _Stated) -> _Stated:
    """The found section; of what the stated one assumes, what is the same stays assumed."""
    assumed = tuple(name for name in stated.assumed if _same(attrgetter(name)(stated), attrgetter(name)(found)))
    return found.model_copy(update={"assumed": assumed})


def _same(first: object, second: object) -> bool:
    ours, theirs = (np.array(_numbers(value)) for value in (first, second))
    size = float(np.abs(ours).max(initial=0.0))
    return ours.shape == theirs.shape and bool(np.allclose(ours, theirs, rtol=_SAME, atol=_SAME * size))


def _numbers(value: object) -> list[float]:
    if isinstance(value, int | float):
        return [float(value)]
    if isinstance(value, BaseModel):
        value = tuple(value.model_dump(exclude={"assumed"}).values())
    if isinstance(value, dict):
        value = tuple(value.values())
    return [number for item in value for number in _numbers(item)] if isinstance(value, tuple | list) else []
