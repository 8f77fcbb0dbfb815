"""What a record reached of the motors' limits: speed, torque and arm position, peaks and RMS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robid.arrays import BoolArray, FloatArray
from robid.robot.description import Robot
from robid.signals.record import Record

_POINTS = 300  # of a motor's plane of speed and torque
_DIRECTIONS = 4  # in which the farthest points are looked for, to both sides
_FEWEST = 3  # points of a hull


@dataclass(frozen=True)
class Reached:
    """What some experiments reached, motor by motor; NaN where the record does not show it."""

    speed_peak: FloatArray  # (n_joint,): largest magnitude of the motor speed [rad/s]
    speed_rms: FloatArray  # (n_joint,): its RMS in the experiment where that is largest [rad/s]
    torque_peak: FloatArray  # (n_joint,): largest magnitude of the motor torque [N m]
    torque_rms: FloatArray  # (n_joint,): its RMS in the experiment where that is largest [N m]
    lowest: FloatArray  # (n_joint,): lowest arm position [rad, or m]
    highest: FloatArray  # (n_joint,): highest one
    # Of each joint, corners (n_corner, 2) of the convex hull of motor speed and torque, and some points (n_point, 2).
    hulls: tuple[FloatArray, ...]
    points: tuple[FloatArray, ...]


def reached_in(record: Record, robot: Robot) -> Reached | None:
    """Returns what a record reached; None where it shows neither all motors' angles nor all their speeds.

    Speeds that are not measured are central differences of the angles. Torques are those of the record, which may be
    commands; currents whose constant is unknown are none.
    """
    angle, speed = _motor_angles(record, robot), _of(record, robot, "speed")
    if speed is None and angle is not None:
        speed = np.gradient(angle, record.sampling_period_s, axis=1)
    if speed is None:
        return None
    unknown = np.full((1, 1, len(robot.joints)), np.nan)
    torque = _motor_torques(record, robot)
    arm = unknown if angle is None else angle @ robot.arm_per_motor.T
    beside = np.broadcast_to(unknown, speed.shape) if torque is None else torque
    columns = [(speed[..., joint].ravel(), beside[..., joint].ravel()) for joint in range(len(robot.joints))]
    return Reached(
        *_sizes(speed),
        *_sizes(unknown if torque is None else torque),
        lowest=arm.min(axis=(0, 1)),
        highest=arm.max(axis=(0, 1)),
        hulls=tuple(hull_of(*each) for each in columns),
        points=tuple(np.stack([x[:: _step(x)], y[:: _step(y)]], axis=1) for x, y in columns),
    )


def _step(values: FloatArray) -> int:
    """Every how many of the values (n_point,) is kept to have few."""
    return max(1, -(-len(values) // _POINTS))


def reached_in_all(every: Sequence[Reached]) -> Reached:
    """Returns what several records reached together."""

    def most(name: str) -> FloatArray:
        return np.asarray(np.max([getattr(one, name) for one in every], axis=0))

    joints = range(len(every[0].hulls))
    points = [np.concatenate([one.points[joint] for one in every]) for joint in joints]
    return Reached(
        speed_peak=most("speed_peak"),
        speed_rms=most("speed_rms"),
        torque_peak=most("torque_peak"),
        torque_rms=most("torque_rms"),
        lowest=np.min([one.lowest for one in every], axis=0),
        highest=most("highest"),
        hulls=tuple(hull_of(*np.concatenate([one.hulls[joint] for one in every]).T) for joint in joints),
        points=tuple(each[:: _step(each)] for each in points),
    )


def hull_of(x: FloatArray, y: FloatArray) -> FloatArray:
    """Returns the corners (n_corner, 2) of the convex hull of points (n_point,), in order; none without an area."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) < _FEWEST or not min(np.ptp(x), np.ptp(y)) > 0:
        return np.zeros((0, 2))
    outer = _outside(x, y)
    x, y = x[outer], y[outer]
    try:
        # Both axes have one size, so that a small torque beside a large speed is no line.
        corners = ConvexHull(np.stack([x / np.ptp(x), y / np.ptp(y)], axis=1)).vertices
    except QhullError:
        return np.zeros((0, 2))
    return np.stack([x[corners], y[corners]], axis=1)


def _outside(x: FloatArray, y: FloatArray) -> BoolArray:
    """Which points (n_point,) may be corners of the hull: those not inside the polygon of the farthest ones.

    Source:
        Akl and Toussaint (1978), A fast convex hull algorithm.
    """
    wide, high = np.ptp(x), np.ptp(y)
    angles = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    ends = [(s.argmax(), s.argmin()) for a in angles for s in [np.cos(a) / wide * x + np.sin(a) / high * y]]
    corners = [int(end) for side in zip(*ends, strict=True) for end in side]
    outside = np.zeros(x.shape, bool)
    for here, there in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (x[here], y[here]) != (x[there], y[there]):
            # Left of an edge is inside, going round against the clock.
            along, up = x[there] - x[here], y[there] - y[here]
            outside |= along * (y - y[here]) - up * (x - x[here]) <= 0
    return outside


def _sizes(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Peak and largest RMS (n_joint,) of signals (n_experiment, n_sample, n_joint)."""
    return np.abs(values).max(axis=(0, 1)), np.sqrt(np.mean(values**2, axis=1)).max(axis=0)


def _motor_angles(record: Record, robot: Robot) -> FloatArray | None:
    """Motor angles (n_experiment, n_sample, n_joint), measured on the motor side or all on the arm side [rad]."""
    found = _of(record, robot, "angle", "position")
    if found is not None:
        return found
    arm = _of(record, robot, "angle", "position", arm=True)
    return None if arm is None else np.asarray(arm @ robot.motor_per_arm.T)


def _motor_torques(record: Record, robot: Robot) -> FloatArray | None:
    """Motor torques (n_experiment, n_sample, n_joint), known on the motor side or all on the arm side [N m]."""
    found = _of(record, robot, "torque")
    if found is not None:
        return found
    arm = _of(record, robot, "torque", "force", arm=True)
    return None if arm is None else np.asarray(arm @ robot.arm_per_motor)


def _of(record: Record, robot: Robot, *quantities: str, arm: bool = False) -> FloatArray | None:
    """Samples (n_experiment, n_sample, n_joint) of a quantity of every joint; None if one lacks it."""
    side, end = ("arm", ".arm") if arm else ("motor", "")
    offset = np.broadcast_to(record.output_offset[:, None, None, None, None], record.outputs.shape)
    sources = ((record.input_channels, record.inputs, None), (record.output_channels, record.outputs, offset))
    for channels, samples, beside in sources:
        places = {
            channel.name.removesuffix(end): index
            for index, channel in reversed([*enumerate(channels)])
            if channel.side == side and channel.quantity in quantities
        }
        if all(joint.name in places for joint in robot.joints):
            chosen = [places[joint.name] for joint in robot.joints]
            found = samples[..., chosen] if beside is None else samples[..., chosen] + beside[..., chosen]
            return np.asarray(found.reshape(-1, record.inputs.shape[3] * record.inputs.shape[4], len(chosen)))
    return None
