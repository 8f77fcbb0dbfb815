"""Recorded motions with encoders on both sides: what of a record a fit of gears reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.signals.quantities import Channel, describe
from robid.signals.record import Record, place_words

_FEWEST = 64  # samples


@dataclass(frozen=True)
class Motion:
    """One uninterrupted motion."""

    name: str  # Campaign, and which of its experiments it is where there are several
    sampling_period_s: float
    motor: FloatArray  # (n_sample, n_joint) Angles of all motors [rad]
    arm: FloatArray  # (n_sample, n_gear) Angles of the arms that have an encoder of their own [rad, or m]
    torque: FloatArray  # (n_sample, n_joint) Motor torques, mean about each sample [N m]
    gears: tuple[int, ...]  # Index of the joint of each arm


def motions_of(record: Record, robot: Robot, *, late_samples: int = 0, name: str = "") -> tuple[Motion, ...]:
    """Cuts a record into motions: one for each experiment, the mean of its periods.

    Args:
        record: Angles of all motors and of some arms, and the motors' torques.
        robot: Its robot.
        late_samples: Samples by which torques act after they are recorded.
        name: Name of the motions.

    Raises:
        DataError: If angles of both sides or torques are missing, are too few, or are not finite.
    """
    joints = [joint.name for joint in robot.joints]
    outside = record.output_channels
    motors, arms = (_columns(outside, joints, side, ("angle", "position")) for side in ("motor", "arm"))
    drives = _columns(record.input_channels, joints, "motor", ("torque",))
    gears = [index for index, joint in enumerate(joints) if joint in arms and robot.joints[index].has_motor]
    _refuse_missing(record, joints, motors, drives, gears)
    outputs = record.output_offset[:, None, None, None, None] + record.outputs
    shape = (-1, record.inputs.shape[4])
    motor, arm = (
        outputs[..., chosen].mean(axis=3).reshape(*shape, len(chosen))
        for chosen in ([motors[joint] for joint in joints], [arms[joints[gear]] for gear in gears])
    )
    torque = record.inputs[..., [drives[joint] for joint in joints]].mean(axis=3).reshape(*shape, len(joints))
    counts = record.inputs.shape[:3]
    names = [", ".join([*filter(None, [name]), *place_words(place, counts)]) for place in np.ndindex(*counts)]
    held, end = record.input_hold == "zoh", torque.shape[1] - late_samples
    return tuple(
        _checked(
            Motion(
                told,
                record.sampling_period_s,
                own[late_samples:],
                far[late_samples:],
                _centred(drive[:end], held=held),
                tuple(gears),
            )
        )
        for told, own, far, drive in zip(names, motor, arm, torque, strict=True)
    )


def _centred(torque: FloatArray, *, held: bool) -> FloatArray:
    """Mean torques (n_sample, n_joint) about each sample: of commands that are kept for a sample, half of either."""
    return np.asarray(0.5 * (torque + np.concatenate([torque[:1], torque[:-1]]))) if held else torque


def _columns(
    channels: Sequence[Channel], joints: Sequence[str], side: str, quantities: Sequence[str]
) -> dict[str, int]:
    found: dict[str, int] = {}
    for index, channel in enumerate(channels):
        joint = channel.name.removesuffix(".arm")
        if channel.side == side and channel.quantity in quantities and joint in joints:
            found.setdefault(joint, index)
    return found


def _refuse_missing(
    record: Record, joints: Sequence[str], motors: dict[str, int], drives: dict[str, int], gears: Sequence[int]
) -> None:
    if not gears:
        message = (
            "D670 a fit of gears needs the angle of a motor and of its arm, but the record's outputs are "
            f"{describe(record.output_channels)}"
        )
        remedy = "record the link encoders too, as `<joint>.arm` with `side: arm`"
        raise DataError(message, where="record", remedy=remedy)
    for what, known in (("angle", motors), ("torque", drives)):
        missing = [joint for joint in joints if joint not in known]
        if missing:
            message = (
                f"D671 a fit of gears needs the motor {what} of every joint; {', '.join(missing)} have none in N m"
            )
            message = message if what == "torque" else message.removesuffix(" in N m")
            remedy = "record them too: what loads a gear depends on the motion of the whole arm"
            raise DataError(message, where="record", remedy=remedy)


def _checked(motion: Motion) -> Motion:
    if len(motion.motor) < _FEWEST:
        message = f"D672 a record has {len(motion.motor)} samples, fewer than the {_FEWEST} that any filter needs"
        raise DataError(message, where="record", remedy="record longer, or leave this record out")
    for what, values in (("motor angle", motion.motor), ("arm angle", motion.arm), ("torque", motion.torque)):
        if not np.isfinite(values).all():
            bad = np.argwhere(~np.isfinite(values))
            message = f"D673 {len(bad)} {what} values are NaN or infinite, the first at sample {int(bad[0, 0])}"
            raise DataError(message, where="record", remedy="cut the record to a part without them, or record again")
    return motion
