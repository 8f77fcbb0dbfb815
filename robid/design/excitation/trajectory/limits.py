"""Series that begin and end at rest, and what keeps a trajectory of them small."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.design.excitation.options import TrajectoryOptions
from robid.errors import SettingsError
from robid.robot.description import Robot


@dataclass(frozen=True)
class RestingSeries:
    """All series of zero mean whose value, slope and curvature vanish where the period begins."""

    period_s: float  # Length of the period [s]
    # (2 n_harmonic, n_shape) Sine coefficients of the harmonics, then cosine coefficients, of orthonormal shapes that
    # span these series
    shapes: FloatArray

    @property
    def count(self) -> int:
        """Number of shapes."""
        return int(self.shapes.shape[1])

    @property
    def lines(self) -> IntArray:
        """Harmonics (n_harmonic,), from 1."""
        return np.arange(1, len(self.shapes) // 2 + 1)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Value, first and second derivative (3, n_time, n_shape) of each shape."""
        omega = 2 * np.pi * self.lines / self.period_s
        angle = np.asarray(time_s)[:, None] * omega
        sine, cosine = np.sin(angle), np.cos(angle)
        slope, curvature = (omega * cosine, -omega * sine), (-(omega**2) * sine, -(omega**2) * cosine)
        waves = [np.hstack(each) for each in ((sine, cosine), slope, curvature)]
        return np.asarray(np.array(waves) @ self.shapes)

    def grid(self, count: int) -> FloatArray:
        """The same at equidistant times of one period (3, count, n_shape)."""
        return self.at(np.arange(count) * (self.period_s / count))

    def amplitudes(self, coefficients: FloatArray) -> ComplexArray:
        """Complex amplitudes (n_harmonic, ...) of the harmonics from coefficients (n_shape, ...)."""
        sine, cosine = np.split(self.shapes @ coefficients, 2)
        return np.asarray(cosine - 1j * sine)


def resting_series(harmonics: int, period_s: float) -> RestingSeries:
    """Returns the series of harmonics 1 to `harmonics` that begin and end at rest.

    Raises:
        ValueError: If there are fewer than two harmonics, which leave nothing.
    """
    if harmonics < 2:
        raise ValueError(f"a series at rest needs two harmonics or more, not {harmonics}")
    order, none = np.arange(1, harmonics + 1), np.zeros(harmonics)
    # Value, slope and curvature at the beginning: sums of cosines, of k sines, of k^2 cosines vanish.
    conditions = np.array([[*none, *np.ones(harmonics)], [*order, *none], [*none, *order**2]])
    # The null space of the three conditions: right singular vectors beyond the third.
    _, _, rows = np.linalg.svd(conditions / np.linalg.norm(conditions, axis=1, keepdims=True))
    return RestingSeries(period_s, rows[3:].T)


_LEAST_SHARE = 0.1  # Share of the way to its limits that the slowest harmonic must be able to move a joint
_LEAST_ROOM = 0.01  # Share of a joint's range that a configuration must leave on either side


@dataclass(frozen=True)
class Limits:
    """What a motion may use; the shares of the options are in it."""

    below: FloatArray  # (n_joint,) Way down from every configuration, arm side [rad, or m]
    above: FloatArray  # (n_joint,) Way up [rad, or m]
    speed: FloatArray  # (n_motor,) Motor speed [rad/s]
    acceleration: FloatArray  # (n_joint,) Acceleration on the arm side, infinite where none is set [rad/s^2, or m/s^2]
    torque: FloatArray  # (n_motor,) Motor torque [N m]

    def used(self, robot: Robot, motion: FloatArray, torque: FloatArray) -> FloatArray:
        """Largest share of each limit (4, n_joint) that a motion uses: position, speed, acceleration, torque.

        A motion (3, n_sample, n_joint) is the way from the configuration, speed and acceleration on the arm side;
        motor torques are (..., n_motor) [N m].
        """
        way, speed, acceleration = motion
        position = np.maximum(way.max(axis=0) / self.above, -way.min(axis=0) / self.below)
        turned = np.abs(speed @ robot.motor_per_arm.T).max(axis=0) / self.speed
        needed = np.abs(torque).reshape(-1, len(self.torque)).max(axis=0) / self.torque
        return np.array([position, turned, np.abs(acceleration).max(axis=0) / self.acceleration, needed])


def trajectory_limits(
    robot: Robot, configurations: FloatArray, static_torque: FloatArray, options: TrajectoryOptions
) -> Limits:
    """Returns the limits of a trajectory that begins in configurations (n_conf, n_joint) [rad, or m].

    Motor torques (n_conf, n_motor) hold the robot there [N m].

    Raises:
        SettingsError: With everything that keeps the robot from moving.
    """
    problems = [*_missing(robot)]
    below, above = configurations.min(axis=0) - robot.lower, robot.upper - configurations.max(axis=0)
    if not problems:
        problems += [*_confined(robot, below, above)]
        problems += [*_overloaded(robot, static_torque, options)]
    if not problems:
        problems += [*_slow(robot, options.position_share * np.minimum(below, above), options)]
    if problems:
        message = "S033 The trajectory cannot be made:\n  " + "\n  ".join(problems)
        remedy = "correct the robot file's limits, or change the configuration or what the parentheses name"
        raise SettingsError(message, where="excitation", remedy=remedy)
    turns, slides = options.max_acceleration_deg_s2, options.max_acceleration_m_s2
    most = np.inf if slides is None else slides, np.inf if turns is None else np.radians(turns)
    return Limits(
        below=options.position_share * below,
        above=options.position_share * above,
        speed=options.speed_share * np.array([joint.motor.max_speed_rad_s for joint in robot.joints]),
        acceleration=np.where(robot.prismatic, *most),
        torque=options.torque_share * np.array([joint.motor.max_torque_nm for joint in robot.joints]),
    )


def _missing(robot: Robot) -> list[str]:
    found = []
    for joint in robot.joints:
        stated = {name: getattr(joint.motor, name) for name in ("max_speed_rad_s", "max_torque_nm")}
        stated = {"joint limits": joint.upper - joint.lower, **stated}
        if lacks := ", ".join(name for name, value in stated.items() if not np.isfinite(value)):
            found.append(f"joint `{joint.name}` has no {lacks} in the robot file, which a large motion needs")
    return found


def _confined(robot: Robot, below: FloatArray, above: FloatArray) -> list[str]:
    found = []
    for joint, down, up in zip(robot.joints, below.tolist(), above.tolist(), strict=True):
        if min(down, up) < _LEAST_ROOM * (joint.upper - joint.lower):
            unit, factor = ("m", 1.0) if joint.type == "prismatic" else ("deg", 180 / np.pi)
            side, way = ("lower", down) if down < up else ("upper", up)
            place = "limit where the motion begins and ends (configurations)"
            found.append(f"joint `{joint.name}` is {way * factor:.3g} {unit} from its {side} {place}")
    return found


def _overloaded(robot: Robot, static_torque: FloatArray, options: TrajectoryOptions) -> list[str]:
    found = []
    for motor, joint in enumerate(robot.joints):
        share = float(np.abs(static_torque[:, motor]).max() / joint.motor.max_torque_nm)
        if share >= options.torque_share:
            what = "to hold the arm where the motion begins (torque_share, configurations)"
            found.append(f"motor `{joint.name}` needs {100 * share:.3g} % of its torque limit {what}")
    return found


def _slow(robot: Robot, way: FloatArray, options: TrajectoryOptions) -> list[str]:
    """Joints that one period is too short for, by the speed of their own motor."""
    found = []
    for joint, wanted in zip(robot.joints, way.tolist(), strict=True):
        speed = options.speed_share * joint.motor.max_speed_rad_s / abs(joint.motor.gear_ratio)
        share = speed * options.period_s / (2 * np.pi) / wanted
        if share < _LEAST_SHARE:
            needed = options.period_s * _LEAST_SHARE / share
            found.append(
                f"joint `{joint.name}` reaches {100 * share:.2g} % of the way to its limits at its highest speed in"
                f" {options.period_s:g} s (period_s: {needed:.2g} s or more)"
            )
    return found
