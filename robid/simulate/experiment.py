"""The simulated closed-loop experiment of one configuration, all its experiments at once, and its further outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray, IntArray
from robid.robot.description import Robot
from robid.robot.model import ElasticModel
from robid.signals.quantities import INJECTED, Channel, QuantityName, Side, motor_channels
from robid.signals.record import Record
from robid.simulate.controller import Cascade, angle_reference
from robid.simulate.drives import Drives
from robid.simulate.engine import Followers, quiet_mujoco, refuse_explosion, rest_of, true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.steps import Steps, choose_steps, peak_motor_speed, visited
from robid.simulate.truth import recorded_torque_factor


def _further_channels(robot: Robot, names: Sequence[str]) -> tuple[Channel, ...]:
    """What outputs beyond the motors are: arm angles, and the tool's positions and accelerations."""
    kinds: dict[str, str] = {sensor.name: sensor.kind for sensor in robot.sensors}
    sliding = zip(robot.joints, robot.prismatic.tolist(), strict=True)
    kinds |= {f"{joint.name}.arm": "slide" for joint, slides in sliding if slides}
    known: dict[str, tuple[QuantityName, str, Side]] = {
        "link_encoder": ("angle", "rad", "arm"),
        "slide": ("position", "m", "arm"),
        "tracker": ("position", "m", "tool"),
        "accelerometer": ("acceleration", "m/s^2", "tool"),
    }
    return tuple(Channel(name, *known[kinds.get(name, "link_encoder")]) for name in names)


class FurtherOutputs:
    """Reads link encoders and sensors of many simulations, one row each.

    Args:
        model: The elastic model, built with sensors where `names` has any.
        batch: The simulations.
        names: `<joint>.arm` and names of sensors.
    """

    def __init__(self, model: ElasticModel, batch: Batch, names: tuple[str, ...]) -> None:
        joints = [joint.name for joint in model.robot.joints]
        sensors = {sensor.name: sensor for sensor in model.robot.sensors}
        self._qpos, self._n = batch.qpos, len(names)
        self._arms = [column for column, name in enumerate(names) if name not in sensors]
        self._angles = [model.arm[joints.index(names[column].removesuffix(".arm"))] for column in self._arms]
        self._sensed = [column for column, name in enumerate(names) if name in sensors]
        self._axes = np.zeros((model.mujoco.nsensordata, len(self._sensed)))
        for position, column in enumerate(self._sensed):
            start = int(model.mujoco.sensor(names[column]).adr[0])
            self._axes[start : start + 3, position] = sensors[names[column]].axis
        self._data = batch.sensordata if self._sensed else None
        slides = dict(zip(joints, model.robot.prismatic.tolist(), strict=True))
        self._kinds = [
            sensors[name].kind if name in sensors
            else "linear_encoder" if slides[name.removesuffix(".arm")]
            else "link_encoder"
            for name in names
        ]  # fmt: skip

    def noise_std(self, flaws: Imperfections) -> FloatArray:
        """Returns the standard deviation (n_out,) of each output's noise, in its unit."""
        known = {
            "link_encoder": flaws.link_encoder_noise_rad,
            "linear_encoder": flaws.link_encoder_noise_m,
            "tracker": flaws.tracker_noise_m,
            "accelerometer": flaws.accelerometer_noise_m_s2,
        }
        return np.array([known[kind] for kind in self._kinds])

    def resolution(self, flaws: Imperfections) -> FloatArray:
        """Returns the step (n_out,) in which each output is shown, in its unit; 0 where it is shown as it is."""
        known = {"link_encoder": flaws.link_encoder_resolution_rad, "linear_encoder": flaws.link_encoder_resolution_m}
        return np.array([known.get(kind, 0.0) for kind in self._kinds])

    def arms(self) -> FloatArray:
        """Returns the link encoders' positions (n_sim, n_arm) now [rad, or m]."""
        return np.array(self._qpos[:, self._angles])

    def read(self, arms: FloatArray | None = None) -> FloatArray:
        """Returns all outputs (n_sim, n_out); sensors as the engine computed them last [rad, m or m/s^2].

        Args:
            arms (n_sim, n_arm): The link encoders' angles at that time; now when not given [rad].
        """
        values = np.empty((len(self._qpos), self._n))
        values[:, self._arms] = self.arms() if arms is None else arms
        if self._data is not None:
            values[:, self._sensed] = self._data @ self._axes
        return values


@dataclass(frozen=True)
class SimulatedExperiment:
    """What all configurations of a simulated campaign share."""

    robot: Robot  # The true robot
    controller: Controller
    options: SimulateOptions
    reference: FloatArray  # (n_real, n_exp, n_sample, n_motor) One period of the excitation [unit of its kind]
    inject: str
    excited_lines: IntArray  # (n_freq,) Excited lines
    detection_lines: IntArray  # (n_detection,) Lines left out on purpose
    periods: int
    outputs: tuple[str, ...] = ()  # What is recorded after the motors: `<joint>.arm` and sensors
    # (n_sample, n_motor) Position reference beneath the excitation, from the configuration; None without one [rad]
    travel: FloatArray | None = None


def with_settled_steps(
    experiment: SimulatedExperiment, configurations: FloatArray
) -> tuple[SimulatedExperiment, Steps]:
    """Returns the experiment with the number of steps that its options leave open, and why it is that.

    Args:
        experiment: The campaign.
        configurations (n_conf, n_joint): Its arm-side angles [rad].
    """
    robot, controller, options = experiment.robot, experiment.controller, experiment.options
    frequency_hz = experiment.excited_lines / (experiment.reference.shape[2] * controller.sampling_period_s)
    speed = peak_motor_speed(robot, controller, experiment.reference, experiment.inject)
    configurations = visited(robot, controller, experiment.reference, experiment.inject, configurations)
    if experiment.travel is not None:
        speed = speed + peak_motor_speed(robot, controller, experiment.travel[None], "position_reference")
        way = experiment.travel @ robot.arm_per_motor.T
        ends = np.stack([way.min(axis=0), way.max(axis=0)])
        configurations = (configurations[:, None] + ends).reshape(-1, way.shape[1])
    steps = choose_steps(robot, controller, options, configurations, frequency_hz, speed)
    return replace(experiment, options=replace(options, steps_per_sample=steps.count)), steps


def simulate(experiment: SimulatedExperiment, configuration: FloatArray, index: int, threads: int = 1) -> Record:
    """Simulates every realization and experiment of one configuration: torque commands and measured motor angles.

    Args:
        experiment: The campaign.
        configuration (n_joint,): Arm-side angles [rad].
        index: The configuration's index, which seeds its noise.
        threads: Simulation threads; the result does not depend on them.

    Raises:
        DataError: If the simulation blows up, naming the configuration.
    """
    experiment = with_settled_steps(experiment, configuration[None])[0]
    robot, options = experiment.robot, experiment.options
    model = true_model(robot, experiment.controller, options, index, sensors=bool(experiment.outputs))
    rest = rest_of(model, configuration, options.imperfections)
    n_real, n_exp, n_sample, n_motor = experiment.reference.shape
    n_sim = n_real * n_exp
    batch = Batch(model.mujoco, n_sim, nthread=threads)
    batch.qpos[:] = rest.position
    run = _Run(experiment, model, batch, rest.motor_torque[0], np.random.default_rng([experiment.options.seed, index]))
    total = experiment.options.transient_periods + experiment.periods
    torque = np.empty((experiment.periods, n_sample, n_sim, n_motor))
    n_out = n_motor + len(experiment.outputs)
    angle = np.empty((*torque.shape[:3], n_out))
    scrap = np.empty_like(torque[0]), np.empty_like(angle[0])
    with quiet_mujoco():
        for period in range(total):
            kept = period - experiment.options.transient_periods
            run.period(*((torque[kept], angle[kept]) if kept >= 0 else scrap))
            refuse_explosion(batch, model.robot, configuration, index, f"period {period + 1}")
    offset = np.concatenate([model.robot.motor_per_arm @ configuration, run.rest_outputs])
    return _record(experiment, model.robot, configuration, torque, angle, offset)


def _record(
    experiment: SimulatedExperiment,
    robot: Robot,
    configuration: FloatArray,
    torque: FloatArray,
    angle: FloatArray,
    offset: FloatArray,
) -> Record:
    """The record of torques and outputs (n_period, n_sample, n_sim, n_channel)."""
    n_real, n_exp, n_sample, n_motor = experiment.reference.shape
    recorded = recorded_torque_factor(experiment.robot, experiment.options.truth)
    shape = (experiment.periods, n_sample, n_real, n_exp)
    names = tuple(joint.name for joint in experiment.robot.joints)
    return Record(
        sampling_period_s=experiment.controller.sampling_period_s,
        configurations=configuration[None],
        inputs=(recorded * torque).reshape(*shape, n_motor).transpose(2, 3, 0, 1, 4)[None],
        outputs=(angle - offset).reshape(*shape, offset.size).transpose(2, 3, 0, 1, 4)[None],
        reference=experiment.reference[None],
        reference_channels=motor_channels(names, INJECTED[experiment.inject]),
        excited_lines=experiment.excited_lines,
        detection_lines=experiment.detection_lines,
        input_channels=motor_channels(names, "torque"),
        output_channels=(*motor_channels(names, "angle"), *_further_channels(robot, experiment.outputs)),
        output_offset=offset[None],
        joint_units=robot.joint_units,
    )


def _references(experiment: SimulatedExperiment, reference: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What one period (n_sim, n_sample, n_motor) tells speed, angle and torque (n_sample, n_sim, n_motor)."""
    told = np.ascontiguousarray(reference.transpose(1, 0, 2))
    speed = angle = torque = np.zeros_like(told)
    if experiment.inject == "speed_reference":
        speed = told
        integral = angle_reference(reference, experiment.controller.sampling_period_s)
        angle = np.ascontiguousarray(integral.transpose(1, 0, 2))
    elif experiment.inject == "position_reference":
        angle = told
    else:
        torque = told
    return speed, angle if experiment.travel is None else angle + experiment.travel[:, None], torque


class _Run:
    """State of the closed loop between periods."""

    def __init__(
        self,
        experiment: SimulatedExperiment,
        model: ElasticModel,
        batch: Batch,
        rest_torque: FloatArray,
        generator: np.random.Generator,
    ) -> None:
        self._experiment, self._batch, self._generator = experiment, batch, generator
        n_sim = batch.nsim
        reference = experiment.reference.reshape(n_sim, *experiment.reference.shape[2:])
        self._motor = model.motor
        self.names = experiment.outputs
        self._further = FurtherOutputs(model, batch, experiment.outputs)
        flaws = experiment.options.imperfections
        self._followers = Followers(model, batch, experiment.controller, flaws)
        self._followers.follow()
        batch.ctrl[:, : model.motor.size] = rest_torque
        batch.forward()
        self.rest_outputs = self._further.read()[0]
        self._sensor_noise = self._further.noise_std(flaws)
        resolution = self._further.resolution(flaws)
        self._stepped, self._step = np.flatnonzero(resolution), resolution[resolution > 0]
        self._rest = model.motor_angles(batch.qpos)
        self._speed, angle, self._torque = _references(experiment, reference)
        self._angle = self._rest + angle
        self._cascade = Cascade(
            experiment.controller,
            experiment.robot.motor_inertia_kgm2,
            np.array([joint.motor.max_torque_nm for joint in experiment.robot.joints]),
            self._rest,
            rest_torque,
        )
        self._drives = Drives(model, batch, experiment.controller, experiment.options, rest_torque)

    def period(self, torque: FloatArray, angle: FloatArray) -> None:
        """Runs one period into the given arrays (n_sample, n_sim, n_motor)."""
        flaws, drives = self._experiment.options.imperfections, self._drives
        noise = self._generator.standard_normal(torque.shape) * flaws.encoder_noise_rad
        disturbance = self._generator.standard_normal(torque.shape) * flaws.torque_noise_nm
        steps = self._experiment.options.steps_per_sample or 1
        further = self._generator.standard_normal((*torque.shape[:2], len(self.names))) * self._sensor_noise
        for sample in range(torque.shape[0]):
            measured = drives.read(noise[sample])
            command = self._cascade.command(measured, self._angle[sample], self._speed[sample])
            command = command + self._torque[sample]
            angle[sample, :, : self._motor.size], torque[sample] = measured, command
            drives.send(command, disturbance[sample])
            self._followers.follow()
            if not self.names:
                drives.step(steps)
                continue
            arms = self._further.arms()
            drives.step(1)  # sensors show the state at its beginning
            shown = self._further.read(arms) + further[sample]
            if self._stepped.size:
                shown[:, self._stepped] = np.rint(shown[:, self._stepped] / self._step) * self._step
            angle[sample, :, self._motor.size :] = shown
            if steps > 1:
                drives.step(steps - 1)
