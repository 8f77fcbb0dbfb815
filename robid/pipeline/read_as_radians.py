"""Whether a log's angles show that configurations in degrees were written in radians."""

from __future__ import annotations

import numpy as np

from robid.settings.robot import RobotFile
from robid.signals.record import Record

_TOLD_RAD = 0.3
_NEAR_RAD = 0.02
_NEARER = 0.1
_NOTE = "The log's angles are those of the configuration"


def radians_note(record: Record, robot: RobotFile) -> tuple[str, ...]:
    """Returns a note where the angles of a record are its configuration's numbers, read as radians.

    Asked are all joints that turn and whose numbers would be far apart; logs whose angles count from elsewhere say
    nothing.

    Args:
        record: The record of one configuration.
        robot: The robot file.
    """
    if record.configurations is None:
        return ()
    angles = _arm_angles(record, robot)
    told = {
        index: float(np.rad2deg(rest))
        for index, rest in enumerate(record.configurations[0].tolist())
        if not robot.joints[index].slides and _TOLD_RAD < abs(np.rad2deg(rest)) <= 2 * np.pi
    }
    if not told or any(index not in angles for index in told):
        return ()
    for index, written in told.items():
        off = abs(angles[index] - written)
        if off > _NEAR_RAD or off > _NEARER * abs(angles[index] - np.deg2rad(written)):
            return ()
    index, written = next(iter(told.items()))
    return (
        f"{_NOTE}, were it in radians: {robot.joints[index].name} is at {angles[index]:.4g} rad,"
        f" {np.rad2deg(angles[index]):.4g} deg, and the file says {written:.4g} deg; are these radians?",
    )


def is_radians_note(note: str) -> bool:
    """Whether a note of a record says that its configurations look like radians."""
    return note.startswith(_NOTE)


def _arm_angles(record: Record, robot: RobotFile) -> dict[int, float]:
    """Mean angle of each joint that a channel tells alone, by the joint's index [rad]."""
    mean = record.outputs.mean(axis=(0, 1, 2, 3, 4)) + record.output_offset[0]
    found: dict[int, float] = {}
    for index, joint in enumerate(robot.joints):
        ratio = None if joint.motor is None or joint.couplings else joint.motor.ratio
        for place, channel in enumerate(record.output_channels):
            if channel.quantity != "angle":
                continue
            if channel.name == f"{joint.name}.arm":
                found[index] = float(mean[place])
            elif channel.name == joint.name and channel.side == "motor" and ratio:
                found.setdefault(index, float(mean[place] / ratio))
    return found
