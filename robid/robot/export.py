"""The robot as a file with all its digits: elastic as MJCF, rigid as URDF and MJCF."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.actuators import quaternion_of
from robid.robot.description import Inertial, Joint, Robot
from robid.robot.inertia import combine
from robid.robot.linearize import Equilibrium
from robid.robot.model import ElasticModel

_DIGITS = 12
_ROUNDING = 1e-14  # of the largest
_PRINTED = 1e-4  # MuJoCo prints six digits


def to_mjcf(model: ElasticModel, equilibrium: Equilibrium, keyframes: tuple[str, ...], header: str) -> str:
    """Writes an elastic model as the text of an MJCF file.

    Args:
        model: The elastic model.
        equilibrium: Its rest in each configuration.
        keyframes: Name of the keyframe of each configuration: positions and holding torques at rest. Stiffness that
            depends on a joint's position is that of the first one.
        header: What a reader should know; becomes the comment at the top.
    """
    spec = model.spec.copy()
    spec.modelname = model.robot.name
    _freeze(spec, model, equilibrium)
    for name, position, torque in zip(keyframes, equilibrium.position, equilibrium.motor_torque, strict=True):
        spec.add_key(name=name, qpos=position, ctrl=torque)
    return written(spec, header)


def _freeze(spec: mujoco.MjSpec, model: ElasticModel, equilibrium: Equilibrium) -> None:
    """Gives springs whose stiffness depends on a joint's position the one that they have in the first configuration."""
    if not model.varying:
        return
    factors = model.varying.factors(equilibrium.position[0])
    for index in model.varying.indices.tolist():
        spring = model.robot.springs[index]
        owner = spec.tendon(spring.name) if spring.place == "transmission" else spec.joint(f"q_e_{spring.name}")
        owner.stiffness = factors[index] * np.array([spring.stiffness, 0.0, spring.cubic])


def written(spec: mujoco.MjSpec, header: str) -> str:
    """Writes a specification as MJCF with all its digits; `header` becomes the comment at the top."""
    compiled = spec.compile()
    root = ET.fromstring(spec.to_xml())
    for element in root.iter("option"):
        _write(element, gravity=spec.option.gravity)
    _write_bodies(root, spec, compiled)
    _write_tendons(root, spec, compiled)
    for element in root.iter("general"):
        actuator = compiled.actuator(element.get("name"))
        _write(element, gear=actuator.gear, dynprm=actuator.dynprm, gainprm=actuator.gainprm, biasprm=actuator.biasprm)
    for element in root.iter("key"):
        key = compiled.key(element.get("name"))
        _write(element, qpos=key.qpos, ctrl=key.ctrl)
    ET.indent(root)
    body = ET.tostring(root, encoding="unicode")
    start, rest = body.split("\n", 1)
    lines = "\n".join(f"    {line}".rstrip() for line in header.replace("--", "- -").splitlines())
    return f"{start}\n  <!--\n{lines}\n  -->\n{rest}\n"


def _write_bodies(root: ET.Element, spec: mujoco.MjSpec, compiled: mujoco.MjModel) -> None:
    for element in root.iter("body"):
        body = compiled.body(element.get("name"))
        _write(element, pos=body.pos, quat=body.quat)
        for inertial in element.findall("inertial"):
            _write(inertial, pos=body.ipos, quat=body.iquat, mass=body.mass, diaginertia=body.inertia)
        for hinge in element.findall("joint"):
            name = hinge.get("name")
            joint = spec.joint(name)
            exact = {"stiffness": joint.stiffness, "damping": joint.damping, "armature": joint.armature}
            exact |= {"frictionloss": joint.frictionloss, "range": joint.range}
            _write(hinge, axis=compiled.joint(name).axis, **exact)


def _write_tendons(root: ET.Element, spec: mujoco.MjSpec, compiled: mujoco.MjModel) -> None:
    for element in root.iter("fixed"):
        tendon = spec.tendon(element.get("name"))
        _write(element, stiffness=tendon.stiffness, damping=tendon.damping, springlength=tendon.springlength)
        _write(element, armature=tendon.armature, frictionloss=tendon.frictionloss)
        first = int(compiled.tendon_adr[compiled.tendon(element.get("name")).id])
        for offset, joint in enumerate(element.findall("joint")):
            _write(joint, coef=compiled.wrap_prm[first + offset])


def _write(element: ET.Element, **exact: ArrayLike) -> None:
    """Replaces the rounded numbers of attributes by the exact ones; attributes at their default stay left out."""
    for attribute, values in exact.items():
        if attribute not in element.attrib:
            continue
        printed = np.array(element.attrib[attribute].split(), float)
        numbers = np.ravel(values)[: printed.size]
        if np.abs(printed - numbers).max() > _PRINTED * np.abs(numbers).max():
            message = f"MuJoCo writes {attribute} of {element.tag} {element.get('name')} in another way"
            raise RuntimeError(message)
        shown = np.where(np.abs(numbers) > _ROUNDING * np.abs(numbers).max(), numbers, 0.0)
        element.set(attribute, " ".join(f"{number:.{_DIGITS}g}" for number in shown))


_UPRIGHT = 1e-9  # cosine of a pitch of 90 degrees
_UNLIMITED = 1e9
_TENSOR = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def to_urdf(robot: Robot, header: str) -> str:
    """Writes frames, links with the payload in the last one, limits, and arm-side friction as URDF.

    URDF has no place for rotor inertias, couplings and counterbalances, and takes gravity to be along minus z.

    Args:
        robot: The robot.
        header: What a reader should know; becomes the comment at the top.

    Raises:
        DataError: If the robot has closed loops.
    """
    _refuse_loops(robot, "URDF")
    root = ET.Element("robot", name=robot.name)
    ET.SubElement(root, "link", name="base")
    parent = "base"
    for joint, body in zip(robot.joints, _loaded_links(robot), strict=True):
        link = f"link_{joint.name}"
        _urdf_link(ET.SubElement(root, "link", name=link), body)
        kind = "prismatic" if joint.type == "prismatic" else "revolute"
        element = ET.SubElement(root, "joint", name=joint.name, type=kind)
        _urdf_joint(element, joint, parent, link)
        parent = link
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{_comment(header)}\n{ET.tostring(root, encoding="unicode")}\n'


def to_rigid_mjcf(robot: Robot, header: str, *, friction: bool = True) -> str:
    """Writes the rigid robot as MJCF: links, rotor inertias, friction, motors with their torques as controls.

    A motor that moves one joint alone acts on that joint, whose position is the arm's; one that moves several is a
    tendon, whose length is the motor's angle.

    Args:
        robot: The robot; its payload is in its last link.
        header: What a reader should know; becomes the comment at the top.
        friction: Whether viscous and Coulomb friction are in.

    Raises:
        DataError: If the robot has closed loops, counterbalances, or rotors that ride on the links.
    """
    _refuse_loops(robot, "MJCF")
    _refuse_drives(robot)
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.option.gravity = robot.gravity_m_s2
    parent = spec.worldbody
    for joint, body in zip(robot.joints, _loaded_links(robot), strict=True):
        parent = _mjcf_link(parent, joint, body)
        if friction:
            spec.joint(joint.name).damping = np.array([joint.arm_viscous, 0.0, 0.0])
    for joint, turns in zip(robot.joints, robot.motor_per_arm, strict=True):
        _mjcf_motor(spec, robot, joint, turns, friction=friction)
    return written(spec, header)


def _loaded_links(robot: Robot) -> list[Inertial]:
    """The links, the last one with the payload."""
    links = [joint.link for joint in robot.joints]
    return [*links[:-1], combine(links[-1], robot.payload)] if robot.payload.mass_kg > 0 else links


def _refuse_loops(robot: Robot, kind: str) -> None:
    if robot.loop_links:
        message = f"D210 {kind} cannot hold the closed loop of `{robot.loop_links[0].name}`"
        raise DataError(message, where=robot.name, remedy="export the robot file (`--format robot`)")


def _refuse_drives(robot: Robot) -> None:
    found = [f"the counterbalance of `{joint.name}`" for joint in robot.joints if joint.counterbalance is not None]
    found += ["rotors that ride on the links"] if robot.rotor == "on_link" else []
    if found:
        message = f"D211 a rigid MJCF does not contain {found[0]}"
        raise DataError(message, where=robot.name, remedy="export the robot file (`--format robot`)")


def _urdf_link(element: ET.Element, body: Inertial) -> None:
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(body.com_m), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(body.mass_kg)))
    tensor = {key: repr(float(body.inertia_kgm2[entry])) for key, entry in _TENSOR.items()}
    ET.SubElement(inertial, "inertia", tensor)


def _urdf_joint(element: ET.Element, joint: Joint, parent: str, link: str) -> None:
    motor, ratio = joint.motor, abs(joint.motor.gear_ratio)
    ET.SubElement(element, "origin", xyz=_numbers(joint.position_m), rpy=_numbers(_angles(joint.rotation)))
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=link)
    ET.SubElement(element, "axis", xyz="0 0 1")
    limits = {"lower": joint.lower, "upper": joint.upper}
    limits |= {"effort": motor.max_torque_nm * ratio, "velocity": motor.max_speed_rad_s / ratio}
    finite = {key: repr(float(np.clip(value, -_UNLIMITED, _UNLIMITED))) for key, value in limits.items()}
    ET.SubElement(element, "limit", finite)
    damping, dry = motor.friction.viscous_nms_rad * ratio**2 + joint.arm_viscous, motor.friction.coulomb_nm * ratio
    ET.SubElement(element, "dynamics", damping=repr(float(damping)), friction=repr(float(dry)))


def _angles(rotation: FloatArray) -> FloatArray:
    """Roll, pitch and yaw (3,) of a rotation [rad]."""
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = np.arctan2(-rotation[2, 0], level)
    if level < _UPRIGHT:
        return np.array([0.0, pitch, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    roll, yaw = np.arctan2(rotation[2, 1], rotation[2, 2]), np.arctan2(rotation[1, 0], rotation[0, 0])
    return np.array([roll, pitch, yaw])


def _mjcf_link(parent: mujoco.MjsBody, joint: Joint, inertial: Inertial) -> mujoco.MjsBody:
    body = parent.add_body(name=f"link_{joint.name}", pos=joint.position_m, quat=quaternion_of(joint.rotation))
    tensor = inertial.inertia_kgm2
    body.explicitinertial = True
    body.mass, body.ipos = inertial.mass_kg, inertial.com_m
    body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.type == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
    own = body.add_joint(name=joint.name, type=kind, axis=[0, 0, 1])
    if np.isfinite([joint.lower, joint.upper]).all():
        own.limited, own.range = 1, [joint.lower, joint.upper]
    return body


def _mjcf_motor(spec: mujoco.MjSpec, robot: Robot, joint: Joint, turns: FloatArray, *, friction: bool) -> None:
    """Adds a motor that turns by `turns` (n_joint,) per unit of each joint's position."""
    motor, moved = joint.motor, np.flatnonzero(turns)
    law = motor.friction if friction else replace(motor.friction, viscous_nms_rad=0.0, coulomb_nm=0.0)
    single = moved.size == 1
    owner = spec.joint(robot.joints[moved[0]].name) if single else spec.add_tendon(name=f"motor_{joint.name}")
    ratio = float(turns[moved[0]]) if single else 1.0
    if not single:
        owner.springlength = [0.0, 0.0]
        for index in moved:
            owner.wrap_joint(robot.joints[index].name, float(turns[index]))
    shafts = [spring.inertia_kgm2 for spring in robot.springs if robot.joints[spring.joint].name == joint.name]
    owner.armature = ratio**2 * (motor.inertia_kgm2 + sum(shafts))
    owner.damping = owner.damping + np.array([ratio**2 * law.viscous_nms_rad, 0.0, 0.0])
    owner.frictionloss = abs(ratio) * law.coulomb_nm
    kind = mujoco.mjtTrn.mjTRN_JOINT if single else mujoco.mjtTrn.mjTRN_TENDON
    actuator = spec.add_actuator(name=f"torque_{joint.name}", trntype=kind, target=owner.name)
    actuator.set_to_motor()
    actuator.gear = [ratio, 0.0, 0.0, 0.0, 0.0, 0.0]
    if np.isfinite(motor.max_torque_nm):
        actuator.ctrllimited, actuator.ctrlrange = 1, [-motor.max_torque_nm, motor.max_torque_nm]


def _comment(header: str) -> str:
    return f"<!--\n{header.replace('--', '- -')}\n-->"


def _numbers(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)
