"""Mechanics of a robot file that contradict themselves: couplings, stiffness by position, counterbalances, loops."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.later import later
from robid.robot.balances import GasBalance, stretch
from robid.settings.joint_sections import (
    GAS_ALONE,
    GAS_KEYS,
    HARMONIC_KEYS,
    SPRING_KEYS,
    CounterbalanceSection,
    StiffnessOver,
)
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection, SpringSection
from robid.settings.yaml import FieldPath

with later(__name__):
    from robid.robot.regressor.links import pin_gaps

_POINTS = 2001
_ROUNDING = 1e-9


def check_stiffness_over(field: FieldPath, law: StiffnessOver, robot: RobotFile) -> Found:
    """Yields what is wrong with one law."""
    joints = {joint.name: joint for joint in robot.joints}
    if law.joint not in joints:
        yield (*field, "joint"), f"S236 there is no joint `{law.joint}`; {suggest(law.joint, joints)}"
        return
    forms = law.forms
    if len(forms) != 1:
        found = f"found {' and '.join(forms)}" if forms else "found none"
        yield field, f"S237 needs one of `factors` with their positions, `stiffness` and `compliance` ({found})"
    elif forms == ("factors",):
        yield from _table(field, law, joints[law.joint])
    else:
        yield from _polynomial((*field, forms[0]), law, joints[law.joint])


def _table(field: FieldPath, law: StiffnessOver, joint: JointSection) -> Found:
    wanted, other = ("positions_m", "positions_deg") if joint.slides else ("positions_deg", "positions_m")
    positions = getattr(law, wanted)
    if getattr(law, other) is not None:
        yield (*field, other), f"S238 has the wrong unit for `{joint.name}`: write `{wanted}`"
    elif positions is None:
        yield (*field, wanted), "S239 is missing: one position for each of the `factors`"
    elif law.factors is None:
        yield (*field, "factors"), "S240 is missing: one for each of the positions"
    elif len(law.factors) != len(positions):
        yield (*field, "factors"), f"S241 has {len(law.factors)} values for {len(positions)} positions"
    elif (np.diff(positions) <= 0).any():
        yield (*field, wanted), "S242 must ascend"
    else:
        limits, unit = joint.stated_limits, joint.limits_unit
        if limits and (positions[0] > limits[0] + _ROUNDING or positions[-1] < limits[1] - _ROUNDING):
            message = f"goes from {positions[0]:g} to {positions[-1]:g} {unit}, but `{joint.name}` from {limits[0]:g}"
            yield (*field, wanted), f"S243 {message} to {limits[1]:g} {unit}"


def _polynomial(field: FieldPath, law: StiffnessOver, joint: JointSection) -> Found:
    limits = joint.stated_limits
    if limits is None:
        return
    stated = np.linspace(limits[0], limits[1], _POINTS)
    value = np.polynomial.Polynomial(law.stiffness or law.compliance or (0.0,))(
        stated if joint.slides else np.deg2rad(stated)
    )
    if value.min() <= 0:
        shown = float(stated[value.argmin()])
        message = f"must be above 0 wherever `{joint.name}` may be, but is {value.min():.4g}"
        yield field, f"S244 {message} at {shown:g} {joint.limits_unit}"


def check_shaft(field: FieldPath, spring: SpringSection, robot: RobotFile) -> Found:
    """Yields what is wrong with a spring that is a shaft, or that has a shaft's inertia and is none."""
    is_shaft = spring.place == "shaft"
    if is_shaft != (spring.inertia_kgm2 is not None):
        yield (*field, "inertia_kgm2"), "S245 is missing: a shaft needs it" if is_shaft else "S246 is for shafts only"
    if not is_shaft:
        return
    for joint in robot.joints:
        if joint.name == spring.joint and joint.rigid:
            yield (*field, "joint"), f"S247 joint `{joint.name}` is rigid: a shaft lies before a transmission"
    for gear in robot.all_springs:
        if gear.joint == spring.joint and gear.place == "transmission" and (gear.cubic_nm_rad3 or gear.cubic_n_m3):
            message = f"S248 `{gear.name}` is cubic: what swings it can only be identified without shafts before it"
            yield (*field, "place"), message


_CLOSED_M = 1e-5
_N_POSE = 20


def check_counterbalances(robot: RobotFile) -> Found:
    """Yields what is wrong with the counterbalances."""
    for index, joint in enumerate(robot.joints):
        balance, field = joint.counterbalance, ("joints", index, "counterbalance")
        if balance is None:
            continue
        keys = GAS_KEYS if any(getattr(balance, key) is not None for key in GAS_ALONE) else SPRING_KEYS
        stated = [key for key in keys if getattr(balance, key) is not None]
        harmonics = [key for key in HARMONIC_KEYS if getattr(balance, key)]
        if stated and harmonics:
            message = "S249 is a counterbalance of another kind than the spring: leave one of them out"
            yield (*field, harmonics[0]), message
        elif not stated and not harmonics:
            told = f"give {' or '.join(HARMONIC_KEYS)}, a spring ({', '.join(SPRING_KEYS)})"
            yield field, f"S250 is empty: {told}, or a gas cylinder ({', '.join(GAS_KEYS)})"
        elif stated:
            yield from (((*field, key), "is missing") for key in keys if key not in stated)
            if keys is GAS_KEYS:
                yield from _gas(field, joint, balance)
        elif joint.slides:
            yield (*field, harmonics[0]), f"S251 belongs to a revolute joint: `{joint.name}` is prismatic"


def _gas(field: FieldPath, joint: JointSection, section: CounterbalanceSection) -> Found:
    """Yields what is wrong with a gas cylinder: a spring beside it, or no room for its gas somewhere."""
    if section.stiffness_n_m is not None or section.preload_n:
        name = "preload_n" if section.stiffness_n_m is None else "stiffness_n_m"
        yield (*field, name), "S510 belongs to a spring, and this is a gas cylinder: leave it out"
    if section.area_m2 == 0:
        yield (*field, "area_m2"), "S511 must not be 0: nothing would pull"
    limits = joint.stated_limits
    if limits is None or not (joint.dh or joint.frame):
        return
    balance = section.counterbalance(*joint.geometry.link_frame())
    if not isinstance(balance, GasBalance):
        return
    stated = np.linspace(limits[0], limits[1], _POINTS)
    length = stretch(balance, stated if joint.slides else np.deg2rad(stated), slides=joint.slides)[0]
    volume = balance.volume(length)
    if volume.min() <= 0:
        shown, drawn = float(stated[volume.argmin()]), float(length[volume.argmin()])
        message = (
            f"S512 leaves the gas no room at {shown:g} {joint.limits_unit} of `{joint.name}`, where the cylinder is"
        )
        yield (*field, "rest_volume_m3"), f"{message} {drawn:.4g} m long"


def check_loop_links(robot: RobotFile) -> Found:
    """Yields what is wrong with the links of closed loops."""
    joints, known = [joint.name for joint in robot.joints], [joint.name for joint in robot.joints]
    found: list[tuple[FieldPath, str]] = []
    for index, link in enumerate(robot.loop_links):
        field = ("loop_links", index)
        if link.parent is not None and link.parent not in known:
            told = f"there is no joint or loop link `{link.parent}` before it; {suggest(link.parent, known)}"
            found.append(((*field, "parent"), told))
        strangers = [name for name in link.turns if name not in joints]
        found += [
            ((*field, "turns", name), f"there is no joint `{name}`; {suggest(name, joints)}") for name in strangers
        ]
        if link.pin is not None and link.pin.joint not in joints:
            told = f"there is no joint `{link.pin.joint}`; {suggest(link.pin.joint, joints)}"
            found.append(((*field, "pin", "joint"), told))
        rotation = np.array(link.frame.rotation)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > _CLOSED_M or np.linalg.det(rotation) < 0:
            told = "is not a rotation: rows must be right-handed unit axes"
            found.append(((*field, "frame", "rotation"), told))
        known.append(link.name)
    yield from found
    if not found and robot.loop_links and robot.is_complete:
        yield from _open_loops(robot)


def _open_loops(robot: RobotFile) -> Found:
    plain = robot.to_robot()
    poses = np.random.default_rng(0).uniform(plain.lower, plain.upper, (_N_POSE, len(plain.joints)))
    pinned = [index for index, link in enumerate(robot.loop_links) if link.pin is not None]
    for index, gap in zip(pinned, pin_gaps(plain, poses).max(axis=0).tolist(), strict=True):
        if gap > _CLOSED_M:
            name = robot.loop_links[index].name
            told = f"S252 `{name}` does not close its loop: its pin is up to {1e3 * gap:.3g} mm from where it is fixed"
            yield ("loop_links", index, "pin"), told


_LEAST_SINGULAR_VALUE = 0.1
_SHARE = 0.2
_N_SCALING = 20


def check_independence(robot: RobotFile) -> Found:
    """Yields the motors that cannot move their joints apart from each other."""
    turns = _arm_per_motor(robot)
    if turns is None:
        return
    names = [joint.name for joint in robot.joints]
    for group in _blocks(turns):
        part = _balanced(turns[np.ix_(group, group)])
        _, values, right = np.linalg.svd(part)
        if values[-1] >= _LEAST_SINGULAR_VALUE * values[0]:
            continue
        alike = np.flatnonzero(np.abs(right[-1]) > _SHARE * np.abs(right[-1]).max())
        index = next(group[i] for i in alike if robot.joints[group[i]].couplings)
        motors = " and ".join(f"`{names[group[i]]}`" for i in alike)
        told = (
            f"S253 the motors of {motors} turn the same combination of joints, or nearly so, and nothing moves these "
            "apart:"
            " look at the signs of `couplings` and `gear_ratio` (of a differential, q_1 = m_1 + m_2, q_2 = m_1 - m_2)"
        )
        yield ("joints", index, "couplings"), told


def _arm_per_motor(robot: RobotFile) -> FloatArray | None:
    """Returns arm motion per motor angle (n_joint, n_joint); None without couplings, or where a value is wrong."""
    names = [joint.name for joint in robot.joints]
    # A joint without a motor, whose torque is measured behind the gear, moves as it is.
    ratios = [1.0 if not one.has_motor else None if one.motor is None else one.motor.ratio for one in robot.joints]
    if not all(ratios) or not any(joint.couplings for joint in robot.joints) or len(set(names)) < len(names):
        return None
    turns = np.diag([1 / ratio for ratio in ratios if ratio])
    for row, joint in enumerate(robot.joints):
        for name, turn in joint.couplings.items():
            if name not in names or name == joint.name:
                return None
            turns[row, names.index(name)] = turn
    return turns


def _blocks(turns: FloatArray) -> list[list[int]]:
    """Returns the groups of two and more joints whose motors turn each other along, both ways or around."""
    reach = turns != 0
    for _ in range(len(turns)):
        reach = reach | (reach.astype(int) @ reach.astype(int) > 0)
    groups = {tuple(np.flatnonzero(reach[i] & reach[:, i]).tolist()) for i in range(len(turns))}
    return [list(group) for group in sorted(groups) if len(group) > 1]


def _balanced(turns: FloatArray) -> FloatArray:
    """Scales rows and columns to a common size, so that neither units nor gear ratios count."""
    scaled = turns.copy()
    for _ in range(_N_SCALING):
        scaled = scaled / np.sqrt(np.linalg.norm(scaled, axis=1))[:, None]
        scaled = scaled / np.sqrt(np.linalg.norm(scaled, axis=0))
    return scaled
