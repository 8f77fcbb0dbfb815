"""The simulated Cartesian position loop: pose commands through the interface, the cascade and the elastic arm."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.robot.description import Robot, Sensor
from robid.robot.kinematics import ToolArm
from robid.robot.model import ElasticModel, site_name
from robid.signals.pose import ANGLES, POSE, displacement, pose_channels, pose_command_channels
from robid.signals.record import Record
from robid.simulate.controller import Cascade
from robid.simulate.drives import Drives
from robid.simulate.engine import Followers, quiet_mujoco, refuse_explosion, rest_of, true_model
from robid.simulate.options import Controller, PoseInterface, SimulateOptions
from robid.simulate.pose_path import channel_motion, followed, joint_path
from robid.simulate.steps import Steps, choose_steps

TOOL = "pose_of_the_tool"  # Name of the sensor that shows where the tool is
_SEEN = 8


@dataclass(frozen=True)
class PoseExperiment:
    """What all configurations of a simulated campaign of pose commands share."""

    robot: Robot  # The true robot
    arm: ToolArm  # The rigid arm as the controller knows it
    controller: Controller
    interface: PoseInterface
    options: SimulateOptions
    channels: tuple[str, ...]  # Names of the commanded channels, which are those measured
    reference: FloatArray  # (n_real, n_exp, n_sample, n_channel) One period of the commands [m, rad]
    excited_lines: IntArray  # (n_freq,) Excited lines
    periods: int

    @property
    def controller_samples(self) -> int:
        """Samples of the controller in one of the interface."""
        return round(self.interface.sampling_period_s / self.controller.sampling_period_s)


def with_settled_pose_steps(experiment: PoseExperiment, configurations: FloatArray) -> tuple[PoseExperiment, Steps]:
    """Returns the experiment with the number of steps that its options leave open, and why it is that.

    Args:
        experiment: The campaign.
        configurations (n_conf, n_joint): Its homes, arm side [rad, or m].
    """
    robot, period_s = experiment.robot, experiment.interface.sampling_period_s
    frequency_hz = experiment.excited_lines / (experiment.reference.shape[2] * period_s)
    stated = experiment.options.steps_per_sample is not None
    paths = np.zeros((0, 1, len(robot.joints))) if stated else _paths(experiment, configurations)
    speed = np.abs(np.diff(paths, axis=1) @ robot.motor_per_arm.T).max(axis=(0, 1), initial=0.0) / period_s
    seen = paths.reshape(-1, paths.shape[-1])
    seen = np.concatenate([configurations, seen[:: max(len(seen) // _SEEN, 1)]])
    steps = choose_steps(robot, experiment.controller, experiment.options, seen, frequency_hz, speed)
    return replace(experiment, options=replace(experiment.options, steps_per_sample=steps.count)), steps


def _paths(experiment: PoseExperiment, configurations: FloatArray) -> FloatArray:
    """Joint positions (n_path, n_sample, n_joint) that the commands of the first realization ask for."""
    commands = experiment.reference[0]
    return np.concatenate(
        [joint_path(experiment.arm, experiment.channels, home, commands).positions for home in configurations]
    )


def simulate_poses(experiment: PoseExperiment, configuration: FloatArray, index: int, threads: int = 1) -> Record:
    """Simulates every realization and channel from one home: commanded and measured displacements.

    Args:
        experiment: The campaign.
        configuration (n_joint,): Home, arm side [rad, or m].
        index: The configuration's index, which seeds its noise.
        threads: Simulation threads; the result does not depend on them.

    Raises:
        DataError: If a pose is out of reach or the simulation blows up, naming the configuration.
    """
    experiment = with_settled_pose_steps(experiment, configuration[None])[0]
    robot = replace(experiment.robot, sensors=(*experiment.robot.sensors, tool_sensor(experiment.arm)))
    model = true_model(robot, experiment.controller, experiment.options, index, sensors=False)
    loop = _Loop(experiment, model, configuration, index, threads)
    transient, measured = experiment.options.transient_periods, []
    with quiet_mujoco():
        for period in range(transient + experiment.periods):
            shown = loop.period(is_first=period == 0)
            refuse_explosion(loop.batch, experiment.robot, configuration, index, f"period {period + 1}")
            if period >= transient:
                measured.append(shown)
    n_real, n_exp, *rest = experiment.reference.shape
    outputs = np.array(measured).reshape(experiment.periods, n_real, n_exp, *rest)
    reference = experiment.reference[:, :, None]
    return Record(
        sampling_period_s=experiment.interface.sampling_period_s,
        configurations=configuration[None],
        inputs=np.broadcast_to(reference, (n_real, n_exp, experiment.periods, *rest))[None],
        outputs=outputs.transpose(1, 2, 0, 3, 4)[None],
        excited_lines=experiment.excited_lines,
        input_channels=pose_command_channels(experiment.channels),
        output_channels=pose_channels(experiment.channels),
        output_offset=loop.offset[None],
        joint_units=experiment.robot.joint_units,
        notes=_notes(experiment),
    )


def tool_sensor(arm: ToolArm) -> Sensor:
    """Returns the sensor at an arm's tool point, on the last link."""
    return Sensor(TOOL, "tracker", len(arm.robot.joints) - 1, arm.tool_m, np.array([0.0, 0.0, 1.0]))


def _notes(experiment: PoseExperiment) -> tuple[str, ...]:
    interface, measured = experiment.interface, experiment.options.measured_pose
    reported = "the motors' encoders and the rigid arm" if measured == "motors" else "the tool itself"
    return (
        f"Simulated pose interface: commands as sent, {interface.delay_samples} samples of transport delay, a moving"
        f" average of {interface.moving_average} samples, then motor angles that move linearly from one command to the"
        " next: a first-order hold that is one more sample late. Neither delay nor average is in the inputs.",
        f"The measured pose is that of {reported}, in steps of {interface.resolution_m:g} m and"
        f" {interface.resolution_rad:.4g} rad.",
    )


class _Loop:
    """State of the closed loop between periods, of all experiments of one configuration."""

    def __init__(
        self, experiment: PoseExperiment, model: ElasticModel, configuration: FloatArray, index: int, threads: int
    ) -> None:
        self._experiment, self._model, self._home = experiment, model, configuration
        self._generator = np.random.default_rng([experiment.options.seed, index])
        rest = rest_of(model, configuration, experiment.options.imperfections)
        n_real, n_exp = experiment.reference.shape[:2]
        self.batch = Batch(model.mujoco, n_real * n_exp, nthread=threads)
        self.batch.qpos[:] = rest.position
        self.batch.ctrl[:, : model.motor.size] = rest.motor_torque[0]
        self._followers = Followers(model, self.batch, experiment.controller, experiment.options.imperfections)
        self._followers.follow()
        self.batch.forward()
        self._first, self._steady = self._told(index)
        self._last = model.motor_angles(self.batch.qpos)
        limit = np.array([joint.motor.max_torque_nm for joint in experiment.robot.joints])
        inertia = experiment.robot.motor_inertia_kgm2
        self._cascade = Cascade(experiment.controller, inertia, limit, self._last, rest.motor_torque[0])
        self._drives = Drives(model, self.batch, experiment.controller, experiment.options, rest.motor_torque[0])
        self.offset = np.zeros(len(experiment.channels))
        if experiment.options.measured_pose == "tool":
            self.offset = self._true_motion(rest.position[None])[0, 0]

    def _told(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Motor angles (n_sample, n_sim, n_motor) that the first and every later period tell."""
        experiment = self._experiment
        n_sample, n_channel = experiment.reference.shape[2:]
        late = min(experiment.interface.delay_samples + experiment.interface.moving_average, n_sample)
        one = experiment.reference.reshape(-1, n_sample, n_channel)
        commands = followed(np.concatenate([one, one[:, :late]], axis=1), experiment.interface)
        path = joint_path(experiment.arm, experiment.channels, self._home, commands)
        if path.share.min() < 1:
            raise DataError(
                "D218 commanded poses are out of reach",
                where=f"configuration {index + 1} at {experiment.robot.shown(self._home)}",
                remedy="design the excitation of the campaign again",
            )
        told = np.ascontiguousarray((path.positions @ experiment.robot.motor_per_arm.T).swapaxes(0, 1))
        return told[:n_sample], np.concatenate([told[n_sample:], told[late:n_sample]])

    def period(self, *, is_first: bool) -> FloatArray:
        """Runs one period; returns the measured displacements (n_sim, n_sample, n_channel) less their offset."""
        experiment, told = self._experiment, self._first if is_first else self._steady
        seen = np.empty((*told.shape[:2], self._model.mujoco.nq))
        shown = np.empty_like(told)
        for sample in range(len(told)):
            seen[sample] = self.batch.qpos
            self._tick(told[sample], shown[sample])
        if experiment.options.measured_pose == "tool":
            motion = self._true_motion(seen.swapaxes(0, 1))
        else:
            arms = shown.swapaxes(0, 1) @ experiment.robot.arm_per_motor.T
            motion = channel_motion(experiment.arm, experiment.channels, self._home, arms)
        return self._reported(motion - self.offset)

    def _tick(self, told: FloatArray, shown: FloatArray) -> None:
        """Runs one sample of the interface; writes what the encoders show at its beginning."""
        experiment = self._experiment
        flaws, count = experiment.options.imperfections, experiment.controller_samples
        steps, period_s = experiment.options.steps_per_sample or 1, experiment.interface.sampling_period_s
        noise = flaws.encoder_noise_rad * self._generator.standard_normal((count, *told.shape))
        disturbance = flaws.torque_noise_nm * self._generator.standard_normal((count, *told.shape))
        change = told - self._last
        speed = (experiment.interface.speed_feedforward / period_s) * change
        for sub in range(count):
            measured = self._drives.read(noise[sub])
            if sub == 0:
                shown[:] = measured
            reference = self._last + ((sub + 1) / count) * change
            self._drives.send(self._cascade.command(measured, reference, speed), disturbance[sub])
            self._followers.follow()
            self._drives.step(steps)
        self._last = told

    def _true_motion(self, positions: FloatArray) -> FloatArray:
        """Displacements (n_sim, n_sample, n_channel) of the tool itself from the rigid arm's home pose."""
        experiment, model = self._experiment, self._model
        arm, channels = experiment.arm, experiment.channels
        arms = positions[..., model.arm]
        point, turn = _tool_poses(model, positions)
        # Seen from the carriage of the rail, whose way the rail's own channel has.
        base = _root_pose(arm, arms[..., : arm.external])
        point, turn = (point - base[0]) @ base[1], base[1].T @ turn
        displaced = displacement(*arm.poses(self._home[arm.external :]), point, turn @ arm.tool_rotation)
        found = channel_motion(arm, channels, self._home, arms)
        for column, name in enumerate(channels):
            if name in POSE:
                found[..., column] = displaced[..., POSE.index(name)]
        return found

    def _reported(self, motion: FloatArray) -> FloatArray:
        interface = self._experiment.interface
        turns = np.array([name in ANGLES for name in self._experiment.channels])
        motion = motion + np.where(turns, interface.noise_rad, interface.noise_m) * self._generator.standard_normal(
            motion.shape
        )
        step = np.where(turns, interface.resolution_rad, interface.resolution_m)
        return np.asarray(np.where(step > 0, np.round(motion / np.where(step > 0, step, 1)) * step, motion))


def _root_pose(arm: ToolArm, external: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the root is when external slides are at (..., n_external): (..., 3) [m], and its orientation (3, 3)."""
    point, turn = np.zeros((*external.shape[:-1], 3)), np.eye(3)
    for index, joint in enumerate(arm.robot.joints[: arm.external]):
        point, turn = point + turn @ joint.position_m, turn @ joint.rotation
        point = point + external[..., index, None] * turn[:, 2]
    return point, turn


def _tool_poses(model: ElasticModel, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (..., 3) [m] of the tool in the world, and orientations (..., 3, 3) of the last link."""
    data = mujoco.MjData(model.mujoco)
    site = model.mujoco.site(site_name(model.robot.sensors[-1])).id
    flat = positions.reshape(-1, positions.shape[-1])
    point, turn = np.empty((len(flat), 3)), np.empty((len(flat), 9))
    for row, position in enumerate(flat):
        data.qpos[:] = position
        mujoco.mj_kinematics(model.mujoco, data)
        point[row], turn[row] = data.site_xpos[site], data.site_xmat[site]
    shape = positions.shape[:-1]
    return point.reshape(*shape, 3), turn.reshape(*shape, 3, 3)
