"""Uninterrupted stretches of records as motor angles and motor torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.signals.quantities import Channel, Side, describe
from robid.signals.record import Record
from robid.simulate.controller import angle_reference

_STILL = 1e-9  # of a turn
_DRIVES, _POSITIONS = ("torque", "current", "force"), ("angle", "position")


@dataclass(frozen=True)
class Command:
    """What a controller was told to do; motor side.

    Attributes:
        angle (n_sample, n_joint): Motor angles [rad].
        speed (n_sample, n_joint): Feed-forward speeds [rad/s].
        periodic: Whether it goes on as it began, from before the first sample on.
    """

    angle: FloatArray
    speed: FloatArray
    periodic: bool


@dataclass(frozen=True)
class Shot:
    """What one experiment recorded, without a gap; everything on the motor side.

    Attributes:
        position (n_sample, n_joint): Motor angles [rad].
        torque (n_sample, n_joint): Motor torques, or currents [N m, or A].
        sampling_period_s: Sampling period [s].
        held: Whether each torque is a command that is held until the next sample.
        command: What the controller was told; None where that is unknown.
        late_samples: Samples by which the command begins before the first position.
        loaded: Whether a payload with parameters of its own is there.
        torque_unit: What stands for N m: A where torques are currents.
    """

    position: FloatArray
    torque: FloatArray
    sampling_period_s: float
    held: bool
    command: Command | None = None
    late_samples: int = 0
    loaded: bool = True
    torque_unit: str = "N m"


def shots_of(record: Record, robot: Robot, *, late_samples: int = 0, loaded: bool = True) -> tuple[Shot, ...]:
    """Cuts a record into shots: one for each experiment, the mean of its periods.

    What repeats from period to period beside noise, such as ripple, counts once.

    Args:
        record: The record.
        robot: The robot, by whose joints' names channels are chosen.
        late_samples: Samples from a recorded torque to the one that is applied.
        loaded: Whether a payload with parameters of its own was there.

    Raises:
        DataError: If a joint has no channel, or channels of both sides.
    """
    names = tuple(joint.name for joint in robot.joints)
    drives, drive_side = _chosen(record.input_channels, names, _DRIVES, "inputs")
    moves, move_side = positions_of(record, robot)
    torque, offset = record.inputs[..., drives], record.output_offset[:, None, None, None, None, moves]
    position = record.outputs[..., moves] + offset
    if drive_side == "arm":
        torque = torque @ robot.arm_per_motor
    if move_side == "arm":
        position = position @ robot.motor_per_arm.T
    shape = (-1, record.inputs.shape[4], len(names))
    positions, torques = (array.mean(axis=3).reshape(shape) for array in (position, torque))
    commands = _commands(record, robot) or [None] * len(positions)
    held, end = record.input_hold == "zoh", torques.shape[1] - late_samples
    unit = "A" if record.input_channels[drives[0]].quantity == "current" else "N m"
    period_s = record.sampling_period_s
    return tuple(
        Shot(each[late_samples:], drive[:end], period_s, held, told, late_samples, loaded, unit)
        for each, drive, told in zip(positions, torques, commands, strict=True)
    )


def positions_of(record: Record, robot: Robot) -> tuple[list[int], Side]:
    """Returns which outputs are the joints' positions (n_joint), and their side.

    Raises:
        DataError: If a joint has none, or they are of both sides.
    """
    return _chosen(record.output_channels, tuple(joint.name for joint in robot.joints), _POSITIONS, "outputs")


def refuse_unusable(robot: Robot, shots: Sequence[Shot]) -> None:
    """Refuses motors that never move, torques that never change, and records that are not sampled or scaled alike.

    Raises:
        DataError: If there are such.
    """
    rates = sorted({round(1 / shot.sampling_period_s, 6) for shot in shots})
    units = sorted({shot.torque_unit for shot in shots})
    if len(rates) > 1 or len(units) > 1:
        what = f"sampled at {rates[0]:g} and {rates[-1]:g} Hz" if len(rates) > 1 else f"in {' and in '.join(units)}"
        message = f"the records of one fit are {what}"
        raise DataError(message, where="record", remedy="fit them one by one, or log them alike")
    names = [joint.name for joint in robot.joints]
    still = _constant(names, [shot.position for shot in shots], 2 * np.pi * _STILL)
    if still:
        message = f"the motors of {', '.join(still)} never move: nothing of them can be identified"
        raise DataError(message, where="record", remedy="move all joints at the same time")
    dead = _constant(names, [shot.torque for shot in shots], 0.0)
    if dead:
        message = f"the torques of {', '.join(dead)} never change although their motors move"
        raise DataError(
            message, where="record", remedy="check that these channels were connected and are the right ones"
        )


def _constant(names: Sequence[str], signals: Sequence[FloatArray], rounding: float) -> list[str]:
    """Names of the joints whose signals (n_sample, n_joint) stay the same in every shot."""
    change = np.max([np.ptp(signal, axis=0) for signal in signals], axis=0)
    return [name for name, size in zip(names, change.tolist(), strict=True) if size <= rounding]


def _chosen(
    channels: Sequence[Channel], names: Sequence[str], quantities: Sequence[str], what: str
) -> tuple[list[int], Side]:
    """Indices of the joints' channels, and the side that all of them are of."""
    found: dict[str, int] = {}
    for index, channel in enumerate(channels):
        joint = channel.name.removesuffix(".arm")
        if channel.quantity in quantities and channel.side != "tool" and joint in names:
            found.setdefault(joint, index)
    missing = [name for name in names if name not in found]
    if missing:
        wanted = " or ".join(quantities)
        message = f"a rigid fit needs a {wanted} of every joint, but the record's {what} are {describe(channels)}"
        raise DataError(message, remedy=f"record {', '.join(missing)} too, or take another campaign")
    chosen = [found[name] for name in names]
    sides = sorted({channels[index].side for index in chosen})
    if len(sides) > 1:
        message = f"the record's {what} are of both sides: {describe([channels[index] for index in chosen])}"
        raise DataError(message, remedy="log all of them on the motor side or all on the arm side")
    return chosen, sides[0]


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
