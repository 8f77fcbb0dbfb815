"""Completing a robot file from the rigid MJCF or URDF that it names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.chain import ForeignJoint, extract_chain, frame_on_last, order_of
from robid.robot.foreign import ForeignModel, read_model
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.counterbalance import CounterbalanceSection
from robid.settings.loop_links import LoopLinkSection
from robid.settings.problems import SettingsProblem, problem_at, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_frames import Frame
from robid.settings.robot_sections import JointSection, MotorSection, SpringSection, moved
from robid.settings.robot_values import body_section
from robid.settings.yaml import Document, FieldPath

_Found = Iterator[tuple[FieldPath, str]]
_LOCKED = {"hinge": "locked_deg", "slide": "locked_m"}


@dataclass(frozen=True)
class Completed:
    """A robot file with what its model brings, and what is wrong with the two together.

    Attributes:
        robot: The completed file, or the file as it is where the model cannot be read or used.
        problems: What is wrong.
        immobile: Joints of the model that do not move, with the reason.
    """

    robot: RobotFile
    problems: list[SettingsProblem]
    immobile: dict[str, str]


def complete(document: Document, robot: RobotFile) -> Completed:
    """Completes a robot file from its model; one in a data folder that is not there is left for later."""
    path = robot.model_path(document.path.parent)
    if robot.model is None or path is None:
        return Completed(robot, [], {})
    if not path.exists() and robot.model.startswith(DATA_VARIABLE) and not data_path(DATA_VARIABLE, path).is_dir():
        return Completed(robot, [], {})
    try:
        model = read_model(path)
    except DataError as error:
        return Completed(robot, [problem_at(document, ("model",), f"{error.where} {error.what}")], {})
    immobile = dict.fromkeys(model.fixed, "is fixed in the model")
    immobile |= dict.fromkeys(robot.locked_deg, "is locked by `locked_deg`")
    immobile |= dict.fromkeys(robot.locked_m, "is locked by `locked_m`")
    found = [*_joints(robot, model, immobile), *_links(robot, model)]
    names = [joint.name for joint in robot.joints]
    if not found:
        found = [(("joints",), message) for message in order_of(model, names)]
    if found:
        return Completed(robot, [problem_at(document, field, message) for field, message in found], immobile)
    locked = robot.locked
    flange: tuple[FloatArray, FloatArray] = (np.zeros(3), np.eye(3))
    if robot.flange is not None:
        there = frame_on_last(model, names, locked, robot.flange)
        if there is None:
            hint = suggest(robot.flange, model.frames())
            message = f"there is no body or site `{robot.flange}` on the last link; {hint}"
            return Completed(robot, [problem_at(document, ("flange",), message)], immobile)
        flange = there
    return Completed(_merge(robot, model, extract_chain(model, names, locked), flange), [], immobile)


def _joints(robot: RobotFile, model: ForeignModel, immobile: dict[str, str]) -> _Found:
    listed = [joint.name for joint in robot.joints]
    for key, names in (("locked_deg", model.hinges), ("locked_m", model.slides)):
        for name in getattr(robot, key):
            if name in model.driven and name not in names:
                kind = "hinge" if name in model.hinges else "slide"
                yield (key, name), f"joint `{name}` of `{model.name}` is a {kind}: write it under `{_LOCKED[kind]}`"
            elif name not in names:
                yield (key, name), f"`{model.name}` has no joint `{name}`; {suggest(name, names)}"
    for index, name in enumerate(listed):
        field = ("joints", index, "name")
        if name in immobile:
            yield field, f"joint `{name}` {immobile[name]}, so no motor moves it: leave it out"
        elif name in model.others:
            yield field, f"joint `{name}` of `{model.name}` is neither hinge nor slide: only these can be driven"
        elif name not in model.driven:
            yield field, f"`{model.name}` has no joint `{name}`; {suggest(name, model.driven)}"
        elif robot.joints[index].slides != (name in model.slides):
            told = "slides: it needs `type: prismatic`" if name in model.slides else "turns: leave `type` out"
            yield ("joints", index, "type"), f"joint `{name}` of `{model.name}` {told}"
    for kind, names in (("hinge", model.hinges), ("slide", model.slides)):
        for name in names:
            if name not in listed and name not in robot.locked:
                message = f"joint `{name}` of `{model.name}` is neither here nor in `{_LOCKED[kind]}`"
                yield ("joints",), message
    for name in model.others:
        if name not in listed:
            yield ("model",), f"joint `{name}` of `{model.name}` is neither hinge nor slide: remove it from the model"


def _links(robot: RobotFile, model: ForeignModel) -> _Found:
    massless = [link for joint, link in model.massless.items() if joint not in robot.locked]
    if massless:
        named = ", ".join(f"`{link}`" for link in massless)
        yield ("model",), f"links without an `inertial` in `{model.name}`: {named}; an elastic model needs their masses"
    for index, joint in enumerate(robot.joints):
        for key in ("dh", "frame", "link"):
            if getattr(joint, key) is not None:
                yield ("joints", index, key), "is what `model` brings: leave one of them out"


def _merge(
    robot: RobotFile, model: ForeignModel, chain: list[ForeignJoint], flange: tuple[FloatArray, FloatArray]
) -> RobotFile:
    joints = tuple(_joint(section, found, model) for section, found in zip(robot.joints, chain, strict=True))
    bodies = {found.name: (found.body_position_m, found.body_rotation) for found in chain}
    last_position, last_rotation = bodies[chain[-1].name]
    held, turned = last_position + last_rotation @ flange[0], last_rotation @ flange[1]
    springs = []
    for spring in robot.springs:
        update: dict[str, Any] = {}
        position, rotation = _frame_of(spring, bodies, (held, turned))
        if spring.axis is not None:
            update["axis"] = tuple((rotation @ spring.axis).tolist())
        if spring.point_m is not None or spring.place == "payload":
            update["point_m"] = tuple((position + rotation @ (spring.point_m or (0.0, 0.0, 0.0))).tolist())
        if spring.outboard is not None:
            update["outboard"] = body_section(moved(spring.outboard.inertial(), position, rotation), spring.outboard)
        springs.append(spring.model_copy(update=update))
    sensors = []
    for sensor in robot.sensors:
        position, rotation = (held, turned) if sensor.joint is None else bodies.get(sensor.joint, (held, turned))
        update = {"point_m": tuple((position + rotation @ sensor.point_m).tolist())}
        if sensor.kind == "accelerometer":
            update["axis"] = tuple((rotation @ sensor.axis).tolist())
        sensors.append(sensor.model_copy(update=update))
    payload = robot.payload
    if payload is not None:
        payload = body_section(moved(payload.inertial(), held, turned), payload)
    update = {"joints": joints, "springs": tuple(springs), "sensors": tuple(sensors), "payload": payload}
    update["loop_links"] = tuple(_loop_link(link, bodies) for link in robot.loop_links)
    update["notes"] = (*robot.notes, *model.notes)
    return robot.model_copy(update=update)


def _frame_of(
    spring: SpringSection, bodies: dict[str, tuple[FloatArray, FloatArray]], flange: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Returns the frame that a spring is given in, in its joint's frame; the base's is the world's own."""
    if spring.place == "payload":
        return flange
    return bodies.get(spring.joint or "", (np.zeros(3), np.eye(3)))


def _joint(section: JointSection, found: ForeignJoint, model: ForeignModel) -> JointSection:
    limits = section.stated_limits
    if limits is None and found.range is not None:
        lower, upper = found.range if found.slides else np.rad2deg(found.range).tolist()
        limits = (lower, upper)
    frame = Frame.model_validate({"position_m": found.position_m.tolist(), "rotation": found.rotation.tolist()})
    update = {
        "frame": frame,
        section.limits_key: limits,
        "link": body_section(found.link),
        "motor": None if section.motor is None else _motor(section.name, section.motor, model),
    }
    return section.model_copy(update=update | {"counterbalance": _balance(section, found)})


def _loop_link(link: LoopLinkSection, bodies: dict[str, tuple[FloatArray, FloatArray]]) -> LoopLinkSection:
    """Takes a loop link from the frames of the file's own bodies to the joint frames."""
    update: dict[str, Any] = {}
    if link.parent in bodies:
        position, rotation = bodies[link.parent]
        offset, turn = link.frame.joint_frame()
        frame = {"position_m": (position + rotation @ offset).tolist(), "rotation": (rotation @ turn).tolist()}
        update["frame"] = Frame.model_validate(frame)
    if link.pin is not None and link.pin.joint in bodies:
        position, rotation = bodies[link.pin.joint]
        held = tuple((position + rotation @ link.pin.held_point_m).tolist())
        update["pin"] = link.pin.model_copy(update={"held_point_m": held})
    return link.model_copy(update=update)


def _balance(section: JointSection, found: ForeignJoint) -> CounterbalanceSection | None:
    """Takes the ends of a counterbalance's spring from the frame of the file's own body to the joint frame."""
    balance, update = section.counterbalance, {}
    for key in ("carrier_point_m", "link_point_m"):
        point = None if balance is None else getattr(balance, key)
        if point is not None:
            update[key] = tuple((found.body_position_m + found.body_rotation @ point).tolist())
    return None if balance is None else balance.model_copy(update=update)


def _motor(name: str, motor: MotorSection, model: ForeignModel) -> MotorSection:
    """Takes arm-side limits of the model to the motor side where the file states none."""
    update: dict[str, float] = {}
    ratio = abs(motor.ratio or 0.0)
    if ratio == 0:
        return motor
    if motor.max_speed_rad_s is None and name in model.speed:
        update["max_speed_rad_s"] = model.speed[name] * ratio
    if motor.max_torque_nm is None and name in model.torque:
        update["max_torque_nm"] = model.torque[name] / ratio
    return motor.model_copy(update=update)
