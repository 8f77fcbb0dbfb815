"""What the joints and motors of the nominal rigid robot do while it follows pose commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.robot.kinematics import ToolArm
from robid.robot.regressor.model import RigidModel
from robid.simulate.options import PoseInterface
from robid.simulate.pose_path import PosePath, followed, joint_path


@dataclass(frozen=True)
class PoseRobot:
    """The nominal robot that follows commands.

    Attributes:
        arm: Its rigid arm.
        interface: How it takes commands.
        rigid: Its rigid dynamics, friction in them.
    """

    arm: ToolArm
    interface: PoseInterface
    rigid: RigidModel


@dataclass(frozen=True)
class PoseMotion:
    """Motion from one home.

    Attributes:
        path: Joint positions (n_exp, n_sample, n_joint), and how far they lead.
        speed (n_exp, n_sample, n_joint): Motor speeds [rad/s].
        torque (n_exp, n_sample, n_joint): Motor torques [N m].
        static (n_joint,): Motor torques that hold the robot at home [N m].
    """

    path: PosePath
    speed: FloatArray
    torque: FloatArray
    static: FloatArray


def pose_motion(
    robot: PoseRobot, channels: tuple[str, ...], configuration: FloatArray, commands: FloatArray
) -> PoseMotion:
    """Follows one period of commands in the steady state, interpolated linearly from sample to sample.

    Args:
        robot: The nominal robot.
        channels: Names of the commands.
        configuration (n_joint,): Home, arm side [rad, or m].
        commands (n_exp, n_sample, n_channel): One period [m, rad].
    """
    period_s = robot.interface.sampling_period_s
    twice = followed(np.concatenate([commands, commands], axis=1), robot.interface)
    path = joint_path(robot.arm, channels, configuration, twice[:, commands.shape[1] :])
    to_motor = robot.arm.robot.motor_per_arm.T
    angle = path.positions @ to_motor
    speed = (np.roll(angle, -1, axis=1) - angle) / period_s
    acceleration = (speed - np.roll(speed, 1, axis=1)) / period_s
    joints = angle.shape[-1]
    values = robot.rigid.nominal
    torque = robot.rigid.torques(values, *(each.reshape(-1, joints) for each in (angle, speed, acceleration)))
    still = np.zeros((1, joints))
    static = robot.rigid.torques(values, (configuration @ to_motor)[None], still, still)[0]
    return PoseMotion(path, speed, torque.reshape(angle.shape), static)
