"""Channels whose unit or side their joint does not have: a force where it turns, an angle where it slides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.acquire import Acquire
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection
from robid.settings.yaml import FieldPath
from robid.signals.log_channels import LogChannel
from robid.signals.quantities import UNITS

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_TURNS = {"N m": "torque", "rad": "angle", "rad/s": "speed", "rad/s^2": "acceleration"}
_SLIDES = {"N": "force", "m": "position", "m/s": "speed", "m/s^2": "acceleration"}
_TO_SLIDE = dict(zip(_TURNS, _SLIDES, strict=True))
_TO_TURN = dict(zip(_SLIDES, _TURNS, strict=True))


def wrong_kinds(acquire: Acquire, robot: RobotFile) -> _Found:
    """Yields channels of joints whose unit or side is not one of their joint, below the log's section.

    What is measured at the tool may be anything, and so may a second sensor of a joint, which has a name of its own.

    Args:
        acquire: The logs, each side of a joint named as `with_sides` names it.
        robot: The robot file.
    """
    joints = {joint.name: joint for joint in robot.joints}
    groups: tuple[tuple[str, tuple[LogChannel, ...]], ...] = (
        ("inputs", acquire.inputs),
        ("outputs", acquire.outputs),
        ("references", acquire.references),
    )
    for key, channels in groups:
        for index, channel in enumerate(channels):
            joint = joints.get(channel.name.removesuffix(".arm"))
            side = None if joint is None else _wrong_side(channel, joint)
            if side and not (key == "outputs" and channel.name.endswith(".arm")):
                yield (key, index, "side"), side
            if joint is None or channel.channel.side == "tool" or channel.problems():
                continue
            message = _wrong_kind(channel, joint)
            if message:
                yield (key, index, "unit"), message


def _wrong_side(channel: LogChannel, joint: JointSection) -> str:
    """Says why a channel cannot be of the side that is stated; those of outputs' names are checked with their names."""
    if channel.name.endswith(".arm") and channel.side not in (None, "arm"):
        return f"`{channel.name}` is the arm side of `{joint.name}`: leave `side` out"
    if channel.side == "motor" and not joint.has_motor:
        return f"`{joint.name}` has no motor (`torque_measured_at: joint`): leave `side` out, all of it is the arm's"
    return ""


def _wrong_kind(channel: LogChannel, joint: JointSection) -> str:
    """Says why a channel's unit is none of its joint; nothing where it is one."""
    unit, name = channel.si_unit, joint.name
    is_arm = channel.channel.side == "arm"
    if unit == "A":
        told = f"`{channel.variable}` is a current, but `{name}` has no motor (`torque_measured_at: joint`)"
        return "" if joint.has_motor else f"{told}: state what its sensor shows, in {_units(_own('N m', joint))}"
    as_arm = joint.slides and is_arm
    # A linear motor's own units are those of what it moves: its ratio is 1, whichever way it goes.
    either = joint.slides and not is_arm and joint.motor is not None and abs(joint.motor.ratio or 0.0) == 1
    if either or unit in (_SLIDES if as_arm else _TURNS):
        return ""
    wanted = _TO_SLIDE[unit] if as_arm else _TO_TURN[unit]
    quantity = {**_TURNS, **_SLIDES}[wanted]
    start = f"`{channel.variable}` is in {channel.unit}{_counted(channel)}, but "
    if not joint.slides:
        return f"{start}`{name}` is revolute: its {quantity} is in {_units(wanted)} (or `side: tool`, measured there)"
    if is_arm:
        return f"{start}`{name}` is prismatic: its arm's {quantity} is in {_units(wanted)}"
    own = f"its motor's {quantity} is in {_units(wanted)}"
    return f"{start}`{name}` is prismatic and its motor turns: {own}; what its slide does is named `{name}.arm`"


def _own(unit: str, joint: JointSection) -> str:
    return _TO_SLIDE[unit] if joint.slides else unit


def _counted(channel: LogChannel) -> str:
    """What one of its counts is of, where it has some."""
    if not channel.unit.startswith("counts"):
        return ""
    return " of a turn" if channel.counts_per_turn is not None else " of a length"


def _units(unit: str) -> str:
    """The units that logs have for an SI unit."""
    names = [name for name, known in UNITS.items() if known.si == unit]
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]
