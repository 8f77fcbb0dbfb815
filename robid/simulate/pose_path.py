"""What pose commands tell the joints: delay and moving average of the interface, then inverse kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.robot.kinematics import ToolArm, reach_poses
from robid.signals.pose import POSE, displacement
from robid.simulate.options import PoseInterface


@dataclass(frozen=True)
class PosePath:
    """Joint motion that commands ask for."""

    positions: FloatArray  # (..., n_sample, n_joint) Arm-side joint positions [rad, or m]
    share: FloatArray  # (..., n_sample) Share of the way from home to each pose that was found; 1 where it is reached
    loose: BoolArray  # (n_joint,) Joints that move the tool against each other without effect where the way ends


def followed(commands: FloatArray, interface: PoseInterface) -> FloatArray:
    """Returns commands as the inverse kinematics gets them: late by the delay, and averaged.

    Args:
        commands (..., n_sample, n_channel): Commands from rest; before them were zeros [m, rad].
        interface: Delay and moving average.
    """
    history = interface.delay_samples + interface.moving_average - 1
    before = [(0, 0)] * (commands.ndim - 2) + [(history, 0), (0, 0)]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(commands, before), interface.moving_average, axis=-2)
    return np.asarray(windows[..., : commands.shape[-2], :, :].mean(axis=-1))


def joint_path(arm: ToolArm, channels: tuple[str, ...], configuration: FloatArray, commands: FloatArray) -> PosePath:
    """Finds the joint positions that commands ask for.

    Args:
        arm: The rigid arm.
        channels: Names of the commands, of those of the arm.
        configuration (n_joint,): Home, arm side [rad, or m].
        commands (..., n_sample, n_channel): Displacements from home along the tool's axes there [m, rad].
    """
    pose, external = _columns(arm, channels)
    home = configuration[arm.external :]
    displaced = np.zeros((*commands.shape[:-1], len(POSE)))
    displaced[..., list(pose)] = commands[..., list(pose.values())]
    reached = reach_poses(arm, home, displaced.reshape(-1, len(POSE)))
    positions = np.broadcast_to(configuration, (*commands.shape[:-1], configuration.size)).copy()
    positions[..., list(external)] += commands[..., list(external.values())]
    positions[..., arm.external :] = reached.positions.reshape(*commands.shape[:-1], home.size)
    loose = np.concatenate([np.zeros(arm.external, bool), reached.loose])
    return PosePath(positions, reached.share.reshape(commands.shape[:-1]), loose)


def channel_motion(
    arm: ToolArm, channels: tuple[str, ...], configuration: FloatArray, positions: FloatArray
) -> FloatArray:
    """Displacements (..., n_sample, n_channel) that joint positions make; the inverse of `joint_path` [m, rad].

    Args:
        arm: The rigid arm.
        channels: Names of the channels, of those of the arm.
        configuration (n_joint,): Home, arm side [rad, or m].
        positions (..., n_sample, n_joint): Arm-side joint positions [rad, or m].
    """
    pose, external = _columns(arm, channels)
    home = arm.poses(configuration[arm.external :])
    displaced = displacement(*home, *arm.poses(positions[..., arm.external :]))
    found = np.empty((*positions.shape[:-1], len(channels)))
    found[..., list(pose.values())] = displaced[..., list(pose)]
    found[..., list(external.values())] = (positions - configuration)[..., list(external)]
    return found


def channel_matrix(arm: ToolArm, channels: tuple[str, ...], configuration: FloatArray) -> FloatArray:
    """Returns how small joint motions move the channels (n_channel, n_joint) at home."""
    pose, external = _columns(arm, channels)
    moves = np.zeros((len(channels), configuration.size))
    moves[list(pose.values()), arm.external :] = arm.in_home(configuration[arm.external :])[list(pose)]
    moves[list(external.values()), list(external)] = 1.0
    return moves


def command_matrix(arm: ToolArm, channels: tuple[str, ...], configuration: FloatArray) -> FloatArray:
    """Returns what small commands tell the joints (n_joint, n_channel) at home."""
    pose, external = _columns(arm, channels)
    moves = np.zeros((configuration.size, len(channels)))
    moves[arm.external :, list(pose.values())] = np.linalg.pinv(arm.in_home(configuration[arm.external :]))[
        :, list(pose)
    ]
    moves[list(external), list(external.values())] = 1.0
    return moves


def _columns(arm: ToolArm, channels: tuple[str, ...]) -> tuple[dict[int, int], dict[int, int]]:
    """Column of each channel, by its place in a displacement, and by the external axis that it moves."""
    own = arm.channels[3 : 3 + arm.external]
    pose = {POSE.index(name): column for column, name in enumerate(channels) if name in POSE}
    return pose, {own.index(name): column for column, name in enumerate(channels) if name in own}
