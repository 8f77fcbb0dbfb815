"""What must hold in a robot file beyond the types of its fields."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator

import numpy as np
from pydantic import BaseModel

from robid.robot.description import Inertial
from robid.robot.inertia import remove
from robid.settings.problems import Problem, problem_at, suggest
from robid.settings.robot import Body, RobotFile, SpringSection, assumed_sections
from robid.settings.yaml import Document, FieldPath

_ROUNDING = 1e-9
_PARALLEL = 1e-6


def check_robot(document: Document, robot: RobotFile) -> list[Problem]:
    """Returns everything that is wrong with a robot file whose fields have the right types."""
    checks = (_names, _joints, _springs, _splits, _payload, _assumed)
    return [problem_at(document, field, message) for check in checks for field, message in check(robot)]


def _names(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    named: list[tuple[FieldPath, str]] = [(("joints", i, "name"), joint.name) for i, joint in enumerate(robot.joints)]
    named += [(("springs", i, "name"), spring.name) for i, spring in enumerate(robot.springs)]
    count = Counter(name for _, name in named)
    for field, name in named:
        if count[name] > 1:
            yield field, f"`{name}` names more than one joint or spring"


def _joints(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    for index, joint in enumerate(robot.joints):
        field = ("joints", index)
        lower, upper = joint.limits_deg
        if lower >= upper:
            yield (*field, "limits_deg"), f"the lower limit {lower:g} is not below the upper limit {upper:g}"
        yield from _body((*field, "link"), joint.link)
        transmissions = [s.name for s in robot.springs if s.joint == joint.name and s.place == "transmission"]
        if len(transmissions) != 1:
            found = f"{len(transmissions)} ({', '.join(transmissions)})" if transmissions else "none"
            yield (*field, "name"), f"joint `{joint.name}` needs exactly one transmission spring, but has {found}"


def _body(field: FieldPath, body: Body) -> Iterator[tuple[FieldPath, str]]:
    if body.mass_kg <= 0:
        yield (*field, "mass_kg"), f"must be above 0 (found {body.mass_kg:g})"
    wrong = _unphysical(body.inertial())
    if wrong:
        yield (*field, "inertia_kgm2"), wrong


def _unphysical(body: Inertial) -> str:
    """Says why no rigid body has this inertia, or returns an empty text."""
    moments = np.linalg.eigvalsh(body.inertia_kgm2)
    shown = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0:
        return f"must be positive definite; its principal moments are {shown} kg m^2"
    if moments[2] > (moments[0] + moments[1]) * (1 + _ROUNDING):
        return f"no body has these principal moments, {shown} kg m^2: each must be at most the sum of the others"
    return ""


def _springs(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    joints = [joint.name for joint in robot.joints]
    for index, spring in enumerate(robot.springs):
        field = ("springs", index)
        if spring.joint not in joints:
            yield (*field, "joint"), f"there is no joint `{spring.joint}`; {suggest(spring.joint, joints)}"
        if spring.place == "transmission":
            if spring.axis is not None:
                yield (*field, "axis"), "a transmission turns about its joint's axis: leave `axis` out"
        elif spring.axis is None:
            yield (*field, "axis"), f"is missing: a {spring.place} spring needs one"
        elif np.linalg.norm(spring.axis) == 0:
            yield (*field, "axis"), "has no direction"
        elif spring.place == "bearing" and np.hypot(*spring.axis[:2]) < _PARALLEL * np.linalg.norm(spring.axis):
            yield (*field, "axis"), "lies along the joint axis z: that is what the transmission is for"
        for key in ("point_m", "outboard"):
            if (spring.place == "split") != (getattr(spring, key) is not None):
                told = "is missing: a split spring needs it" if spring.place == "split" else "is for split springs only"
                yield (*field, key), told


def _splits(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Goes through the splits of each link from its joint outwards; each takes a part of what is left."""
    for joint in robot.joints:
        whole = joint.link.inertial()
        for index, spring in enumerate(robot.springs):
            if spring.joint == joint.name and spring.place == "split" and spring.outboard is not None:
                part = spring.outboard.inertial()
                yield from _split(("springs", index, "outboard"), spring, spring.outboard, whole)
                whole = part


def _split(field: FieldPath, spring: SpringSection, outboard: Body, whole: Inertial) -> Iterator[tuple[FieldPath, str]]:
    yield from _body(field, outboard)
    if outboard.mass_kg >= whole.mass_kg:
        message = f"must be below the {whole.mass_kg:g} kg that `{spring.name}` splits (found {outboard.mass_kg:g})"
        yield (*field, "mass_kg"), message
        return
    wrong = _unphysical(remove(whole, outboard.inertial()))
    if wrong and not _unphysical(whole) and not _unphysical(outboard.inertial()):
        yield (*field, "inertia_kgm2"), f"what is left of the link of `{spring.joint}` without it: {wrong}"


def _payload(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    if robot.payload is not None and robot.payload.mass_kg > 0:
        yield from _body(("payload",), robot.payload)


def _assumed(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    for _, field, section in assumed_sections(robot):
        for index, name in enumerate(section.assumed):
            node: object = section
            for part in name.split("."):
                known = _field_names(node)
                if part not in known:
                    yield (*field, "assumed", index), f"there is no value `{name}` here; {suggest(part, known)}"
                    break
                node = getattr(node, part)


def _field_names(node: object) -> list[str]:
    if isinstance(node, BaseModel):
        return [name for name in type(node).model_fields if name != "assumed"]
    return [field.name for field in dataclasses.fields(node)] if dataclasses.is_dataclass(node) else []
