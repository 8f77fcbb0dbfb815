"""What a robot file lacks, by the types of its joints and by whether a model brings it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.problems import SettingsProblem, problem_at
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection
from robid.settings.yaml import Document, FieldPath

_PARALLEL = 1e-6
NO_MOTOR = "is missing (or `torque_measured_at: joint`, where a sensor behind the gear measures the joint's torque)"
_NO_GEOMETRY = "is missing (or `frame`, or a `model` for the whole robot)"


def missing_keys(document: Document) -> list[SettingsProblem]:
    """Returns what a robot file lacks by the types of its joints, whatever else keeps it from being read."""
    joints = document.data.get("joints")
    if not isinstance(joints, list):
        return []
    sliding = {joint.get("name") for joint in joints if isinstance(joint, dict) and joint.get("type") == "prismatic"}
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


def _lacking(joint: Mapping[str, object], *, slides: bool, alone: bool) -> Iterator[tuple[FieldPath, str]]:
    """What a joint as it is written lacks; frames, links and limits only where no model brings them."""
    if alone and "dh" not in joint and "frame" not in joint:
        yield ("dh",), _NO_GEOMETRY
    wanted = ("link", "limits_m" if slides else "limits_deg") if alone else ()
    yield from (((key,), "is missing") for key in wanted if key not in joint)
    if "motor" not in joint and joint.get("torque_measured_at") != "joint":
        yield ("motor",), NO_MOTOR
    ratio, motor = "gear_ratio_rad_m" if slides else "gear_ratio", joint.get("motor")
    if isinstance(motor, dict) and {"gear_ratio", "gear_ratio_rad_m"}.isdisjoint(motor):
        yield ("motor", ratio), "is missing"
    gear = joint.get("gear")
    if isinstance(gear, dict):
        yield from ((("gear", key), "is missing") for key in _lacking_values(gear, linear=slides))


def _lacking_values(spring: Mapping[str, object], *, linear: bool) -> Iterator[str]:
    for kind in ("stiffness", "damping"):
        about = PARAMETER_KINDS[kind]
        if {about.field, about.linear_field}.isdisjoint(spring):
            yield about.linear_field if linear else about.field


def missing(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """What a file must say itself; frames, links and limits that a model lacks are told where it is read."""
    for index, joint in enumerate(robot.joints):
        field = ("joints", index)
        if robot.model is None:
            yield from _missing_geometry(field, joint)
        if joint.motor is None and joint.has_motor:
            yield (*field, "motor"), NO_MOTOR
        if robot.model is None and joint.stated_limits is None:
            yield (*field, joint.limits_key), "is missing"
    if robot.model is None:
        for key in ("locked_deg", "locked_m", "locked", "flange"):
            if getattr(robot, key):
                yield (key,), "belongs to a `model`, and there is none"


def _missing_geometry(field: FieldPath, joint: JointSection) -> Iterator[tuple[FieldPath, str]]:
    if joint.dh is not None and joint.frame is not None:
        yield (*field, "frame"), "stands in place of `dh`: leave one of them out"
    if joint.dh is None and joint.frame is None:
        yield (*field, "dh"), _NO_GEOMETRY
    if joint.link is None:
        yield (*field, "link"), "is missing"
    if joint.frame is not None:
        rotation = np.array(joint.frame.rotation)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > _PARALLEL or np.linalg.det(rotation) < 0:
            yield (*field, "frame", "rotation"), "is not a rotation: rows must be right-handed unit axes"
