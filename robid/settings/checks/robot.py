"""What must hold in a robot file beyond the types of its fields."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import BaseModel

from robid.robot.description import Inertial
from robid.robot.inertia import remove
from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.checks.beyond_motors import check_pose_interface, check_sensed
from robid.settings.checks.mechanics import (
    check_counterbalances,
    check_independence,
    check_loop_links,
    check_shaft,
    check_stiffness_over,
)
from robid.settings.checks.values import HALVED, implausible, missing
from robid.settings.problems import Found, SettingsProblem, problem_at, suggest
from robid.settings.robot import RobotFile, assumed_sections
from robid.settings.robot_sections import Body, JointSection, SpringSection
from robid.settings.yaml import Document, FieldPath

_ROUNDING = 1e-9
_PARALLEL = 1e-6
_OTHER = {"revolute": "prismatic", "prismatic": "revolute"}


def check_robot(
    document: Document, robot: RobotFile, immobile: Mapping[str, str] | None = None
) -> list[SettingsProblem]:
    """Returns all that is wrong with a robot file, completed from its model; `immobile` joints have a reason."""
    checks = (
        *(_names, missing, _joints, _values, _laws, _couplings, _splits, _bodies, _sensors, _assumed),
        *(check_counterbalances, check_pose_interface, check_independence),
    )
    found = [*_springs(robot, immobile or {}), *(item for check in checks for item in check(robot))]
    # Whether loops close is asked of a robot that is otherwise right.
    found += check_loop_links(robot) if not found else []
    found += implausible(robot)
    return [problem_at(document, field, message) for field, message in found]


def check_springs(robot: RobotFile) -> Found:
    """Yields what is wrong with the springs of a robot file: names, places, and what splits leave of a link."""
    yield from _springs(robot, {})
    yield from _splits(robot)
    yield from _values(robot)
    yield from _laws(robot)
    yield from _names(robot)


def spring_field(robot: RobotFile, index: int) -> FieldPath:
    """Returns where the spring of this index among all of them is written."""
    geared = [position for position, joint in enumerate(robot.joints) if joint.gear is not None]
    return ("joints", geared[index], "gear") if index < len(geared) else ("springs", index - len(geared))


def _names(robot: RobotFile) -> Found:
    named: list[tuple[FieldPath, str]] = [(("joints", i, "name"), joint.name) for i, joint in enumerate(robot.joints)]
    named += [((*spring_field(robot, i), "name"), spring.name) for i, spring in enumerate(robot.all_springs)]
    named += [(("sensors", i, "name"), sensor.name) for i, sensor in enumerate(robot.sensors)]
    named += [(("loop_links", i, "name"), link.name) for i, link in enumerate(robot.loop_links)]
    count = Counter(name for _, name in named)
    for field, name in named:
        if count[name] > 1:
            yield field, f"S254 `{name}` names more than one joint, spring, sensor or loop link"


def _joints(robot: RobotFile) -> Found:
    for index, joint in enumerate(robot.joints):
        field = ("joints", index)
        lower, upper = joint.stated_limits or (0.0, 1.0)
        if lower >= upper:
            yield (*field, joint.limits_key), f"S255 the lower limit {lower:g} is not below the upper limit {upper:g}"
        if joint.link is not None:
            yield from _link(field, joint, joint.link)
        friction = None if joint.motor is None else joint.motor.friction
        if friction is not None and friction.static_nm is not None and friction.static_nm < friction.coulomb_nm:
            told = f"{friction.coulomb_nm:g} N m (found {friction.static_nm:g})"
            yield (*field, "motor", "friction", "static_nm"), f"S256 must not be below the Coulomb level, {told}"
        yield from _units(field, joint)
        yield from _transmission(field, robot, joint) if joint.has_motor else check_sensed(field, robot, joint)


def _units(field: FieldPath, joint: JointSection) -> Found:
    """Finds values that belong to joints of the other type."""
    turning, sliding = ("limits_deg", "arm_viscous_nms_rad"), ("limits_m", "arm_viscous_ns_m")
    for key in (key for key in (turning if joint.slides else sliding) if getattr(joint, key)):
        yield (*field, key), f"S257 belongs to a {_OTHER[joint.type]} joint: `{joint.name}` is {joint.type}"
    if joint.motor is None:
        return
    wanted, other = ("gear_ratio_rad_m", "gear_ratio") if joint.slides else ("gear_ratio", "gear_ratio_rad_m")
    if getattr(joint.motor, other) is not None:
        message = f"S258 belongs to a {_OTHER[joint.type]} joint: `{joint.name}` is {joint.type} and has `{wanted}`"
        yield (*field, "motor", other), message
    elif getattr(joint.motor, wanted) is None:
        yield (*field, "motor", wanted), "S259 is missing"


def _transmission(field: FieldPath, robot: RobotFile, joint: JointSection) -> Found:
    transmissions = [s.name for s in robot.all_springs if s.joint == joint.name and s.place == "transmission"]
    found = f"{len(transmissions)} ({', '.join(transmissions)})" if transmissions else "none"
    if joint.rigid and transmissions:
        message = f"S260 joint `{joint.name}` is rigid, but has the transmission {', '.join(transmissions)}"
        yield (*field, "rigid"), message
    elif not joint.rigid and len(transmissions) != 1:
        message = f"S261 joint `{joint.name}` needs exactly one transmission spring, but has {found}"
        yield (*field, "name"), message if transmissions else f"S262 {message} (`rigid: true` does without)"
    if joint.rigid and robot.rotor == "on_link":
        yield (*field, "rigid"), "S263 needs `rotor: spong`: the rotor of a rigid joint is part of its arm"


def _link(field: FieldPath, joint: JointSection, link: Body) -> Found:
    if link.inertial().inertia_kgm2.any() or joint.motor is None or joint.motor.ratio is None:
        yield from _body((*field, "link"), link)
        return
    half = joint.motor.inertia_kgm2 * joint.motor.ratio**2 / 2
    shown = f"`inertia_kgm2: {{xx: {half / 2:.4g}, yy: {half / 2:.4g}, zz: {half:.4g}}}`"
    if joint.slides:
        shown = f"`mass_kg: {half:.4g}` with any inertia that a body has"
    rotor = f"the rotor's inertia is {joint.motor.inertia_kgm2:g} kg m^2; {HALVED}: {shown}"
    yield (*field, "link", "inertia_kgm2"), f"S264 must be positive definite, and is zero; {rotor}"


def _body(field: FieldPath, body: Body) -> Found:
    wrong = _unphysical(body.inertial())
    if wrong:
        yield (*field, "inertia_kgm2"), wrong


def _unphysical(body: Inertial) -> str:
    moments = np.linalg.eigvalsh(body.inertia_kgm2)
    shown = f"{', '.join(f'{moment:.6g}' for moment in moments)} kg m^2"
    told = ""
    if moments[0] <= 0:
        told = f"S265 must be positive definite; its principal moments are {shown}"
    elif moments[2] > (moments[0] + moments[1]) * (1 + _ROUNDING):
        told = f"S266 no body has these principal moments, {shown}: each must be at most the sum of the others"
    half = "where a source gives one about the joint axis alone, half of it about each of the others changes nothing"
    return f"{told} ({half})" if told else ""


def _values(robot: RobotFile) -> Found:
    """Finds springs without stiffness or damping, or with those of the other type of joint."""
    for index, spring in enumerate(robot.all_springs):
        field, linear = spring_field(robot, index), spring.is_linear(robot.joints)
        for kind in ("stiffness", "damping", "cubic"):
            about = PARAMETER_KINDS[kind]
            wanted, other = about.field, about.linear_field
            if linear:
                wanted, other = other, wanted
            if spring.value(kind, linear=not linear) is not None:
                why = "a prismatic joint's transmission" if linear else "what turns"
                yield (*field, other), f"S267 has the wrong unit for {why}: write `{wanted}`"
            elif kind != "cubic" and spring.value(kind, linear=linear) is None:
                yield (*field, wanted), "S268 is missing"


def _springs(robot: RobotFile, immobile: Mapping[str, str]) -> Found:
    joints = [joint.name for joint in robot.joints]
    turning = [joint.name for joint in robot.joints if not joint.slides]
    for index, spring in enumerate(robot.springs):
        field = ("springs", index)
        ends = spring.place in ("base", "payload")
        if ends:
            if spring.joint is not None:
                yield (*field, "joint"), f"S269 a {spring.place} spring belongs to no joint: leave `joint` out"
        elif spring.joint is None:
            yield (*field, "joint"), f"S270 is missing: a {spring.place} spring belongs to a joint"
        elif spring.joint in immobile:
            told = f"{immobile[spring.joint]}: a spring there needs a `split` of the link"
            yield (*field, "joint"), f"S271 joint `{spring.joint}` {told}"
        elif spring.joint not in joints:
            yield (*field, "joint"), f"S272 there is no joint `{spring.joint}`; {suggest(spring.joint, joints)}"
        yield from _axis(field, spring, turning)
        for key in ("point_m", "outboard"):
            if ends and key == "point_m":
                continue
            if (spring.place == "split") != (getattr(spring, key) is not None):
                needed = spring.place == "split"
                told = "S279 is missing: a split spring needs it" if needed else "S280 is for split springs only"
                yield (*field, key), told
        yield from check_shaft(field, spring, robot)
        if spring.place == "payload" and (robot.payload is None or robot.payload.mass_kg == 0):
            yield (*field, "place"), "S281 a payload spring needs a `payload` with mass"


def _axis(field: FieldPath, spring: SpringSection, turning: Sequence[str]) -> Found:
    if spring.place in ("transmission", "shaft"):
        if spring.axis is not None:
            told = {"transmission": "S273 a transmission turns about its joint's axis"}
            told["shaft"] = "S274 a shaft turns as its motor does"
            yield (*field, "axis"), f"S275 {told[spring.place]}: leave `axis` out"
    elif spring.axis is None:
        yield (*field, "axis"), f"S276 is missing: a {spring.place} spring needs one"
    elif np.linalg.norm(spring.axis) == 0:
        yield (*field, "axis"), "S277 has no direction"
    elif (
        spring.place == "bearing"
        and spring.joint in turning
        and np.hypot(*spring.axis[:2]) < _PARALLEL * np.linalg.norm(spring.axis)
    ):
        yield (*field, "axis"), "S278 lies along the joint axis z: that is what the transmission is for"


def _laws(robot: RobotFile) -> Found:
    for index, spring in enumerate(robot.all_springs):
        if spring.stiffness_over is not None:
            field = (*spring_field(robot, index), "stiffness_over")
            yield from check_stiffness_over(field, spring.stiffness_over, robot)


def _splits(robot: RobotFile) -> Found:
    """Goes through the splits of each link from its joint outwards; each takes a part of what is left."""
    for joint in robot.joints:
        if joint.link is None:
            continue
        whole = joint.link.inertial()
        for index, spring in enumerate(robot.springs):
            if spring.joint == joint.name and spring.place == "split" and spring.outboard is not None:
                part = spring.outboard.inertial()
                yield from _split(("springs", index, "outboard"), spring, spring.outboard, whole)
                whole = part


def _split(field: FieldPath, spring: SpringSection, outboard: Body, whole: Inertial) -> Found:
    yield from _body(field, outboard)
    if outboard.mass_kg == 0:
        yield (*field, "mass_kg"), "S282 must be above 0: a part without mass leaves no centre of mass for the rest"
    if outboard.mass_kg >= whole.mass_kg:
        told = f"that `{spring.name}` splits (found {outboard.mass_kg:g})"
        yield (*field, "mass_kg"), f"S283 must be below the {whole.mass_kg:g} kg {told}"
        return
    wrong = _unphysical(remove(whole, outboard.inertial()))
    if wrong and not _unphysical(whole) and not _unphysical(outboard.inertial()):
        yield (*field, "inertia_kgm2"), f"S284 what is left of the link of `{spring.joint}` without it: {wrong}"


def _couplings(robot: RobotFile) -> Found:
    joints = [joint.name for joint in robot.joints]
    for index, joint in enumerate(robot.joints):
        for name, turn in joint.couplings.items():
            field = ("joints", index, "couplings", name)
            if name == joint.name:
                yield field, "S285 is the joint's own motor: that is what `gear_ratio` is for"
            elif name not in joints:
                yield field, f"S286 there is no joint `{name}`; {suggest(name, joints)}"
            elif name in robot.without_motor:
                yield field, f"S287 `{name}` has no motor that could turn `{joint.name}` along: leave it out"
            if not 0 < abs(turn) <= 1:
                yield field, f"S288 {turn:g} is implausible: arm turns per motor turn lie within 1, as behind any gear"


def _bodies(robot: RobotFile) -> Found:
    if robot.payload is not None and robot.payload.mass_kg > 0:
        yield from _body(("payload",), robot.payload)
    for index, link in enumerate(robot.loop_links):
        yield from _body(("loop_links", index, "link"), link.link)
    if robot.base is not None:
        yield from _body(("base",), robot.base)
        if not any(spring.place == "base" for spring in robot.springs):
            yield ("base",), "S289 moves only on springs with `place: base`, and there is none"


def _sensors(robot: RobotFile) -> Found:
    joints = [joint.name for joint in robot.joints]
    for index, sensor in enumerate(robot.sensors):
        if sensor.joint is not None and sensor.joint not in joints:
            message = f"S290 there is no joint `{sensor.joint}`; {suggest(sensor.joint, joints)}"
            yield ("sensors", index, "joint"), message
        if np.linalg.norm(sensor.axis) == 0:
            yield ("sensors", index, "axis"), "S291 has no direction"


def _assumed(robot: RobotFile) -> Found:
    for _, field, section in assumed_sections(robot):
        for index, name in enumerate(section.assumed):
            node: object = section
            for part in name.split("."):
                fields = dataclasses.fields(node) if dataclasses.is_dataclass(node) else ()
                own = type(node).model_fields if isinstance(node, BaseModel) else [one.name for one in fields]
                known = [one for one in own if one != "assumed"]
                if part not in known:
                    yield (*field, "assumed", index), f"S292 there is no value `{name}` here; {suggest(part, known)}"
                    break
                node = getattr(node, part)
