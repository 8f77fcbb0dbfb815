"""Masses and inertias as a rigid robot file states them, body by body, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray

_STAND_IN = 1e-9
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Weights:
    """What bodies weigh.

    Attributes:
        mass_kg (n_body,): Masses, the world first [kg].
        inertia_kgm2 (n_body, 3, 3): Inertias about the centres of mass, along MuJoCo's inertial frames [kg m^2].
    """

    mass_kg: FloatArray
    inertia_kgm2: FloatArray


@dataclass(frozen=True)
class Replaced:
    """Bodies whose mass properties MuJoCo refuses; it compiles them with a stand-in, so that all faults are found.

    Attributes:
        stated: Mass [kg] and inertia (3, 3) [kg m^2] that the file states, by the body's name.
        faults: What is wrong with them where no rigid body has them, by the body's name.
        total_kg: Mass that the file scales all bodies to; None where it does not [kg].
    """

    stated: Mapping[str, tuple[float, FloatArray]]
    faults: Mapping[str, str]
    total_kg: float | None


def replace_unsound(spec: mujoco.MjSpec) -> Replaced:
    """Puts stand-ins in the place of mass properties that MuJoCo refuses, or would replace on its own."""
    stated, faults = {}, {}
    balanced = " (`balanceinertia` would put their mean in their place)" if spec.compiler.balanceinertia else ""
    total = float(spec.compiler.settotalmass)
    spec.compiler.balanceinertia, spec.compiler.settotalmass = False, -1
    for body in spec.bodies[1:]:
        mass, tensor = _stated(body, spec.compiler)
        fault = _fault(mass, tensor) if body.explicitinertial else ""
        if fault:
            faults[body.name] = fault + (balanced if fault.startswith("no body") else "")
        is_sound = not fault and mass > 0 and np.linalg.eigvalsh(tensor)[0] > _ROUNDING * np.abs(tensor).max(initial=0)
        if (body.explicitinertial and not is_sound) or (body.joints and not _weighs(body, spec.compiler)):
            stated[body.name] = (mass, tensor)
            if not body.explicitinertial:
                body.ipos, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
            body.explicitinertial, body.mass, body.inertia = True, _STAND_IN, np.full(3, _STAND_IN)
            body.fullinertia = np.array([np.nan, 0, 0, 0, 0, 0])
    return Replaced(stated, faults, total if total > 0 else None)


def weights(compiled: mujoco.MjModel, replaced: Replaced) -> Weights:
    """Returns what the bodies weigh, with what the file states in the place of stand-ins."""
    mass = compiled.body_mass.copy()
    inertia = np.array([np.diag(moments) for moments in compiled.body_inertia])
    for name, (stated_mass, tensor) in replaced.stated.items():
        index = compiled.body(name).id
        mass[index], inertia[index] = stated_mass, tensor
    total = mass[1:].sum()
    scale = 1.0 if replaced.total_kg is None or total == 0 else replaced.total_kg / total
    return Weights(scale * mass, scale * inertia)


def changed_by_compiler(spec: mujoco.MjSpec, replaced: Replaced) -> list[str]:
    """Says which of the compiler's settings raise or scale masses and inertias."""
    told, compiler = [], spec.compiler
    if compiler.boundmass > 0 or compiler.boundinertia > 0:
        told.append(
            f"masses are at least {compiler.boundmass:g} kg and principal moments {compiler.boundinertia:g} kg m^2, as"
            " `boundmass` and `boundinertia` of the file say"
        )
    if replaced.total_kg is not None:
        told.append(
            f"masses and inertias scaled to {replaced.total_kg:g} kg in all, as `settotalmass` of the file says"
        )
    return told


def _stated(body: mujoco.MjsBody, compiler: mujoco.MjsCompiler) -> tuple[float, FloatArray]:
    """Returns the mass and the inertia (3, 3) that a body states; zeros where it states none."""
    if not body.explicitinertial:
        return 0.0, np.zeros((3, 3))
    xx, yy, zz, xy, xz, yz = np.array(body.fullinertia, float)
    if np.isnan(xx):
        mass, moments = float(body.mass), np.array(body.inertia)
        mass = max(mass, compiler.boundmass) if compiler.boundmass > 0 else mass
        return mass, np.diag(np.maximum(moments, compiler.boundinertia) if compiler.boundinertia > 0 else moments)
    return float(body.mass), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _fault(mass: float, tensor: FloatArray) -> str:
    moments = np.linalg.eigvalsh(tensor)
    size, shown = float(np.abs(moments).max()), ", ".join(f"{moment:.6g}" for moment in moments)
    if mass < 0:
        return f"its mass is negative, {mass:g} kg"
    if mass == 0 and size > 0:
        return "it has an inertia but no mass"
    if moments[0] < -_ROUNDING * size:
        return f"no body has these principal moments, {shown} kg m^2: none is negative"
    if moments[2] > (moments[0] + moments[1]) * (1 + _ROUNDING):
        return f"no body has these principal moments, {shown} kg m^2: each must be at most the sum of the others"
    return ""


def _weighs(body: mujoco.MjsBody, compiler: mujoco.MjsCompiler) -> bool:
    """Whether a body or one welded to it has mass."""
    bounded = compiler.boundmass > 0 and compiler.boundinertia > 0
    own = (body.explicitinertial and body.mass > 0) or bool(body.geoms) or bounded
    return own or any(_weighs(child, compiler) for child in body.bodies if not child.joints)
