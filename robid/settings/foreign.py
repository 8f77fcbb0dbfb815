"""Completing a robot file from the rigid MJCF or URDF that it names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.chain import ForeignJoint, carried_by, extract_chain, frame_on_last, order_of
from robid.robot.foreign import ForeignModel, read_model
from robid.robot.foreign_parts import led_by
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.foreign_motion import Motion, motion_faults, motion_notes, motion_of
from robid.settings.joint_sections import CounterbalanceSection, Frame
from robid.settings.problems import Found, SettingsProblem, problem_at, suggest
from robid.settings.robot import LoopLinkSection, RobotFile
from robid.settings.robot_sections import JointSection, MotorSection, moved
from robid.settings.robot_values import body_section
from robid.settings.yaml import Document

_MOST_RADIANS, _MOST_TURNS = 6.3, 10
_LEAST_GRAVITY, _MOST_GRAVITY = 9.7, 9.9


@dataclass(frozen=True)
class Completed:
    """A robot file with what its model brings, or as it is where that is of no use, and what is wrong with the two.

    The joints of the model that do not move have a reason.
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
        unread = robot.model_copy(update={"joints": tuple(map(_as_written, robot.joints))})
        return Completed(unread, [problem_at(document, ("model",), f"{error.where} {error.what}")], {})
    model = replace(model, ties=led_by(model.ties, [joint.name for joint in robot.joints]))
    motion = motion_of(robot, model)
    immobile = dict.fromkeys(model.fixed, "is fixed in the model") | dict.fromkeys(motion.held, "is held at rest")
    immobile |= dict.fromkeys(robot.locked_deg, "is locked by `locked_deg`")
    immobile |= dict.fromkeys(robot.locked_m, "is locked by `locked_m`")
    found = [*_joints(robot, model, immobile), *motion_faults(robot, model, motion), *_links(robot, model, motion)]
    found += [*_limits(robot, model), *_units(robot, model), *_gravity(robot, model)]
    names = [joint.name for joint in robot.joints]
    if set(names) <= set(model.driven):
        found += [(("joints",), message) for message in order_of(model, names)]
    if found:
        typed = robot.model_copy(update={"joints": tuple(_typed(joint, model) for joint in robot.joints)})
        return Completed(typed, [problem_at(document, field, message) for field, message in found], immobile)
    flange: tuple[FloatArray, FloatArray] = (np.zeros(3), np.eye(3))
    if robot.flange is not None:
        there = frame_on_last(model, names, motion.held, robot.flange, motion.apart)
        if there is None:
            hint = suggest(robot.flange, model.frames())
            message = f"there is no body or site `{robot.flange}` on the last link; {hint}"
            return Completed(robot, [problem_at(document, ("flange",), message)], immobile)
        flange = there
    chain = extract_chain(model, names, motion.held, motion.apart)
    return Completed(_with_motion(_merge(robot, model, chain, flange), model, motion), [], immobile)


def _as_written(joint: JointSection) -> JointSection:
    """Takes a joint for prismatic where its units say so: of a model that cannot be read, nothing else tells."""
    ratio = None if joint.motor is None else joint.motor.gear_ratio_rad_m
    slides = ratio is not None or joint.limits_m is not None
    is_stated = "type" in joint.model_fields_set
    return joint if is_stated or not slides else joint.model_copy(update={"type": "prismatic"})


def _typed(joint: JointSection, model: ForeignModel) -> JointSection:
    """Gives a joint the type that it has in the model, so that its units are judged by that."""
    if joint.name not in model.driven:
        return _as_written(joint)
    return joint.model_copy(update={"type": "prismatic" if joint.name in model.slides else "revolute"})


def _joints(robot: RobotFile, model: ForeignModel, immobile: dict[str, str]) -> Found:
    for index, joint in enumerate(robot.joints):
        name, field = joint.name, ("joints", index, "name")
        if name in immobile:
            yield field, f"S307 joint `{name}` {immobile[name]}, so no motor moves it: leave it out"
        elif name in model.others:
            yield field, f"S308 joint `{name}` of `{model.name}` is neither hinge nor slide: only these can be driven"
        elif name not in model.driven:
            yield field, f"S309 `{model.name}` has no joint `{name}`; {suggest(name, model.driven)}"
        elif joint.slides != (name in model.slides):
            told = "slides: it needs `type: prismatic`" if name in model.slides else "turns: leave `type` out"
            yield ("joints", index, "type"), f"S310 joint `{name}` of `{model.name}` {told}"
        for key in ("dh", "frame", "link"):
            if getattr(joint, key) is not None:
                yield ("joints", index, key), "S311 is what `model` brings: leave one of them out"


def _limits(robot: RobotFile, model: ForeignModel) -> Found:
    for index, joint in enumerate(robot.joints):
        if joint.name not in model.driven:
            continue
        key = "limits_m" if joint.name in model.slides else "limits_deg"
        stated, fault = getattr(joint, key), model.limit_faults.get(joint.name)
        if stated is None and fault:
            told = f"S312 joint `{joint.name}` of `{model.name}`: {fault}; correct the model, or write `{key}` here"
            yield ("joints", index, key), told
        elif stated is None and not model.compiled.jnt_limited[model.compiled.joint(joint.name).id]:
            yield ("joints", index, key), "S313 is missing: the model does not say it either"


def _units(robot: RobotFile, model: ForeignModel) -> Found:
    """Asks where all limits of a model look as if radians were read as degrees, or degrees as radians."""
    stated = {joint.name for joint in robot.joints if joint.stated_limits is None and joint.name in model.hinges}
    found = {name: model.compiled.joint(name) for name in stated}
    ranges = {name: joint.range for name, joint in found.items() if model.compiled.jnt_limited[joint.id]}
    widest = max((float(np.abs(limits).max()) for limits in ranges.values()), default=0.0)
    if model.in_degrees and len(ranges) > 1 and np.rad2deg(widest) <= _MOST_RADIANS:
        told = f"no limit of a hinge in `{model.name}` is beyond {np.rad2deg(widest):.4g} deg, as where radians are"
        yield ("model",), f'S314 {told} read as degrees: write `<compiler angle="radian"/>` in it, or `limits_deg` here'
    for name, limits in ranges.items():
        if np.abs(limits).max() > _MOST_TURNS * 2 * np.pi:
            shown = " to ".join(f"{limit:.4g}" for limit in limits)
            told = f"the limits of `{name}` in `{model.name}` are {shown} rad, as where degrees are read as radians"
            yield ("model",), f"S315 {told}: correct the model, or write limits in `limits_deg` here"


def _links(robot: RobotFile, model: ForeignModel, motion: Motion) -> Found:
    """Finds links that move and have no masses that a body can have; those of joints that are unknown count, too."""
    listed = {joint.name for joint in robot.joints}
    moving = motion.listed if listed <= {*model.driven} else [n for n in model.driven if n not in motion.held]
    carried = {joint: names for joint, names in carried_by(model, moving, motion.apart).items() if joint is not None}
    massless = []
    for names in carried.values():
        indices = [model.compiled.body(name).id for name in names]
        mass, inertia = model.weights.mass_kg[indices].sum(), model.weights.inertia_kgm2[indices]
        faults = {name: model.faults[name] for name in names if name in model.faults}
        yield from ((("model",), f"link `{name}` of `{model.name}`: {told}") for name, told in faults.items())
        if faults:
            continue
        if mass == 0:
            massless.append(names[0])
        elif len(np.flatnonzero(model.weights.mass_kg[indices])) == 1 and not inertia.any():
            yield ("model",), f"S316 link `{names[0]}` of `{model.name}`: it has a mass but no inertia"
    if massless:
        named = ", ".join(f"`{link}`" for link in massless)
        message = f"S317 links without an `inertial` in `{model.name}`: {named}; a dynamic model needs their masses"
        yield ("model",), message


def _gravity(robot: RobotFile, model: ForeignModel) -> Found:
    """Asks for gravity where the model's cannot be meant, or where the mounting is stated twice."""
    stated, size = model.gravity, float(np.linalg.norm(model.gravity))
    if "gravity_m_s2" in robot.model_fields_set:
        return
    shown = ", ".join(f"{value:g}" for value in stated)
    if not _LEAST_GRAVITY <= size <= _MOST_GRAVITY:
        what = "has no gravity" if size == 0 else f"states a gravity of {size:.4g} m/s^2 ({shown})"
        told = (
            f"S318 `{model.name}` {what}: write what the robot feels as `gravity_m_s2`, [0, 0, -9.81] if it stands "
            "upright"
        )
        yield ("model",), told
    elif any(robot.base_rpy_deg) and stated[:2] != (0.0, 0.0):
        told = (
            f"S319 turns the base, and the gravity of `{model.name}` ({shown}) is turned, too: write `gravity_m_s2` "
            "as well"
        )
        yield ("base_rpy_deg",), told


def _with_motion(robot: RobotFile, model: ForeignModel, motion: Motion) -> RobotFile:
    held = {name: value for name, value in motion.held.items() if name not in robot.held}
    turned = {name: float(np.rad2deg(value)) for name, value in held.items() if name in model.hinges}
    slid = {name: value for name, value in held.items() if name in model.slides}
    update: dict[str, Any] = {"notes": (*robot.notes, *motion_notes(model, motion))}
    if held:
        update |= {"locked_deg": {**robot.locked_deg, **turned}, "locked_m": {**robot.locked_m, **slid}}
    if "gravity_m_s2" not in robot.model_fields_set and model.gravity != robot.gravity_m_s2:
        shown = ", ".join(f"{value:g}" for value in model.gravity)
        update["gravity_m_s2"] = model.gravity
        update["notes"] = (*update["notes"], f"{model.name}: gravity of the model taken, ({shown}) m/s^2")
    return robot.model_copy(update=update)


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
        # The frame that it is given in, in its joint's frame; the base's is the world's own.
        frame = bodies.get(spring.joint or "", (np.zeros(3), np.eye(3)))
        position, rotation = (held, turned) if spring.place == "payload" else frame
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
    merged = robot.model_copy(update=update)
    merged.state_axes([*(bodies[found.name][1] for found in chain), turned])
    return merged


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
