"""Reading a rigid robot from an MJCF or URDF file, without what an elastic robot cannot keep."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from robid.arrays import LARGEST
from robid.errors import DataError
from robid.files import read_regular
from robid.robot.foreign_parts import (
    Bond,
    Constraint,
    Tie,
    Weights,
    changed_by_compiler,
    constraints_of,
    replace_unsound,
    split,
    weights,
)
from robid.robot.mjcf_limits import check_mjcf
from robid.robot.model import quiet_reading
from robid.robot.urdf import NOT_EXPANDED, Urdf, read_urdf, unusable, wrong_limits

_REMOVED = (
    ("keys", "keyframe"),
    ("sensors", "sensor"),
    ("actuators", "actuator"),
    ("equalities", ""),  # told by whoever knows which joints move
    ("tendons", "tendon"),
    ("pairs", "contact pair"),
    ("excludes", "contact exclusion"),
    ("skins", "skin"),
    ("flexes", "flexible body"),
    ("plugins", "plugin"),
)
_ASSETS = ("meshes", "hfields", "materials", "textures")
_PASSIVE = ("damping", "frictionloss", "armature", "stiffness", "springdamper")
_FLUID = ("density", "viscosity", "wind")
_DRIVEN = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True)
class ForeignModel:
    """A rigid robot file as MuJoCo compiles it, without what an elastic robot cannot keep."""

    name: str
    compiled: mujoco.MjModel
    hinges: tuple[str, ...]
    slides: tuple[str, ...]
    fixed: tuple[str, ...]
    others: tuple[str, ...]
    weights: Weights  # What its bodies weigh; what `compiled` says of it may be a stand-in
    faults: Mapping[str, str]  # What is wrong with a body, by its name; it matters where the body moves
    limit_faults: Mapping[str, str]
    # Where hinges and slides rest: at the file's reference, else in the middle of their limits [rad, or m]
    rest: Mapping[str, float]
    in_degrees: bool
    gravity: tuple[float, float, float]  # Gravity in the world frame, zeros where it is switched off [m/s^2]
    ties: tuple[Tie, ...]
    bonds: tuple[Bond, ...]
    speed: Mapping[str, float]  # Arm-side speed limits that it states, by joint [rad/s, or m/s]
    torque: Mapping[str, float]  # Arm-side torque or force limits that it states, by joint [N m, or N]
    notes: tuple[str, ...]

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the joints that a motor can drive: hinges and slides."""
        return (*self.hinges, *self.slides)

    def frames(self) -> tuple[str, ...]:
        """Names of its bodies and sites."""
        model = self.compiled
        bodies = [model.body(index).name for index in range(1, model.nbody)]
        return (*bodies, *(model.site(index).name for index in range(model.nsite)))


def read_model(path: Path) -> ForeignModel:
    """Reads an MJCF or URDF file; meshes need not be there.

    Raises:
        DataError: If it cannot be read as either.
    """
    try:
        root = _parsed(read_regular(path))
        with quiet_reading() as told:
            model = _read(path, root)
        warned = (f"{path.name}: MuJoCo warns: {' '.join(text.split())}" for text in dict.fromkeys(told))
        return replace(model, notes=(*model.notes, *warned))
    except OSError as error:
        what = f"D200 cannot be read: {error.strerror or error}"
        raise DataError(what, where=str(path), remedy="check the path") from error
    except (ET.ParseError, ValueError, LookupError, RecursionError, mujoco.FatalError) as error:
        what = f"D201 is not a robot that MuJoCo can read: {' '.join(str(error).split())}"
        raise DataError(what, where=str(path), remedy="correct the file") from error


def _parsed(text: bytes) -> ET.Element:
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        if b"<xacro:" in text:  # without its namespace, a xacro file is not even XML
            raise ValueError(NOT_EXPANDED) from error
        raise


def _read(path: Path, root: ET.Element) -> ForeignModel:
    urdf = Urdf()
    if root.tag == "robot":
        faults = unusable(root)
        if faults:
            raise DataError("; ".join(faults), where=str(path), remedy="correct the file")
        urdf = read_urdf(root)
        spec = mujoco.MjSpec.from_string(urdf.text)
        spec.compiler.balanceinertia = urdf.balances
    elif root.tag == "mujoco":
        check_mjcf(root, path.parent)
        spec = mujoco.MjSpec.from_file(str(path))
    else:
        told = f"D202 is neither MJCF nor URDF: its outermost element is `{root.tag}`, not `mujoco` or `robot`"
        raise DataError(told, where=str(path), remedy="convert the file")
    name_everything(spec)
    limit_faults = urdf.limits | _limit_faults(spec)
    torques, constraints, notes = _torque_limits(spec), constraints_of(spec), [*_strip(spec), *urdf.notes]
    replaced = replace_unsound(spec)
    spec.compiler.fusestatic = False
    compiled = spec.compile()
    names: dict[int, list[str]] = {int(kind): [] for kind in mujoco.mjtJoint.__members__.values()}
    for index in range(compiled.njnt):
        names[int(compiled.jnt_type[index])].append(compiled.joint(index).name)
    hinges, slides = (tuple(names.pop(int(kind))) for kind in _DRIVEN)
    masses = weights(compiled, replaced)
    _require_finite(compiled, masses, constraints)
    ties, bonds = split(constraints, compiled)
    return ForeignModel(
        name=path.name, compiled=compiled, hinges=hinges, slides=slides, fixed=urdf.fixed, others=_joined(names),
        weights=masses, faults={**replaced.faults, **urdf.links}, limit_faults=limit_faults,
        rest=_rest(compiled, (*hinges, *slides)), in_degrees=root.tag == "mujoco" and bool(spec.compiler.degree),
        gravity=urdf.gravity or _gravity(spec), ties=tuple(ties), bonds=tuple(bonds), speed=urdf.speed, torque=torques,
        notes=tuple(f"{path.name}: {note}" for note in (*notes, *changed_by_compiler(spec, replaced))),
    )  # fmt: skip


def _require_finite(compiled: mujoco.MjModel, masses: Weights, constraints: list[Constraint]) -> None:
    """Raises a ValueError if a number is not finite, or beyond anything that a robot has."""
    places = (compiled.body_pos, compiled.body_ipos, masses.mass_kg, masses.inertia_kgm2, compiled.jnt_pos)
    limits = (compiled.jnt_range, compiled.qpos0, [each.data for each in constraints])
    numbers = np.concatenate([np.ravel(part).astype(float) for part in (*places, *limits)])
    if not (np.abs(numbers) < LARGEST).all():
        message = "it contains a number that is not finite, or beyond anything that a robot has"
        raise ValueError(message)


def name_everything(spec: mujoco.MjSpec) -> None:
    """Gives bodies and joints without a name one, so that they can be spoken of."""
    taken = {body.name for body in spec.bodies} | {joint.name for joint in spec.joints}
    for index, body in enumerate(spec.bodies):
        named = [joint.name for joint in body.joints if joint.name]
        body.name = body.name or _free(f"body_of_{named[0]}" if named else f"body_{index}", taken)
        for joint in body.joints:
            joint.name = joint.name or _free(f"joint_of_{body.name}", taken)


def _free(name: str, taken: set[str]) -> str:
    """Returns a name that nothing has yet, and notes it."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _limit_faults(spec: mujoco.MjSpec) -> dict[str, str]:
    """Takes away limits that MuJoCo would refuse; returns what is wrong with them, by joint."""
    faults = {}
    for joint in spec.joints:
        lower, upper = (float(limit) for limit in joint.range)
        is_on = joint.limited == mujoco.mjtLimited.mjLIMITED_TRUE or lower != 0 or upper != 0
        if joint.type not in _DRIVEN or joint.limited == mujoco.mjtLimited.mjLIMITED_FALSE or not is_on:
            continue
        if lower >= upper:
            faults[joint.name] = wrong_limits(lower, upper)
            joint.range, joint.limited = np.zeros(2), mujoco.mjtLimited.mjLIMITED_FALSE
    return faults


def _joined(names: Mapping[int, list[str]]) -> tuple[str, ...]:
    return tuple(name for each in names.values() for name in each)


def _gravity(spec: mujoco.MjSpec) -> tuple[float, float, float]:
    if spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        return (0.0, 0.0, 0.0)
    x, y, z = (float(value) for value in spec.option.gravity)
    return (x, y, z)


def _rest(compiled: mujoco.MjModel, joints: tuple[str, ...]) -> dict[str, float]:
    rest = {}
    for name in joints:
        joint = compiled.joint(name)
        reference = float(compiled.qpos0[joint.qposadr[0]])
        lower, upper = joint.range.tolist()
        is_outside = compiled.jnt_limited[joint.id] and not lower <= reference <= upper
        rest[name] = (lower + upper) / 2 if is_outside else reference
    return rest


def _torque_limits(spec: mujoco.MjSpec) -> dict[str, float]:
    """Torque limits of joints, else of the actuators that drive them."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        if actuator.trntype != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        force = float(actuator.forcerange[1])
        if force <= 0 and actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
            force = float(actuator.ctrlrange[1] * actuator.gainprm[0])
        force *= abs(float(actuator.gear[0]))
        if force > 0:
            limits[actuator.target] = force
    return limits | {joint.name: float(joint.actfrcrange[1]) for joint in spec.joints if joint.actfrcrange[1] > 0}


def _strip(spec: mujoco.MjSpec) -> Iterator[str]:
    """Removes what an elastic robot cannot keep, and says what it was."""
    for key, word in _REMOVED:
        elements = list(getattr(spec, key))
        if elements and word:
            yield _left_out(len(elements), word, [element.name for element in elements])
        for element in elements:
            spec.delete(element)
    for key in _PASSIVE:
        names = [joint.name for joint in spec.joints if np.any(np.asarray(getattr(joint, key)) != 0)]
        if names:
            yield f"{key} of joints left out ({_listed(names)})"
    for joint in spec.joints:
        joint.damping, joint.stiffness = np.zeros(3), np.zeros(3)
        joint.frictionloss, joint.armature, joint.springdamper = 0.0, 0.0, np.zeros(2)
    held = [body.name for body in spec.bodies if body.gravcomp]
    if held:
        yield f"gravcomp of bodies left out, they have their full weight ({_listed(held)})"
    flows = [key for key in _FLUID if np.any(np.asarray(getattr(spec.option, key)))]
    if flows:
        yield f"{', '.join(flows)} of the surrounding medium left out"
    yield from _strip_geometry(spec)


def _strip_geometry(spec: mujoco.MjSpec) -> Iterator[str]:
    """Keeps only what gives an MJCF body without an inertial its mass; of a URDF there are no shapes by now."""
    choice = mujoco.mjtInertiaFromGeom
    always = spec.compiler.inertiafromgeom == choice.mjINERTIAFROMGEOM_TRUE
    never = spec.compiler.inertiafromgeom == choice.mjINERTIAFROMGEOM_FALSE
    weighing, dropped = [], 0
    for body in spec.bodies:
        by_shape = always or not (never or body.explicitinertial)
        if body.name != "world" and body.geoms and by_shape:
            weighing.append(body.name)
            continue
        for geom in list(body.geoms):
            spec.delete(geom)
            dropped += 1
    if weighing:
        yield f"mass taken from geometry, as the file says no other ({_listed(weighing)})"
    if dropped:
        yield f"{dropped} shapes and their contacts left out"
    if not weighing:
        for key in _ASSETS:
            for asset in list(getattr(spec, key)):
                spec.delete(asset)


def _left_out(count: int, word: str, names: list[str]) -> str:
    plural = "flexible bodies" if word == "flexible body" else f"{word}s"
    return f"{count} {word if count == 1 else plural} left out ({_listed(names)})"


def _listed(names: list[str]) -> str:
    shown = [name or "unnamed" for name in names]
    return ", ".join(shown) if len(shown) <= 8 else f"{', '.join(shown[:7])} and {len(shown) - 7} more"
