"""Values of a robot file: those that it lacks, and those that no robot has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from robid.arrays import LARGEST
from robid.robot.inertia import stretched_inertia
from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.problems import Found, SettingsProblem, problem_at
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection, MotorSection
from robid.settings.yaml import Document, FieldPath

_LARGEST_RATIO = 2000.0
_SMALLEST_RATIO_RAD_M, _LARGEST_RATIO_RAD_M = 5.0, 2e4
_LONGEST_RUN_UP_S = 10.0
_SHORTEST_RUN_UP_S = 2e-4
_SMALLEST_SHARE = 2e-3
_QUICK_SHARE = 2e-2
_LARGEST_SHARE = 30.0
_MASS_TOLERANCE = 0.01
HALVED = (
    "where it contains all that turns, halve it and write the other half, times the gear ratio squared, as the link's"
)


def implausible(robot: RobotFile) -> Found:
    """Yields gear ratios, motor inertias and a total mass that cannot be meant, with the reason."""
    yield from _ratios(robot)
    is_known = all((joint.dh or joint.frame) and joint.link for joint in robot.joints)
    moved = None
    if is_known:
        places = [place for place, _ in robot.joint_frames()]
        travels = [max(map(abs, j.stated_limits or (0.0,))) if j.slides else 0.0 for j in robot.joints]
        moved = stretched_inertia(places, robot.links(), robot.slides, travels)
    for index, joint in enumerate(robot.joints):
        alike = [other.slides == joint.slides for other in robot.joints]
        if joint.motor is None:
            continue
        reason = _inertia(
            joint, joint.motor, None if moved is None else (float(moved[index]), float(moved[alike].max()))
        )
        if reason:
            value = f"{joint.motor.inertia_kgm2:g} kg m^2"
            yield ("joints", index, "motor", "inertia_kgm2"), f"S293 {value} is implausible: {reason}"
    if is_known:
        yield from _mass(robot)


def absurd(data: object, field: FieldPath = ()) -> Found:
    """Yields numbers that nothing has, in a file as it is written: what is made of them would overflow."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from absurd(value, (*field, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from absurd(value, (*field, index))
    elif isinstance(data, int | float) and abs(data) > LARGEST:
        yield field, f"S294 {data:g} is beyond anything that a robot has"


def _ratios(robot: RobotFile) -> Found:
    for index, joint in enumerate(robot.joints):
        if joint.motor is None:
            continue
        if joint.slides:
            yield from _leads(index, joint.motor)
            continue
        stated = joint.motor.gear_ratio
        if stated is None:
            continue
        ratio = abs(stated)
        if 1 <= ratio <= _LARGEST_RATIO:
            continue
        reason = f"S295 {stated:g} is implausible: motor turns per arm turn are a number from 1 to {_LARGEST_RATIO:g}"
        reason += ", negative where the two turn opposite ways"
        if 1 <= np.deg2rad(ratio) <= _LARGEST_RATIO:
            reason += f"; {stated:g} would be {np.deg2rad(stated):.4g} taken for degrees per radian"
        elif 0 < ratio < 1:
            reason += f"; its inverse, {1 / stated:.4g}, may be meant"
        yield ("joints", index, "motor", "gear_ratio"), reason


def _leads(index: int, motor: MotorSection) -> Found:
    stated = motor.gear_ratio_rad_m
    # 1 stands for drives whose angles are metres: linear motors, or signals that are those of the carriage.
    if stated is None or abs(stated) == 1 or _SMALLEST_RATIO_RAD_M <= abs(stated) <= _LARGEST_RATIO_RAD_M:
        return
    reason = f"S296 {stated:g} is implausible: motor radians per metre are a number from {_SMALLEST_RATIO_RAD_M:g} to"
    reason += f" {_LARGEST_RATIO_RAD_M:g}, or 1 of a linear motor, negative where the motor goes the other way"
    if stated and _SMALLEST_RATIO_RAD_M <= abs(2 * np.pi / stated) <= _LARGEST_RATIO_RAD_M:
        reason += f"; as a lead in m it would be {2 * np.pi / stated:.4g}"
    yield ("joints", index, "motor", "gear_ratio_rad_m"), reason


def _inertia(joint: JointSection, motor: MotorSection, moved: tuple[float, float] | None) -> str:
    """Says why a rotor's inertia cannot be meant.

    `moved` are the largest inertia that the joint meets and the whole arm's [kg m^2; kg where it slides]; None if
    unknown.
    """
    speed, torque = motor.max_speed_rad_s, motor.max_torque_nm
    run_up = None if speed is None or torque is None else motor.inertia_kgm2 * speed / torque
    if run_up is not None and run_up > _LONGEST_RUN_UP_S:
        return (
            f"at {torque:.3g} N m the rotor alone would take {run_up:.2g} s to {speed:.3g} rad/s; check the units "
            "(1 kg cm^2 is 1e-4 kg m^2)"
        )
    ratio, unit = (motor.gear_ratio_rad_m, "kg") if joint.slides else (motor.gear_ratio, "kg m^2")
    least, most = (_SMALLEST_RATIO_RAD_M, _LARGEST_RATIO_RAD_M) if joint.slides else (1, _LARGEST_RATIO)
    if moved is None or ratio is None or not least <= abs(ratio) <= most:
        return ""
    reflected, (own, arm) = motor.inertia_kgm2 * ratio**2, moved
    text = f"behind a ratio of {ratio:g} it is {reflected:.3g} {unit} at the arm"
    is_quick = run_up is not None and run_up < _SHORTEST_RUN_UP_S
    if reflected < (_QUICK_SHARE if is_quick else _SMALLEST_SHARE) * own:
        text = f"{text}, {_rounded(own / reflected)} times less than what `{joint.name}` moves, stretched out"
        return f"{text}; the rotor alone would take {run_up:.2g} s to full speed" if is_quick else text
    if reflected > _LARGEST_SHARE * arm > 0:  # an arm that weighs nothing is told where its links are
        told = f"{text}, {_rounded(reflected / arm)} times that of the whole arm, stretched out"
        return f"{told}; {HALVED}"
    return ""


def _rounded(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def _mass(robot: RobotFile) -> Found:
    if robot.total_mass_kg is None:
        return
    masses = {joint.name: link.mass_kg for joint, link in zip(robot.joints, robot.links(), strict=True)}
    found = sum(masses.values())
    if abs(found - robot.total_mass_kg) > _MASS_TOLERANCE * robot.total_mass_kg:
        parts = ", ".join(f"{name} {mass:.4g}" for name, mass in masses.items())
        message = f"S297 {robot.total_mass_kg:g} kg is stated, but the links that move have {found:.6g} kg ({parts})"
        yield ("total_mass_kg",), message


_PARALLEL = 1e-6
NO_MOTOR = "S298 is missing (or `torque_measured_at: joint`, where a sensor behind the gear measures its torque)"
_NO_GEOMETRY = "S299 is missing (or `frame`, or a `model` for the whole robot)"


def missing_keys(document: Document) -> list[SettingsProblem]:
    """Returns what a robot file lacks by the types of its joints, whatever else keeps it from being read."""
    joints = document.data.get("joints")
    if not isinstance(joints, list):
        return []
    # A list, as a name that is none may not be hashable.
    sliding = [joint.get("name") for joint in joints if isinstance(joint, dict) and joint.get("type") == "prismatic"]
    found: list[tuple[FieldPath, str]] = []
    for index, joint in enumerate(joints):
        if isinstance(joint, dict):
            keys = _lacking(joint, slides=joint.get("name") in sliding, alone="model" not in document.data)
            found += [((("joints", index, *field), message)) for field, message in keys]
    springs = document.data.get("springs")
    for index, spring in enumerate(springs if isinstance(springs, list) else []):
        if isinstance(spring, dict):
            linear = spring.get("place") == "transmission" and spring.get("joint") in sliding
            found += [(("springs", index, key), "is missing") for key in _lacking_values(spring, linear=linear)]
    return [problem_at(document, field, message) for field, message in found]


def _lacking(joint: Mapping[str, object], *, slides: bool, alone: bool) -> Found:
    """What a joint as it is written lacks; frames, links and limits only where no model brings them."""
    if alone and "dh" not in joint and "frame" not in joint:
        yield ("dh",), _NO_GEOMETRY
    wanted = ("link", "limits_m" if slides else "limits_deg") if alone else ()
    yield from (((key,), "is missing") for key in wanted if key not in joint)
    if "motor" not in joint and joint.get("torque_measured_at") != "joint":
        yield ("motor",), NO_MOTOR
    ratio, motor = "gear_ratio_rad_m" if slides else "gear_ratio", joint.get("motor")
    if isinstance(motor, dict) and {"gear_ratio", "gear_ratio_rad_m"}.isdisjoint(motor):
        yield ("motor", ratio), "S300 is missing"
    gear = joint.get("gear")
    if isinstance(gear, dict):
        yield from ((("gear", key), "is missing") for key in _lacking_values(gear, linear=slides))


def _lacking_values(spring: Mapping[str, object], *, linear: bool) -> Iterator[str]:
    for kind in ("stiffness", "damping"):
        about = PARAMETER_KINDS[kind]
        if {about.field, about.linear_field}.isdisjoint(spring):
            yield about.linear_field if linear else about.field


def missing(robot: RobotFile) -> Found:
    """What a file must say itself; frames, links and limits that a model lacks are told where it is read."""
    for index, joint in enumerate(robot.joints):
        field = ("joints", index)
        if robot.model is None:
            yield from _missing_geometry(field, joint)
        if joint.motor is None and joint.has_motor:
            yield (*field, "motor"), NO_MOTOR
        if robot.model is None and joint.stated_limits is None:
            yield (*field, joint.limits_key), "S054 is missing"
    if robot.model is None:
        for key in ("locked_deg", "locked_m", "locked", "flange"):
            if getattr(robot, key):
                yield (key,), "S302 belongs to a `model`, and there is none"


def _missing_geometry(field: FieldPath, joint: JointSection) -> Found:
    if joint.dh is not None and joint.frame is not None:
        yield (*field, "frame"), "S303 stands in place of `dh`: leave one of them out"
    if joint.dh is None and joint.frame is None:
        yield (*field, "dh"), _NO_GEOMETRY
    if joint.link is None:
        yield (*field, "link"), "S193 is missing"
    if joint.frame is not None:
        rotation = np.array(joint.frame.rotation)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > _PARALLEL or np.linalg.det(rotation) < 0:
            yield (*field, "frame", "rotation"), "S305 is not a rotation: rows must be right-handed unit axes"
