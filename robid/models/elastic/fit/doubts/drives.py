"""Doubts of what moves the joints: torque constants, rotors, gear couplings, friction of motors and arms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from robid.arrays import ComplexArray
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.models.elastic.fit.doubts.masses import with_carried_share
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot
from robid.robot.parameters import element_names

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene
    from robid.robot.response import ElasticParameters

_OF_PLACE = 0.25  # of a torque constant's deviation: what temperature does between places
_PERCENT = 100.0
_MICRO = 1e-6
_TURN_10_HZ = 20 * np.pi
_COUPLING_STEP = 1e-2  # percent
_SHARE_STEP = 1e-2  # percent
_WRIST, _WITH_WRIST = 3, 6  # joints of a wrist whose motors sit before it, and of an arm that has one
_OF_LINK = "% of what its link's inertia asks for at 10 Hz"
_OF_ROTOR = "% of what its rotor asks for at 10 Hz"


@dataclass(frozen=True)
class TorqueScale:
    """A measured torque that is too large by some percent: its column of the response is too small.

    Attributes:
        joint: Index of the motor.
    """

    joint: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        found = np.zeros(scene.problem.frf.response.shape, complex)
        found[..., self.joint] = self.slope
        return found

    @property
    def slope(self) -> float:
        """Derivative of the log response to its torque by the amount."""
        return -1 / _PERCENT


@dataclass(frozen=True)
class SharedTorqueScale:
    """The same where masses were found by the same torques, in a rigid fit: the joint's link is too heavy by as much.

    Torques, masses and springs by one factor are the same response, so such masses do not tell a torque constant.

    Attributes:
        joint: Index of the motor.
    """

    joint: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        return np.asarray(TorqueScale(self.joint).column(scene) - self.heavier.column(scene))

    @property
    def heavier(self) -> RobotMove:
        """The link that is heavier by as many percent."""
        return RobotMove(partial(with_carried_share, self.joint), _SHARE_STEP)


@dataclass(frozen=True)
class LaterTorque:
    """A delay that is longer by some microseconds, where no fit estimates it."""

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        return np.asarray(_MICRO * scene.delay_slopes[..., 0])

    @staticmethod
    def size(amount: float) -> float:
        """How much longer it is [s]."""
        return _MICRO * amount


@dataclass(frozen=True)
class RotorShare:
    """A rotor's inertia that is off by some percent, where no fit estimates it.

    Attributes:
        joint: Index of the motor.
    """

    joint: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        size = scene.stated.motor_inertia[self.joint] / _PERCENT
        return np.asarray(scene.rotor_slopes[..., self.joint] * size)


@dataclass(frozen=True)
class ViscousFriction:
    """Viscous friction that no fit estimates, in percent of what an inertia asks for at 10 Hz.

    Attributes:
        joint: Index of the joint.
        kind: That of the motor over its rotor, or that behind the transmission over its link.
    """

    joint: int
    kind: Literal["viscous", "arm_viscous"]

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        slopes = scene.viscous_slopes if self.kind == "viscous" else scene.arm_slopes
        return np.asarray(slopes[..., self.joint] * self.size(scene.stated))

    def size(self, values: ElasticParameters) -> float:
        """Viscous friction that an amount of one is [N m s/rad, or N s/m]."""
        inertia = values.motor_inertia if self.kind == "viscous" else values.link_inertia
        return _TURN_10_HZ * float(inertia[self.joint]) / _PERCENT


@dataclass(frozen=True)
class MotorFriction:
    """A torque that follows a motor's angle, in percent of what its rotor asks for at 10 Hz.

    Attributes:
        joint: Index of the motor.
        phase: Its direction in the complex plane: 1 as a spring's, 1j as that of a loss whatever the speed.
    """

    joint: int
    phase: complex

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount; zero without that angle."""
        frf, whole, hold = scene.problem.frf, scene.response.sampled, scene.response.hold
        name = frf.input_names[self.joint]
        if name not in frf.output_names:
            return np.zeros_like(whole)
        row = frf.output_names.index(name)
        square = (2 * np.pi * frf.frequency_hz) ** 2
        moved = whole[..., :, self.joint, None] * whole[..., row, None, :] / whole
        # The motor feels its friction at once, a torque only after hold and delay.
        return np.asarray(self.stiffness(scene) * moved / (square * hold)[:, None, None])

    def stiffness(self, scene: Scene) -> complex:
        """Torque per angle that an amount of one is [N m/rad]."""
        return self.phase * float(scene.values.motor_inertia[self.joint]) * _TURN_10_HZ**2 / _PERCENT


def torque_doubts(robot: Robot, *, rigid: bool = False) -> Iterator[DoubtColumn]:
    """Yields the doubts of the motors' torque constants, with the masses of a rigid fit where these are the robot's."""
    for index, joint in enumerate(robot.joints):
        std = _PERCENT * joint.doubts.torque_relative_std
        if std > 0:
            names = f"{joint.name}.torque_constant", f"torque constant of {joint.name}"
            deviations = std, _OF_PLACE * std
            direction = SharedTorqueScale(index) if rigid else TorqueScale(index)
            yield DoubtColumn(*names, "torque_constant", "%", *deviations, direction, -_PERCENT, _PERCENT)


def left_of_freed(doubt: DoubtColumn) -> DoubtColumn | None:
    """What is left to doubt once a fit estimates a doubt: of a torque constant, masses that the same torques gave."""
    if not isinstance(doubt.direction, SharedTorqueScale):
        return None
    name, heavier = f"{doubt.name.rpartition('.')[0]}.mass_by_torque", doubt.direction.heavier
    title = f"mass by {doubt.title}"
    return replace(doubt, name=name, title=title, cause="masses", place_std=0.0, direction=heavier)


def delay_doubts(robot: Robot, options: ElasticOptions) -> Iterator[DoubtColumn]:
    """Yields the doubt of the drives' delay, where no fit estimates it."""
    std = robot.doubts.delay_s / _MICRO
    if std > 0 and not options.estimates("delay", "delay"):
        yield DoubtColumn("delay", "delay of the drives", "delay", "us", std, 0.0, LaterTorque())


def rotor_doubts(robot: Robot, options: ElasticOptions) -> Iterator[DoubtColumn]:
    """Yields the doubts of rotor inertias that no fit estimates."""
    for index, joint in enumerate(robot.joints):
        name, std = f"{joint.name}.motor_inertia", _PERCENT * joint.motor.inertia_relative_std
        if not options.estimates("motor_inertia", name):
            title = f"rotor inertia of {joint.name}"
            yield DoubtColumn(name, title, "rotor_inertia", "%", std, 0.0, RotorShare(index), -_PERCENT, _PERCENT)


def friction_doubts(robot: Robot, options: ElasticOptions) -> Iterator[DoubtColumn]:
    """Yields the doubts of friction: of arms and motors, where nothing estimates it, and what else motors' leaves."""
    yield from _viscous_doubts(robot, options, "arm_viscous")
    yield from _viscous_doubts(robot, options, "viscous")
    kinds: tuple[tuple[Literal["friction_spring", "friction_loss"], str, complex], ...] = (
        ("friction_spring", "in phase with its angle", 1.0),
        ("friction_loss", "that loses energy", 1j),
    )
    for index, joint in enumerate(robot.joints):
        std = _PERCENT * joint.doubts.friction
        for kind, what, phase in kinds if std > 0 else ():
            names = f"{joint.name}.{kind}", f"friction of {joint.name} {what}"
            found = MotorFriction(index, phase)
            yield DoubtColumn(*names, "friction", _OF_ROTOR, std, std, found, -_PERCENT, _PERCENT)


def _viscous_doubts(
    robot: Robot, options: ElasticOptions, kind: Literal["viscous", "arm_viscous"]
) -> Iterator[DoubtColumn]:
    of_arm = kind == "arm_viscous"
    least, unit, cause = (0.0, _OF_LINK, "arm_friction") if of_arm else (-_PERCENT, _OF_ROTOR, "friction")
    for index, (joint, name) in enumerate(zip(robot.joints, element_names(robot, kind), strict=True)):
        std = _PERCENT * (joint.doubts.arm_friction if of_arm else joint.doubts.friction)
        if std > 0 and name is not None and not options.estimates(kind, name):
            names = name, f"viscous friction of {joint.name}'s {'arm' if of_arm else 'motor'}"
            yield DoubtColumn(*names, cause, unit, std, std, ViscousFriction(index, kind), least, _PERCENT)


def coupling_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the doubts of gear couplings: those that the file states, and those of an arm's wrist."""
    n_joint = len(robot.joints)
    wrist = range(n_joint - _WRIST, n_joint) if n_joint >= _WITH_WRIST else range(0)
    for index, joint in enumerate(robot.joints):
        std = _PERCENT * joint.doubts.coupling_std
        for other, driven in enumerate(robot.joints):
            inside = other < index and index in wrist and other in wrist
            turning = joint.type == driven.type == "revolute" and other != index and not robot.rigid[index]
            if std > 0 and turning and (inside or driven.name in joint.couplings):
                names = f"{joint.name}.coupling_{driven.name}", f"turn of {joint.name} by the motor of {driven.name}"
                move = RobotMove(partial(_with_coupling, index, other), _COUPLING_STEP)
                yield DoubtColumn(*names, "gear_coupling", "% of a turn", std, 0.0, move)


def _with_coupling(index: int, other: int, robot: Robot, percent: float) -> Robot:
    """The robot with a joint that turns by more percent of what another joint's motor does to its own."""
    joint, driven = robot.joints[index], robot.joints[other]
    turn = joint.couplings.get(driven.name, 0.0) + percent / _PERCENT / driven.motor.gear_ratio
    coupled = replace(joint, couplings={**joint.couplings, driven.name: turn})
    return replace(robot, joints=(*robot.joints[:index], coupled, *robot.joints[index + 1 :]))
