"""What a rigid robot file states of bodies and constraints: masses, inertias, joints and bodies that are tied."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray

_TO_BODIES = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}


@dataclass(frozen=True)
class Tie:
    """A joint that follows another, as `mimic` of a URDF and `equality/joint` of an MJCF say."""

    follower: str  # The joint that follows
    leader: str | None  # The joint that it follows; None where it is held
    factor: float  # Its motion per motion of the leader [rad or m per rad or m]
    offset: float  # Its position where the leader is at 0 [rad, or m]
    is_linear: bool  # Whether that is all


@dataclass(frozen=True)
class Bond:
    """A constraint between two bodies, or among several joints."""

    what: str  # What the file calls it, with its name
    bodies: tuple[str, ...] = ()  # Names of the two bodies, `world` among them
    joints: tuple[str, ...] = ()  # Names of the joints


@dataclass(frozen=True)
class Constraint:
    """An equality constraint as it stands in the file; MuJoCo's own data of joints."""

    kind: mujoco.mjtEq
    name: str
    first: str  # Name of the first thing that it ties
    second: str  # Name of the second one; empty where it is held
    data: tuple[float, ...]
    joints: tuple[str, ...] = ()  # Of tendons, the joints


def constraints_of(spec: mujoco.MjSpec) -> list[Constraint]:
    """Lists the constraints of a file that are switched on; weldings to a target that a user drags hold nothing.

    Raises:
        ValueError: If one names what is not there.
    """
    found = []
    known = {kind: {body.name for body in spec.bodies} for kind in _TO_BODIES}
    known[mujoco.mjtEq.mjEQ_JOINT] = {joint.name for joint in spec.joints}
    dragged = {body.name for body in spec.bodies if body.mocap}
    owners = {site.name: site.parent.name for site in spec.sites}
    moved = {tendon.name: tuple(wrap.target.name for wrap in tendon.path if wrap.target) for tendon in spec.tendons}
    for each in spec.equalities:
        first, second = each.name1, each.name2
        if each.type in _TO_BODIES:
            if each.objtype == mujoco.mjtObj.mjOBJ_SITE:
                first, second = owners.get(first, ""), owners.get(second, "")
            if dragged & {first, second}:
                continue
        joints = (*moved.get(first, ()), *moved.get(second, ())) if each.type == mujoco.mjtEq.mjEQ_TENDON else ()
        for name in filter(None, (first, second) if each.type in known else ()):
            if name not in known[each.type]:
                message = f"a constraint names `{name}`, which is not there"
                raise ValueError(message)
        if each.active:
            data = tuple(float(value) for value in each.data[:5])
            found.append(Constraint(each.type, each.name, first, second or "", data, joints))
    return found


def split(constraints: list[Constraint], compiled: mujoco.MjModel) -> tuple[list[Tie], list[Bond]]:
    """Returns the joints that follow others, and everything else that is tied.

    MuJoCo's law is `q - q_0 = a_0 + a_1 (p - p_0) + ...` for a joint's position q and its leader's p, with the
    references q_0 and p_0 of the file.
    """
    ties, bonds = [], []
    for each in constraints:
        if each.kind == mujoco.mjtEq.mjEQ_JOINT:
            own = _reference(compiled, each.first)
            other = _reference(compiled, each.second) if each.second else 0.0
            factor = each.data[1] if each.second else 0.0
            offset = own + each.data[0] - factor * other
            is_linear = not each.second or not np.any(each.data[2:])
            ties.append(Tie(each.first, each.second or None, factor, offset, is_linear))
        elif each.kind in _TO_BODIES:
            what = f"`{_TO_BODIES[each.kind]}` {each.name}".rstrip()
            bonds.append(Bond(what, bodies=(each.first, each.second or "world")))
        elif each.joints:
            bonds.append(Bond(f"equality of tendons {each.name}".rstrip(), joints=each.joints))
    return ties, bonds


def _reference(compiled: mujoco.MjModel, joint: str) -> float:
    return float(compiled.qpos0[compiled.joint(joint).qposadr[0]])


def led_by(ties: Collection[Tie], driven: Collection[str]) -> tuple[Tie, ...]:
    """Turns ties round whose follower is driven and whose leader is not: a file may name the two in either order."""
    followers = {tie.follower for tie in ties}
    turned = []
    for tie in ties:
        leads = tie.leader is not None and tie.leader not in driven and tie.leader not in followers
        if tie.leader is not None and leads and tie.follower in driven and tie.is_linear and tie.factor:
            tie = Tie(tie.leader, tie.follower, 1 / tie.factor, -tie.offset / tie.factor, is_linear=True)
        turned.append(tie)
    return tuple(turned)


def follow(ties: Collection[Tie], held: Mapping[str, float]) -> dict[str, float]:
    """Returns the positions of the joints that do not move, with those that follow them [rad, or m]."""
    positions = dict(held)
    for _ in ties:
        for tie in ties:
            if tie.follower in positions or not tie.is_linear:
                continue
            if tie.leader is None:
                positions[tie.follower] = tie.offset
            elif tie.leader in positions:
                positions[tie.follower] = tie.offset + tie.factor * positions[tie.leader]
    return positions


_STAND_IN = 1e-9
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Weights:
    """What bodies weigh."""

    mass_kg: FloatArray  # (n_body,) Masses, the world first [kg]
    inertia_kgm2: FloatArray  # (n_body, 3, 3) Inertias about centres of mass, along MuJoCo's inertial frames [kg m^2]


@dataclass(frozen=True)
class Replaced:
    """Bodies whose mass properties MuJoCo refuses; it compiles them with a stand-in, so that all faults are found."""

    # Mass [kg] and inertia (3, 3) [kg m^2] that the file states, by the body's name
    stated: Mapping[str, tuple[float, FloatArray]]
    faults: Mapping[str, str]  # What is wrong with them where no rigid body has them, by the body's name
    total_kg: float | None  # Mass that the file scales all bodies to; None where it does not [kg]


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
