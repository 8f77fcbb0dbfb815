"""Which joints of a rigid model a robot file moves, which stay, and which follow others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.robot.chain import carried_by, carrier_of, frame_of_link
from robid.robot.description import Inertial
from robid.robot.foreign import ForeignModel
from robid.robot.foreign_parts import Tie, follow
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile

_LOCKED = {"hinge": "locked_deg", "slide": "locked_m"}
_SAME = 1e-3
_DUST = 1e-12


@dataclass(frozen=True)
class Motion:
    """What moves."""

    listed: tuple[str, ...]  # Joints of the robot file that the model can drive, base to flange
    held: Mapping[str, float]  # Positions of the joints that do not move [rad, or m]
    resting: tuple[str, ...]  # Of these, the ones that `locked: rest` holds
    following: tuple[str, ...]  # Of these, the ones that follow another that does not move
    led: tuple[Tie, ...]  # Joints that follow one of `listed`, each with the law by which it does
    apart: Mapping[str, int]  # Joints in whose place the file has loop links, each with the index of the link
    unnamed: tuple[str, ...]  # Joints of which the file says nothing


def motion_of(robot: RobotFile, model: ForeignModel) -> Motion:
    """Says what moves of a model."""
    listed = tuple(joint.name for joint in robot.joints if joint.name in model.driven)
    apart = {name: index for name, index in _loop_links(robot, model).items() if name not in listed}
    ties = [tie for tie in model.ties if tie.follower not in (*listed, *apart)]
    followers = {tie.follower for tie in ties}
    held = {name: position for name, position in robot.held.items() if name in model.driven}
    rest = [name for name in model.driven if name not in (*listed, *apart, *held, *followers)]
    others = [name for name in model.others if name not in {joint.name for joint in robot.joints}]
    resting = tuple(rest) if robot.locked == "rest" else ()
    positions = follow(ties, held | {name: model.rest[name] for name in resting})
    laws = [_led(tie, model, listed) for tie in ties]
    led = {law.follower: law for law in laws if law is not None}
    # What follows nothing that moves or stays, in a circle or by a law that is not linear, is held like any other.
    stray = [tie.follower for tie in ties if tie.follower not in positions and tie.follower not in led]
    if robot.locked == "rest":
        positions |= {name: model.rest[name] for name in stray}
        resting += tuple(stray)
    pending = {tie.follower for tie in ties if tie.leader in rest}
    unnamed = () if robot.locked == "rest" else (*rest, *others, *(name for name in stray if name not in pending))
    following = tuple(name for name in positions if name not in held and name not in resting)
    return Motion(listed, positions, resting, following, tuple(led.values()), apart, unnamed)


def _loop_links(robot: RobotFile, model: ForeignModel) -> dict[str, int]:
    """Finds the joints of the model that loop links stand for: those of their name, or whose body has it."""
    bodies = {model.compiled.body(int(model.compiled.joint(name).bodyid[0])).name: name for name in model.driven}
    named = {link.name: index for index, link in enumerate(robot.loop_links)}
    joints = {name: index for name, index in named.items() if name in model.driven}
    return joints | {bodies[name]: index for name, index in named.items() if name in bodies and name not in joints}


def _led(tie: Tie, model: ForeignModel, listed: tuple[str, ...]) -> Tie | None:
    """Returns the law by which a joint follows one of those listed, through others if need be."""
    laws = {each.follower: each for each in model.ties}
    for _ in laws:
        if tie.leader is None or tie.leader in listed:
            break
        above = laws.get(tie.leader)
        if above is None:
            return None
        factor, offset = tie.factor * above.factor, tie.offset + tie.factor * above.offset
        tie = Tie(tie.follower, above.leader, factor, offset, tie.is_linear and above.is_linear)
    return tie if tie.leader in listed else None


def motion_faults(robot: RobotFile, model: ForeignModel, motion: Motion) -> Found:
    """Yields what is wrong with what moves."""
    yield from _held_faults(robot, model, motion)
    if motion.unnamed:
        yield ("joints",), _unnamed(model, motion.unnamed)
    yield from _listed_followers(robot, model)
    yield from _led_faults(model, motion)
    yield from _apart_faults(robot, model, motion)
    yield from _bond_faults(model, motion)


def motion_notes(model: ForeignModel, motion: Motion) -> Iterator[str]:
    """Says what of the model is held without having been named."""
    for names, why in ((motion.resting, "held at rest"), (motion.following, "fixed where what they follow puts them")):
        if names:
            positions = ", ".join(f"{name} {_position(model, name, motion.held[name])}" for name in names)
            yield f"{model.name}: joints {why}: {positions}"
    idle = [bond.what for bond in model.bonds if not _strains(bond.bodies, bond.joints, model, motion)]
    if idle:
        yield f"{model.name}: constraints between what does not move against each other left out: {', '.join(idle)}"


def _position(model: ForeignModel, name: str, value: float) -> str:
    return f"{value:.6g} m" if name in model.slides else f"{np.rad2deg(value):.6g} deg"


def _unnamed(model: ForeignModel, names: tuple[str, ...]) -> str:
    kinds = [_LOCKED["slide" if name in model.slides else "hinge"] for name in names if name in model.driven]
    keys = " or ".join(f"`{key}`" for key in dict.fromkeys(kinds))
    listed = ", ".join(f"`{name}`{'' if name in model.driven else ' (neither hinge nor slide)'}" for name in names)
    many = len(names) > 1
    told = f"joint{'s' if many else ''} {listed} of `{model.name}` {'are' if many else 'is'} neither here"
    told += f" nor in {keys}" if keys else " nor locked"
    return f"S320 {told}: `locked: rest` locks {'all of them' if many else 'it'} at rest"


def _held_faults(robot: RobotFile, model: ForeignModel, motion: Motion) -> Found:
    """Finds positions of locked joints that cannot be."""
    laws = {tie.follower: tie for tie in model.ties if tie.is_linear}
    for key, names in (("locked_deg", model.hinges), ("locked_m", model.slides)):
        for name in getattr(robot, key):
            if name in model.driven and name not in names:
                kind = "hinge" if name in model.hinges else "slide"
                message = f"S321 joint `{name}` of `{model.name}` is a {kind}: write it under `{_LOCKED[kind]}`"
                yield (key, name), message
            elif name not in names:
                yield (key, name), f"S322 `{model.name}` has no joint `{name}`; {suggest(name, names)}"
            else:
                yield from (((key, name), told) for told in _cannot_be(model, name, laws.get(name), motion))


def _cannot_be(model: ForeignModel, name: str, law: Tie | None, motion: Motion) -> Iterator[str]:
    value, joint = motion.held[name], model.compiled.joint(name)
    lower, upper = joint.range.tolist()
    if model.compiled.jnt_limited[joint.id] and not lower - _SAME <= value <= upper + _SAME:
        limits = " to ".join(_position(model, name, limit) for limit in (lower, upper))
        yield f"{_position(model, name, value)} lies outside the limits of the model, {limits}"
    leader = None if law is None else law.leader
    if law is not None and (leader is None or leader in motion.held):
        wanted = law.offset + law.factor * (0.0 if leader is None else motion.held[leader])
        if abs(wanted - value) > _SAME:
            told = f"follows `{leader}`" if leader else "is fixed"
            yield f"`{name}` {told}, which puts it at {_position(model, name, wanted)}: leave it out"


def _listed_followers(robot: RobotFile, model: ForeignModel) -> Found:
    laws = {tie.follower: tie for tie in model.ties}
    for index, joint in enumerate(robot.joints):
        law = laws.get(joint.name)
        if law is not None:
            told = f"follows `{law.leader}`" if law.leader else "is fixed by a constraint"
            told = f"joint `{joint.name}` {told} in `{model.name}`, so no motor of its own moves it: leave it out,"
            yield ("joints", index, "name"), f"S323 {told} or take the tie out of the model where the robot has none"


def _led_faults(model: ForeignModel, motion: Motion) -> Found:
    """Refuses joints that follow others that move, with the loop links that stand for them."""
    entries = []
    led = [tie.follower for tie in motion.led]
    for tie in sorted(motion.led, key=lambda tie: int(model.compiled.joint(tie.follower).bodyid[0])):
        told = f"joint `{tie.follower}` of `{model.name}` follows `{tie.leader}`, so that the two move together"
        others = [name for name in motion.listed if name != tie.follower]
        beyond = [name for name in others if carrier_of(model, name, [tie.follower]) == tie.follower]
        if beyond:
            names = ", ".join(f"`{name}`" for name in beyond)
            message = f"S324 {told}, and carries {names}: a chain has no such joint; leave {names} out of `joints`"
            yield ("model",), message
        elif tie.follower in model.slides or not tie.is_linear:
            what = "slides" if tie.follower in model.slides else "does so by a law that is not linear"
            message = f"S325 {told}; it {what}, which no entry of `loop_links` does: such robots are not known here"
            yield ("model",), message
        else:
            apart = [*led, *motion.apart]
            carrier = carrier_of(model, tie.follower, [*motion.listed, *apart])
            frame = frame_of_link(model, tie.follower, carrier, motion.held, apart)
            entries.append((told, _entry(tie, carrier, *frame)))
    if entries:
        told = "; ".join(told for told, _ in entries)
        shown = ", ".join(entry for _, entry in entries)
        message = (
            f"S326 {told}: a chain has no such joint, but a loop link of a rigid fit turns like that: add"
            f" `loop_links: [{shown}]`; a loop link of a joint's name stands in the place of what that joint moves"
            " in the model"
        )
        yield ("model",), message


def _entry(tie: Tie, carrier: str | None, position: FloatArray, rotation: FloatArray, link: Inertial) -> str:
    tensor = link.inertia_kgm2
    pairs = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
    inertia = ", ".join(f"{key}: {_number(float(tensor[pair]))}" for key, pair in pairs.items())
    parent = "" if carrier is None else f"parent: {carrier}, "
    offset = f"offset_deg: {_number(float(np.rad2deg(tie.offset)))}, " if tie.offset else ""
    turns = f"turns: {{{tie.leader}: {_number(tie.factor)}}}, {offset}"
    return (
        f"{{name: {tie.follower}, {parent}frame: {{position_m: {_vector(position)}, rotation: "
        f"[{', '.join(_vector(row) for row in rotation)}]}}, {turns}link: "
        f"{{mass_kg: {_number(link.mass_kg)}, com_m: {_vector(link.com_m)}, inertia_kgm2: {{{inertia}}}}}}}"
    )


def _vector(values: FloatArray) -> str:
    return f"[{', '.join(_number(float(value)) for value in values)}]"


def _number(value: float) -> str:
    """Writes a number so that YAML reads one, without the dust of rotations."""
    return "0" if abs(value) < _DUST else f"{value:.9g}"


def _apart_faults(robot: RobotFile, model: ForeignModel, motion: Motion) -> Found:
    """Finds loop links that turn otherwise than the joint of the model in whose place they stand."""
    for name, index in motion.apart.items():
        found = next((_led(tie, model, motion.listed) for tie in model.ties if tie.follower == name), None)
        turns = robot.loop_links[index].turns
        if found is not None and found.is_linear and found.leader is not None:
            others = {joint: turn for joint, turn in turns.items() if joint != found.leader and turn}
            if others or abs(abs(turns.get(found.leader, 0.0)) - abs(found.factor)) > _SAME:
                told = f"S327 the joint of `{model.name}` in its place follows `{found.leader}` with {found.factor:g}"
                yield ("loop_links", index, "turns"), told


def _bond_faults(model: ForeignModel, motion: Motion) -> Found:
    for bond in model.bonds:
        if not _strains(bond.bodies, bond.joints, model, motion):
            continue
        between = " and ".join(f"`{name}`" for name in bond.bodies) or ", ".join(f"`{name}`" for name in bond.joints)
        message = (
            f"S328 {bond.what} of `{model.name}` ties {between}, which move against each other: a chain has no such"
            " tie; take it out of the model if the robot has none, and write a closed loop's cranks and rods as"
            " `loop_links`, each by the name of its joint in the model"
        )
        yield ("model",), message


def _strains(bodies: tuple[str, ...], joints: tuple[str, ...], model: ForeignModel, motion: Motion) -> bool:
    """Whether a constraint acts on what moves; loop links close their loops themselves."""
    if joints:
        return any(joint in motion.listed for joint in joints)
    moved = carried_by(model, motion.listed, motion.apart)
    places = {body: mover for mover, carried in moved.items() for body in carried} | {"world": None}
    if any(body not in places for body in bodies):
        return False
    return len({places[body] for body in bodies}) > 1
