"""Chirps of the commanded pose: what joints and motors do while they follow, the limits, and the design."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.excitation import Excitation, ExcitationPlan, make_plan
from robid.design.excitation.lines import check_signal, pose_chirp, signal_lines
from robid.design.excitation.options import PoseChirpOptions
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
from robid.robot.reach import Reach
from robid.robot.regressor.model import RigidModel
from robid.signals.pose import ANGLES, pose_command_channels
from robid.simulate.options import PoseInterface
from robid.simulate.pose_path import PosePath, followed, joint_path

_LOOKED_AT = 12  # Poses of each experiment that are held against floor and shapes
_STILL = 1e-9  # Share of a limit below which a motion is none


@dataclass(frozen=True)
class PoseLimits:
    """What a motion may use."""

    lower: FloatArray  # (n_joint,) Least joint positions [rad, or m]
    upper: FloatArray  # (n_joint,) Greatest joint positions [rad, or m]
    speed: FloatArray  # (n_joint,) Motor speeds [rad/s]
    torque: FloatArray  # (n_joint,) Motor torques [N m]

    @property
    def middle(self) -> FloatArray:
        """Middles of the joints' ranges (n_joint,) [rad, or m]."""
        return np.asarray((self.lower + self.upper) / 2)

    @property
    def whole(self) -> FloatArray:
        """Limits (3, n_joint) of speed, torque and distance from the middle of the range."""
        return np.array([self.speed, self.torque, (self.upper - self.lower) / 2])


def _pose_limits(robot: Robot) -> PoseLimits:
    motors = [joint.motor for joint in robot.joints]
    speed, torque = ([getattr(one, key) for one in motors] for key in ("max_speed_rad_s", "max_torque_nm"))
    return PoseLimits(robot.lower, robot.upper, np.array(speed), np.array(torque))


def _used(motion: PoseMotion, limits: PoseLimits) -> tuple[FloatArray, FloatArray]:
    """Returns least and greatest speed, torque and distance from the middle (3, n_exp, n_joint) of a motion."""
    every = np.stack([motion.speed, motion.torque, motion.path.positions - limits.middle])
    return every.min(axis=2), every.max(axis=2)


def _check_poses(
    robot: Robot,
    channels: Sequence[str],
    configurations: FloatArray,
    motions: Sequence[PoseMotion],
    commands: FloatArray,
    reach: Reach,
) -> None:
    """Refuses commands (n_exp, n_sample, n_channel) that a home's robot cannot follow, with what would do for each."""
    limits, found = _pose_limits(robot), []
    for column, channel in enumerate(channels):
        own = commands[column, :, column]
        told = [
            (share, index, text)
            for index, motion in enumerate(motions)
            for share, text in _problems(robot, limits, motion, column, own, reach)
        ]
        if told:
            share, index, text = min(told)
            homes = {home for _, home, _ in told}
            others = f" and {len(homes) - 1} more" if len(homes) > 1 else ""
            factor, unit = (180 / np.pi, "deg") if channel in ANGLES else (1e3, "mm")
            # The share rounded down to two digits.
            admissible = float(np.floor(share * 100) / 100) * float(np.abs(own).max()) * factor
            found.append(
                f"channel {channel}, configuration {index + 1} ({robot.shown(configurations[index])}){others}: {text};"
                f" about {admissible:.3g} {unit} would do"
            )
    if found:
        message = "S028 The robot cannot follow the commanded poses:\n  " + "\n  ".join(found)
        remedy = "lower `amplitude_mm` and `amplitude_deg` of these channels or `high_hz`, or begin from other homes"
        raise SettingsError(message, where="excitation", remedy=remedy)


def _problems(
    robot: Robot, limits: PoseLimits, motion: PoseMotion, experiment: int, own: FloatArray, reach: Reach
) -> Iterator[tuple[float, str]]:
    """Admissible share of the amplitude, and what keeps the robot from more."""
    share = motion.path.share[experiment]
    if share.min() < 1:
        yield float(share.min()), _unreached(robot, motion)
        return
    least, most = (each[:, experiment] for each in _used(motion, limits))
    offset = np.zeros_like(least)
    home = motion.path.positions[experiment, np.argmin(np.abs(own))]
    offset[1], offset[2] = motion.static, home - limits.middle
    room = _admissible(least, most, offset, limits.whole)
    for index, quantity in enumerate(("speed", "torque", "position")):
        joint = int(np.argmin(room[index]))
        if room[index, joint] < 1:
            yield float(room[index, joint]), _exceeded(robot, limits, quantity, joint, least[index], most[index])
    if reach.floor_m is None and reach.shapes is None:
        return
    order = np.argsort(own)[np.linspace(0, len(own) - 1, _LOOKED_AT).astype(int)]
    hits = reach.problems(np.clip(motion.path.positions[experiment, order], limits.lower, limits.upper))
    amounts = np.abs(own[order])
    for hit, amount in zip(hits, amounts.tolist(), strict=False):
        if hit:
            yield max(amount / float(np.abs(own).max()) - 2 / _LOOKED_AT, 0.0), hit


def _admissible(least: FloatArray, most: FloatArray, offset: FloatArray, limits: FloatArray) -> FloatArray:
    """Factor on a motion about an offset at which each quantity meets its limit, infinite for what stands still."""
    limits = np.broadcast_to(limits, least.shape)
    # Room over way on either side of what does not scale.
    sides = ((limits - offset, most - offset), (limits + offset, offset - least))
    still = np.full(least.shape, np.inf)
    factors = [np.divide(room, way, out=still.copy(), where=way > _STILL * limits) for room, way in sides]
    return np.asarray(np.maximum(np.minimum(*factors), 0))


def _unreached(robot: Robot, motion: PoseMotion) -> str:
    names = [f"`{joint.name}`" for joint, loose in zip(robot.joints, motion.path.loose.tolist(), strict=True) if loose]
    if names:
        return f"the arm is stretched out or singular on the way: {', '.join(names)} turn without moving the tool"
    return "the pose is out of the arm's reach"


def _exceeded(robot: Robot, limits: PoseLimits, quantity: str, joint: int, least: FloatArray, most: FloatArray) -> str:
    name = robot.joints[joint].name
    if quantity != "position":
        unit, limit = ("rad/s", limits.speed) if quantity == "speed" else ("N m", limits.torque)
        peak = max(float(most[joint]), -float(least[joint]))
        return f"motor {name}: {quantity} peak {peak:.4g} {unit} exceeds {limit[joint]:.4g} {unit}"
    unit, factor = ("m", 1.0) if robot.joints[joint].type == "prismatic" else ("deg", 180 / np.pi)
    side = most[joint] if most[joint] + least[joint] > 0 else least[joint]
    at = float(side + limits.middle[joint]) * factor
    ends = f"{limits.lower[joint] * factor:.4g} to {limits.upper[joint] * factor:.4g} {unit}"
    return f"joint `{name}` would go to {at:.4g} {unit}, but moves from {ends}"


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
    """Designs a chirp of each channel, in place of motor references, and holds it against the nominal robot's limits.

    Each channel is an experiment from each home (n_conf, n_joint) [rad, or m], with periods that are recorded and
    periods before those; all of it is played in each realization.

    Raises:
        SettingsError: If the chirp cannot be made, or with everything that keeps the robot from following it.

    Source:
        Oliveira et al. (2019), eq. 2 and Table 1.
    """
    period_s = robot.interface.sampling_period_s
    check_signal(options, period_s)
    signal, amplitude = pose_chirp(options, period_s), [options.amplitude(channel) or 0.0 for channel in channels]
    commands = np.einsum("en,s->esn", np.diag(amplitude), signal)
    motions = [_pose_motion(robot, channels, home, commands) for home in configurations]
    _check_poses(robot.arm.robot, channels, configurations, motions, commands, reach)
    length_s = realizations * len(channels) * len(configurations) * (periods + transient_periods) * options.period_s
    reference = np.broadcast_to(commands, (realizations, *commands.shape))
    played = _played(options, signal, np.array(amplitude), reference, period_s)
    plan = _plan(robot, configurations, motions, float(length_s))
    return replace(played, plan=plan, channels=pose_command_channels(channels))


def _played(
    options: PoseChirpOptions, signal: FloatArray, amplitude: FloatArray, commands: FloatArray, period_s: float
) -> Excitation:
    """Commands (n_real, n_exp, n_sample, n_channel) of one signal and amplitudes (n_channel,) as an excitation."""
    reference, lines = commands.copy(), signal_lines(options, period_s)[0]
    spectrum = np.fft.rfft(reference, axis=2)[:, :, lines] * (2 / len(signal))
    size = np.sqrt(np.mean(signal**2))
    crest = np.abs(signal).max() / size * np.eye(len(amplitude))
    crest = np.broadcast_to(crest, (len(commands), *crest.shape)).copy()
    return Excitation(reference, options.inject, lines, np.zeros(0, int), period_s, spectrum, amplitude * size, crest)


def _plan(
    robot: PoseRobot, configurations: FloatArray, motions: Sequence[PoseMotion], duration_s: float
) -> ExcitationPlan:
    """What the motors do at most over all channels; excursions are distances from the middle of a joint's range."""
    limits = _pose_limits(robot.arm.robot)
    reached = [_used(motion, limits) for motion in motions]
    least = np.stack([each.min(axis=1) for each, _ in reached], axis=1)
    most = np.stack([each.max(axis=1) for _, each in reached], axis=1)
    offset = np.zeros_like(least)
    offset[1] = [motion.static for motion in motions]
    offset[2] = configurations - limits.middle
    every = (np.stack([one.speed, one.torque, one.path.positions - limits.middle]) for one in motions)
    rms = np.stack([np.sqrt(np.mean(each**2, axis=(1, 2))) for each in every], axis=1)
    scale = _admissible(least, most, offset, limits.whole[:, None]).min(axis=0)
    peak = np.maximum(np.abs(most), np.abs(least))
    return replace(make_plan(rms, peak, limits.whole, scale), duration_s=duration_s)


@dataclass(frozen=True)
class PoseRobot:
    """The nominal robot that follows commands."""

    arm: ToolArm
    interface: PoseInterface
    rigid: RigidModel


@dataclass(frozen=True)
class PoseMotion:
    """Motion from one home."""

    path: PosePath  # Joint positions (n_exp, n_sample, n_joint), and how far they lead
    speed: FloatArray  # (n_exp, n_sample, n_joint) Motor speeds [rad/s]
    torque: FloatArray  # (n_exp, n_sample, n_joint) Motor torques [N m]
    static: FloatArray  # (n_joint,) Motor torques that hold the robot at home [N m]


def _pose_motion(
    robot: PoseRobot, channels: tuple[str, ...], configuration: FloatArray, commands: FloatArray
) -> PoseMotion:
    """Follows one period of commands (n_exp, n_sample, n_channel) from a home (n_joint,), in the steady state.

    They are interpolated linearly from sample to sample.
    """
    period_s = robot.interface.sampling_period_s
    # Two periods, of which the second is steady: delay and average have filled.
    twice = followed(np.concatenate([commands, commands], axis=1), robot.interface)
    path = joint_path(robot.arm, channels, configuration, twice[:, commands.shape[1] :])
    to_motor = robot.arm.robot.motor_per_arm.T
    angle = path.positions @ to_motor
    # Forward difference: linear interpolation moves at this speed until the next command.
    speed = (np.roll(angle, -1, axis=1) - angle) / period_s
    acceleration = (speed - np.roll(speed, 1, axis=1)) / period_s
    joints = angle.shape[-1]
    values = robot.rigid.nominal
    torque = robot.rigid.torques(values, *(each.reshape(-1, joints) for each in (angle, speed, acceleration)))
    still = np.zeros((1, joints))
    static = robot.rigid.torques(values, (configuration @ to_motor)[None], still, still)[0]
    return PoseMotion(path, speed, torque.reshape(angle.shape), static)
