"""The design of pose chirps: commands of one channel after the other, and what they will ask of the motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.excitation import Excitation, ExcitationPlan
from robid.design.excitation.options import PoseChirpOptions
from robid.design.excitation.pose.limits import admissible, check_poses, pose_limits, used
from robid.design.excitation.pose.motion import PoseMotion, PoseRobot, pose_motion
from robid.design.excitation.signal_lines import check_signal, pose_chirp, signal_lines
from robid.robot.reach import Reach
from robid.signals.pose import pose_command_channels


def design_pose_chirp(
    options: PoseChirpOptions,
    channels: tuple[str, ...],
    robot: PoseRobot,
    configurations: FloatArray,
    realizations: int,
    reach: Reach,
    *,
    periods: int = 1,
    transient_periods: int = 0,
) -> Excitation:
    """Designs a chirp of each channel and holds it against the robot's limits.

    Args:
        options: Band, amplitudes and period.
        channels: Names of the channels, one experiment each.
        robot: The nominal robot.
        configurations (n_conf, n_joint): Homes, arm side [rad, or m].
        realizations: How often all of it is played.
        reach: Floor and shapes.
        periods: Recorded periods of each experiment.
        transient_periods: Periods before those.

    Returns:
        The commands in place of motor references, with their plan.

    Raises:
        SettingsError: If the chirp cannot be made, or with everything that keeps the robot from following it.

    Source:
        Oliveira et al. (2019), eq. 2 and Table 1.
    """
    period_s = robot.interface.sampling_period_s
    check_signal(options, period_s)
    signal = pose_chirp(options, period_s)
    amplitude = np.array([options.amplitude(channel) or 0.0 for channel in channels])
    commands = np.einsum("en,s->esn", np.diag(amplitude), signal)
    motions = [pose_motion(robot, channels, home, commands) for home in configurations]
    check_poses(robot.arm.robot, channels, configurations, motions, commands, reach)
    lines, _ = signal_lines(options, period_s)
    reference = np.broadcast_to(commands, (realizations, *commands.shape)).copy()
    rms = amplitude * np.sqrt(np.mean(signal**2))
    crest = np.abs(signal).max() / np.sqrt(np.mean(signal**2)) * np.eye(len(channels))
    duration_s = float(reference[..., 0, 0].size * len(configurations) * (periods + transient_periods))
    return Excitation(
        reference=reference,
        kind=options.inject,
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        sampling_period_s=period_s,
        spectrum=np.fft.rfft(reference, axis=2)[:, :, lines] * (2 / len(signal)),
        rms=rms,
        crest_factor=np.broadcast_to(crest, (realizations, *crest.shape)).copy(),
        plan=_plan(robot, configurations, motions, duration_s * options.period_s),
        channels=pose_command_channels(channels),
    )


def _plan(
    robot: PoseRobot, configurations: FloatArray, motions: Sequence[PoseMotion], duration_s: float
) -> ExcitationPlan:
    """What the motors do at most over all channels; excursions are distances from the middle of a joint's range."""
    limits = pose_limits(robot.arm.robot)
    reached = [used(motion, limits) for motion in motions]
    least = np.stack([each.min(axis=1) for each, _ in reached], axis=1)
    most = np.stack([each.max(axis=1) for _, each in reached], axis=1)
    offset = np.zeros_like(least)
    offset[1] = [motion.static for motion in motions]
    offset[2] = configurations - limits.middle
    rms = np.stack([_rms(motion, limits.middle) for motion in motions], axis=1)
    peak, whole = np.maximum(np.abs(most), np.abs(least)), limits.whole
    return ExcitationPlan(
        speed_rms=rms[0],
        speed_peak=peak[0],
        torque_rms=rms[1],
        torque_peak=peak[1],
        excursion_rms=rms[2],
        excursion_peak=peak[2],
        speed_limit=whole[0],
        torque_limit=whole[1],
        excursion_limit=whole[2],
        admissible_scale=admissible(least, most, offset, whole[:, None]).min(axis=0),
        duration_s=duration_s,
    )


def _rms(motion: PoseMotion, middle: FloatArray) -> FloatArray:
    every = np.stack([motion.speed, motion.torque, motion.path.positions - middle])
    return np.asarray(np.sqrt(np.mean(every**2, axis=(1, 2))))
