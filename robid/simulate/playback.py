"""Given motor motions with feed-forward, played by the closed loop; the tool point is watched."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.description import Robot, Sensor
from robid.robot.linearize import Equilibrium
from robid.robot.model import ElasticModel, site_name
from robid.simulate.controller import Cascade
from robid.simulate.drives import Drives, encoder_readings
from robid.simulate.engine import Followers, quiet_mujoco, refuse_explosion, rest_of, true_model
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.steps import choose_steps

_TOOL = "tool_point"
_BAND = (1e-3, 0.1)  # over the sampling rate: where a step moves the robot
_BAND_LINES = 40


@dataclass(frozen=True)
class Playback:
    """What the controller is told to do."""

    angle: FloatArray  # (n_time, n_sim, n_motor) Motor angles, the first at rest [rad]
    torque: FloatArray  # (n_time, n_sim, n_motor) Feed-forward torques of the commands of each sample [N m]


@dataclass(frozen=True)
class Played:
    """What the robot did."""

    tool: FloatArray  # (n_time, n_sim, 3) Position of the tool point in the world [m]
    torque: FloatArray  # (n_time, n_sim, n_motor) Torque commands within the limits [N m]


def with_tool_point(robot: Robot, point_m: FloatArray) -> Robot:
    """Returns the robot with a tracker on its payload, or on its last link, as its only sensor."""
    tool = Sensor(_TOOL, "tracker", None, point_m, np.array([0.0, 0.0, 1.0]))
    return replace(robot, sensors=(tool,))


def play(
    robot: Robot,
    controller: Controller,
    options: SimulateOptions,
    configuration: FloatArray,
    index: int,
    motion: Playback,
) -> Played:
    """Plays motor motions from rest, feedback around the feed-forward: tool positions and torques at the samples.

    Args:
        robot: The robot that moves, with its tool point.
        controller: Its controller; feed-forward is added to its output.
        options: Imperfections, steps and seed; the tracker's noise is on the tool point.
        configuration (n_joint,): Arm-side angles that the encoders show at rest [rad].
        index: The configuration's index, which seeds its noise.
        motion: What the controller is told to do.

    Raises:
        DataError: If the simulation blows up, naming the configuration.
    """
    if options.steps_per_sample is None:
        told = np.abs(np.diff(motion.angle, axis=0)).max(axis=(0, 1), initial=0.0) / controller.sampling_period_s
        band_hz = np.geomspace(*_BAND, _BAND_LINES) / controller.sampling_period_s
        needed = choose_steps(robot, controller, options, configuration[None], band_hz, told)
        options = replace(options, steps_per_sample=needed.count)
    steps = options.steps_per_sample or 1
    model, flaws = true_model(robot, controller, options, index, sensors=True), options.imperfections
    rest = rest_of(model, configuration, flaws)
    n_time, n_sim, n_motor = motion.angle.shape
    batch = Batch(model.mujoco, n_sim, nthread=1)
    batch.qpos[:] = rest.position
    limit = np.array([joint.motor.max_torque_nm for joint in robot.joints])
    shown = encoder_readings(model.motor_angles(batch.qpos), np.zeros((n_sim, n_motor)), flaws)
    reference = motion.angle - motion.angle[0] + shown
    # At rest the feedback has learnt what the feed-forward lacks to hold the robot.
    lacking = rest.motor_torque - motion.torque[0]
    cascade = Cascade(controller, robot.motor_inertia_kgm2, limit, shown, lacking)
    drives = Drives(model, batch, controller, options, rest.motor_torque)
    generator = np.random.default_rng([options.seed, index])
    angle_noise, torque_noise = generator.standard_normal((2, *motion.angle.shape))
    tool = flaws.tracker_noise_m * generator.standard_normal((n_time, n_sim, 3))
    torque = np.empty_like(motion.angle)
    speed = np.diff(motion.angle, axis=0, prepend=motion.angle[:1]) / controller.sampling_period_s
    followers = Followers(model, batch, controller, flaws)
    watched = batch.sensordata  # bound before the first step, or that one is missed
    start = int(model.mujoco.sensor(model.robot.sensors[0].name).adr[0])
    with quiet_mujoco():
        for sample in range(n_time):
            measured = drives.read(flaws.encoder_noise_rad * angle_noise[sample])
            feedback = cascade.command(measured, reference[sample], speed[sample])
            torque[sample] = np.clip(feedback + motion.torque[sample], -limit, limit)
            drives.send(torque[sample], flaws.torque_noise_nm * torque_noise[sample])
            followers.follow()
            drives.step(1)  # sensors show the state at its beginning
            tool[sample] += watched[:, start : start + 3]
            if steps > 1:
                drives.step(steps - 1)
        refuse_explosion(batch, robot, configuration, index, "a step")
    return Played(tool, torque)


def turned_tool(model: ElasticModel, rest: Equilibrium, axis: int, angle: FloatArray) -> FloatArray:
    """Displacement (n_time, 3) of the tool point when one joint moves from rest and all else stays as it is [m].

    Args:
        model: The elastic model of a robot with its tool point.
        rest: Where it rests; one configuration.
        axis: Which joint moves.
        angle (n_time,): By how much [rad, or m].
    """
    data = mujoco.MjData(model.mujoco)
    data.qpos[:] = rest.position[0]
    mujoco.mj_kinematics(model.mujoco, data)
    joint = int(model.mujoco.dof_jntid[model.arm[axis]])
    if model.robot.joints[axis].type == "prismatic":
        return np.asarray(angle[:, None] * data.xaxis[joint])
    lever = data.site(site_name(model.robot.sensors[0])).xpos - data.xanchor[joint]
    across = np.cross(data.xaxis[joint], lever)
    outward = np.cross(data.xaxis[joint], across)
    return np.asarray(np.sin(angle)[:, None] * across + (1 - np.cos(angle))[:, None] * outward)
