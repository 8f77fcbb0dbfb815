"""The elastic robot as an MJCF text with all its digits."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from robid.robot.linearize import Equilibrium
from robid.robot.model import ElasticModel

_DIGITS = 12
_ROUNDING = 1e-14  # of the largest
_PRINTED = 1e-4  # MuJoCo prints six digits


def to_mjcf(model: ElasticModel, equilibrium: Equilibrium, keyframes: tuple[str, ...], header: str) -> str:
    """Writes an elastic model as MJCF.

    Args:
        model: The elastic model.
        equilibrium: Its rest in each configuration.
        keyframes: Name of the keyframe of each configuration: positions and holding torques at rest. Stiffness that
            depends on a joint's position is that of the first one.
        header: What a reader should know; becomes the comment at the top.

    Returns:
        The text of the file.
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
    root = ElementTree.fromstring(spec.to_xml())
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
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="unicode")
    start, rest = body.split("\n", 1)
    lines = "\n".join(f"    {line}".rstrip() for line in header.replace("--", "- -").splitlines())
    return f"{start}\n  <!--\n{lines}\n  -->\n{rest}\n"


def _write_bodies(root: ElementTree.Element, spec: mujoco.MjSpec, compiled: mujoco.MjModel) -> None:
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


def _write_tendons(root: ElementTree.Element, spec: mujoco.MjSpec, compiled: mujoco.MjModel) -> None:
    for element in root.iter("fixed"):
        tendon = spec.tendon(element.get("name"))
        _write(element, stiffness=tendon.stiffness, damping=tendon.damping, springlength=tendon.springlength)
        _write(element, armature=tendon.armature, frictionloss=tendon.frictionloss)
        first = int(compiled.tendon_adr[compiled.tendon(element.get("name")).id])
        for offset, joint in enumerate(element.findall("joint")):
            _write(joint, coef=compiled.wrap_prm[first + offset])


def _write(element: ElementTree.Element, **exact: ArrayLike) -> None:
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
