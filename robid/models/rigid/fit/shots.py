"""Shots: what one recorded motion gives the fit, what is unusable in it, and where it took the arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.errors import DataError
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.rows import Motion, prepare
from robid.models.rigid.fit.solution import Travel
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel
from robid.signals.quantities import Channel, describe
from robid.signals.record import Record, place_words
from robid.simulate.controller import angle_reference

_STILL = 1e-9  # of a turn
_FEWEST = 16  # samples
_SAME_MOTION = 1e6  # condition number
_DRIVES, _POSITIONS = ("torque", "current", "force"), ("angle", "position")


@dataclass(frozen=True)
class Command:
    """What a controller was told to do; motor side."""

    angle: FloatArray  # (n_sample, n_joint): motor angles [rad]
    speed: FloatArray  # (n_sample, n_joint): feed-forward speeds [rad/s]
    periodic: bool  # whether it goes on as it began, from before the first sample on


@dataclass(frozen=True)
class Shot:
    """What one experiment recorded, without a gap; on the motor side, but for joints that have no motor.

    Raises:
        DataError: If a position or a torque is NaN or infinite.
    """

    position: FloatArray  # (n_sample, n_joint): motor angles [rad]
    torque: FloatArray  # (n_sample, n_joint): motor torques, or currents [N m, or A]
    sampling_period_s: float
    held: bool  # whether each torque is a command that is held until the next sample
    command: Command | None = None  # what the controller was told; None where that is unknown
    late_samples: int = 0  # samples by which the command begins before the first position
    loaded: bool = True  # whether a payload with parameters of its own is there
    torque_unit: str = "N m"  # what stands for N m: A where torques are currents
    name: str = ""  # campaign, and which of its experiments it is where there are several

    def __post_init__(self) -> None:
        # Filters and least squares would spread one such sample over all parameters.
        for what, values in (("position", self.position), ("torque", self.torque)):
            bad = np.argwhere(~np.isfinite(values))
            if len(bad):
                sample, joint = bad[0].tolist()
                told = (
                    f"D451 {len(bad)} of {values.size} {what} values are NaN or infinite, the first at sample {sample}"
                )
                remedy = "cut the record to a part without them, or record again"
                raise DataError(f"{told} of joint {joint + 1}", where="record", remedy=remedy)


def shots_of(
    record: Record, robot: Robot, *, late_samples: int = 0, loaded: bool = True, name: str = ""
) -> tuple[Shot, ...]:
    """Cuts a record into shots: one for each experiment, the mean of its periods; torques act `late_samples` later.

    What repeats from period to period beside noise, such as ripple, counts once. Shots are named after the record.

    Raises:
        DataError: If a joint has no channel, or the channels of both sides do not determine all motors.
    """
    joints = tuple(joint.name for joint in robot.joints)
    drives = _chosen(record.input_channels, joints, _DRIVES, "inputs")
    moves = positions_of(record, robot)
    offset = record.output_offset[:, None, None, None, None, moves]
    torque = _motor_torques(record.inputs[..., drives], _arm_sides(record.input_channels, drives), robot)
    position = _motor_positions(record.outputs[..., moves] + offset, _arm_sides(record.output_channels, moves), robot)
    shape = (-1, record.inputs.shape[4], len(joints))
    positions, torques = (array.mean(axis=3).reshape(shape) for array in (position, torque))
    commands = _commands(record, robot) or [None] * len(positions)
    held, end = record.input_hold == "zoh", torques.shape[1] - late_samples
    unit = "A" if record.input_channels[drives[0]].quantity == "current" else "N m"
    period_s, counts = record.sampling_period_s, record.inputs.shape[:3]
    names = [", ".join([*filter(None, [name]), *place_words(place, counts)]) for place in np.ndindex(*counts)]
    return tuple(
        Shot(each[late_samples:], drive[:end], period_s, held, told, late_samples, loaded, unit, own)
        for each, drive, told, own in zip(positions, torques, commands, names, strict=True)
    )


def motion_of(
    shot: Shot, model: RigidModel, filters: PreprocessingOptions, instrument: FloatArray | None = None
) -> Motion:
    """Returns a shot as the rows of a model are made of it, with the positions (n_sample, n_joint) of an instrument.

    Raises:
        ValueError: If it is too short for the filters.
    """
    return prepare(
        shot.position,
        shot.torque,
        shot.sampling_period_s,
        filters,
        instrument=instrument,
        held=shot.held,
        load_dependent=model.needs_torque,
        loaded=shot.loaded,
        dry=any("coulomb" in kind for kind in model.kinds),
    )


def positions_of(record: Record, robot: Robot) -> list[int]:
    """Returns which outputs are the joints' positions (n_joint).

    Raises:
        DataError: If a joint has none.
    """
    return _chosen(record.output_channels, tuple(joint.name for joint in robot.joints), _POSITIONS, "outputs")


def without_gears(robot: Robot, record: Record) -> Robot:
    """Returns the robot without its doubts of gear ratios where a record has angle and torque of the joint itself.

    What its links are does not depend on them then.
    """
    both = (record.input_channels, record.output_channels)
    arms = [{one.name.removesuffix(".arm") for one in channels if one.side == "arm"} for channels in both]
    known = {f"{name}.motor.gear_ratio" for name in set.intersection(*arms)}
    doubted = [name for name in robot.assumed if name not in known]
    return replace(robot, assumed=tuple(doubted))


def refuse_unusable(robot: Robot, shots: Sequence[Shot]) -> None:
    """Refuses motors that never move, torques that never change, and records that are not sampled or scaled alike.

    Raises:
        DataError: If there are such.
    """
    rates = sorted({round(1 / shot.sampling_period_s, 6) for shot in shots})
    units = sorted({shot.torque_unit for shot in shots})
    if len(rates) > 1 or len(units) > 1:
        what = f"sampled at {rates[0]:g} and {rates[-1]:g} Hz" if len(rates) > 1 else f"in {' and in '.join(units)}"
        message = f"D186 the records of one fit are {what}"
        raise DataError(message, where="record", remedy="fit them one by one, or log them alike")
    shortest = min(len(shot.position) for shot in shots)
    if shortest < _FEWEST:
        message = f"D600 a record has {shortest} samples, fewer than the {_FEWEST} that any filter needs"
        raise DataError(message, where="record", remedy="record longer, or leave this record out")
    names = [joint.name for joint in robot.joints]
    still = _constant(names, [shot.position for shot in shots], 2 * np.pi * _STILL)
    if still:
        message = f"D187 {', '.join(still)} never move{'s' if len(still) == 1 else ''}: nothing can be identified there"
        raise DataError(message, where="record", remedy="move all joints at the same time")
    dead = _constant(names, [shot.torque for shot in shots], 0.0)
    if dead:
        message = f"D188 the torques of {', '.join(dead)} never change although their joints move"
        raise DataError(
            message, where="record", remedy="check that these channels were connected and are the right ones"
        )


def _constant(names: Sequence[str], signals: Sequence[FloatArray], rounding: float) -> list[str]:
    """Names of the joints whose signals (n_sample, n_joint) stay the same in every shot."""
    change = np.max([np.ptp(signal, axis=0) for signal in signals], axis=0)
    return [name for name, size in zip(names, change.tolist(), strict=True) if size <= rounding]


def _chosen(channels: Sequence[Channel], names: Sequence[str], quantities: Sequence[str], what: str) -> list[int]:
    found: dict[str, int] = {}
    for index, channel in enumerate(channels):
        joint = channel.name.removesuffix(".arm")
        if channel.quantity in quantities and channel.side != "tool" and joint in names:
            found.setdefault(joint, index)
    missing = [name for name in names if name not in found]
    if missing:
        wanted = " or ".join(quantities)
        message = f"D189 a rigid fit needs a {wanted} of every joint, but the record's {what} are {describe(channels)}"
        raise DataError(message, remedy=f"record {', '.join(missing)} too, or take another campaign")
    return [found[name] for name in names]


def _arm_sides(channels: Sequence[Channel], chosen: Sequence[int]) -> BoolArray:
    """Which of the chosen channels (n_joint,) are of the arm side."""
    return np.array([channels[index].side == "arm" for index in chosen], bool)


def _motor_positions(position: FloatArray, arm: BoolArray, robot: Robot) -> FloatArray:
    """Motor angles (..., n_joint) of positions that are measured on either side, joint by joint."""
    if arm.all():
        return position @ robot.motor_per_arm.T
    if not (arm & robot.has_motors).any():
        return position
    # What is measured is S angle: a row of the gears where it is the arm's, the motor itself elsewhere.
    measured = np.where(arm[:, None], robot.arm_per_motor, np.eye(len(arm)))
    return position @ _inverse(measured, robot, arm).T


def _motor_torques(torque: FloatArray, arm: BoolArray, robot: Robot) -> FloatArray:
    """Motor torques (..., n_joint) of torques that are known on either side, joint by joint."""
    if arm.all():
        return torque @ robot.arm_per_motor
    if not (arm & robot.has_motors).any():
        return torque
    # Motors do the work of the arm: their torques are A^T arm torques, with A the gears.
    measured = np.where(arm[:, None], np.eye(len(arm)), robot.arm_per_motor.T)
    return np.asarray(torque @ _inverse(measured, robot, arm).T @ robot.arm_per_motor)


def _inverse(measured: FloatArray, robot: Robot, arm: BoolArray) -> FloatArray:
    """Inverse (n_joint, n_joint) of what is measured per motor or arm, rows scaled to 1."""
    size = np.linalg.norm(measured, axis=1)
    scaled = measured / size[:, None]
    if np.linalg.cond(scaled) > _SAME_MOTION:
        named = ", ".join(joint.name for joint, is_arm in zip(robot.joints, arm, strict=True) if is_arm)
        message = f"D190 motors and arms ({named}) of coupled joints are mixed so that some motion is measured twice"
        raise DataError(
            message, where="record", remedy="log coupled joints all on the motor side or all on the arm side"
        )
    return np.asarray(np.linalg.inv(scaled) / size)


def _commands(record: Record, robot: Robot) -> list[Command | None]:
    """What the controller was told in each experiment, relative to where its configuration rests; none if unknown."""
    channels, names = record.reference_channels, [joint.name for joint in robot.joints]
    told = {channel.name: index for index, channel in enumerate(channels)}
    quantities = {channel.quantity for channel in channels if channel.side == "motor"}
    if record.reference is None or record.configurations is None or not set(names) <= set(told):
        return []
    reference = record.reference[..., [told[name] for name in names]]
    rest = (record.configurations @ robot.motor_per_arm.T)[:, None, None, None]
    if quantities == {"speed_reference"}:
        angle, speed = angle_reference(reference, record.sampling_period_s), reference
    elif quantities == {"position_command"}:
        angle, speed = reference, np.zeros_like(reference)
    else:
        return []
    shape = (-1, *reference.shape[3:])
    pairs = zip((angle + rest).reshape(shape), speed.reshape(shape), strict=True)
    return [Command(*pair, periodic=not record.is_one_shot) for pair in pairs]


_MOMENTS = 64  # of each shot
_SPEED_OVER_S = 0.02
_SAME = 0.02  # of a joint's range of motion
_ENOUGH = 0.5  # of the moments, and of each joint's range among them


def travel_of(robot: Robot, shots: Sequence[Shot]) -> Travel:
    """Returns where the arm of a robot was during some shots, at moments evenly spread over each."""
    turns = robot.arm_per_motor.T
    index = [np.linspace(0, len(shot.position) - 1, _MOMENTS).round().astype(int) for shot in shots]
    courses = [shot.position @ turns for shot in shots]
    pairs = list(zip(courses, shots, strict=True))
    extremes = np.array([np.stack([course.min(axis=0), course.max(axis=0)], axis=1) for course in courses])
    return Travel(
        shot=np.repeat(np.arange(len(shots)), _MOMENTS),
        time_s=np.concatenate([own * shot.sampling_period_s for own, shot in zip(index, shots, strict=True)]),
        position=np.concatenate([shot.position[own] @ turns for own, shot in zip(index, shots, strict=True)]),
        lowest=extremes[..., 0].min(axis=0),
        highest=extremes[..., 1].max(axis=0),
        fastest=np.max([_fastest(course, shot.sampling_period_s) for course, shot in pairs], axis=0),
        lower_limit=robot.lower,
        upper_limit=robot.upper,
    )


def _fastest(course: FloatArray, sampling_period_s: float) -> FloatArray:
    """Highest speeds (n_joint,) of a course, over some time so that the encoder's noise counts for nothing."""
    step = min(max(1, round(_SPEED_OVER_S / sampling_period_s)), len(course) - 1)
    return np.asarray(np.abs(course[step:] - course[:-step]).max(axis=0) / (step * sampling_period_s))


def repeats(travel: Travel, robot: Robot, shot: Shot) -> bool:
    """Whether a shot moves the arm as one of those did before, sooner or later in its course.

    At some delay, half of the moments of the earlier shot, or of those that a shorter one has room for, lie in the shot
    with all positions within 2 % of the range, and half of the earlier shot's range of motion among them.
    """
    position = shot.position @ robot.arm_per_motor.T
    reach = np.maximum(travel.highest - travel.lowest, 1e-12)
    for one in np.unique(travel.shot):
        own = travel.shot == one
        steps = np.round((travel.time_s[own] - travel.time_s[own][0]) / shot.sampling_period_s).astype(int)
        if _found(travel.position[own] / reach, steps, position / reach):
            return True
    return False


def _found(moments: FloatArray, steps: IntArray, course: FloatArray) -> bool:
    """Whether moments (n_moment, n_joint), so many steps after each other, are in a course (n_sample, n_joint)."""
    n_sample = len(course)
    delay = np.arange(-steps[-1], n_sample)
    first, last = np.searchsorted(steps, -delay), np.searchsorted(steps, n_sample - delay)
    possible = last - first >= _ENOUGH * np.count_nonzero(steps < n_sample)
    delay, first, last = delay[possible], first[possible], last[possible]
    for index, (moment, step) in enumerate(zip(moments, steps, strict=True)):
        inside = (first <= index) & (index < last)
        there = course[np.clip(step + delay, 0, n_sample - 1)]
        near = ~inside | (np.abs(there - moment).max(axis=1) < _SAME)
        delay, first, last = delay[near], first[near], last[near]
    wanted = _ENOUGH * np.ptp(moments, axis=0)
    spans = (np.ptp(moments[one:other], axis=0) for one, other in zip(first, last, strict=True))
    return any(np.all(span >= wanted) for span in spans)
