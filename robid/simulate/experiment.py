"""The simulated closed-loop experiment of one configuration, all its experiments at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.robot.description import Robot
from robid.signals.quantities import INJECTED, motor_channels
from robid.signals.record import Record
from robid.simulate.closed_loop import ClosedLoop, Told
from robid.simulate.engine import quiet_mujoco, refuse_explosion, rest_of, true_model
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.outputs import further_channels
from robid.simulate.steady import steady_start
from robid.simulate.steps import Steps, choose_steps, peak_motor_speed, visited
from robid.simulate.truth import recorded_torque_factor

_AWAY = 0.01  # Of the motors' motion: what a period may begin with that decays within it


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
    controller, options = experiment.controller, experiment.options
    model = true_model(experiment.robot, controller, options, index, sensors=bool(experiment.outputs))
    rest = rest_of(model, configuration, options.imperfections)
    run = ClosedLoop(model, rest, controller, options, _told(experiment), experiment.outputs, threads)
    n_sample, n_sim, n_motor = run.told.speed.shape
    torque = np.empty((experiment.periods, n_sample, n_sim, n_motor))
    angle = np.empty((*torque.shape[:3], n_motor + len(experiment.outputs)))
    scrap, generator = (np.empty_like(torque[0]), np.empty_like(angle[0])), np.random.default_rng([options.seed, index])
    with quiet_mujoco():
        left, again = _settle(run, experiment, configuration, index)
        # What comes before the record ends with a period.
        for count in [left % n_sample] * (left % n_sample > 0) + [n_sample] * (left // n_sample):
            run.play(scrap[0][:count], scrap[1][:count], generator, begin=n_sample - count)
            refuse_explosion(run.batch, model.robot, configuration, index, "what comes before the first period")
        for period in range(experiment.periods):
            begun = run.motor_angle
            run.play(torque[period], angle[period], generator)
            while period == 0 and again and not _repeats(begun, run.motor_angle):
                begun, again = run.motor_angle, again - 1
                run.play(torque[period], angle[period], generator)
            refuse_explosion(run.batch, model.robot, configuration, index, f"period {period + 1}")
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
        output_channels=(*motor_channels(names, "angle"), *further_channels(robot, experiment.outputs)),
        output_offset=offset[None],
        joint_units=robot.joint_units,
    )


def _told(experiment: SimulatedExperiment) -> Told:
    """What the loops are told: the excitation, and the position references beneath it."""
    reference = experiment.reference.reshape(-1, *experiment.reference.shape[2:])
    told = Told.excitation(reference, experiment.inject, experiment.controller.sampling_period_s)
    return told if experiment.travel is None else replace(told, angle=told.angle + experiment.travel[:, None])


def _settle(run: ClosedLoop, experiment: SimulatedExperiment, configuration: FloatArray, index: int) -> tuple[int, int]:
    """Brings the simulations near their periodic steady state.

    Returns:
        Samples that they need to settle in it, and how many periods may be dropped where that is not enough, as where
        friction makes motors stick. As many periods as are to be dropped from rest, where the loop forgets too slowly,
        or a travel takes it far from where it was linearised.
    """
    periods = experiment.options.transient_periods
    dropped = periods * len(run.told.speed)
    if not dropped or experiment.travel is not None:
        return dropped, 0
    found = steady_start(run.told, experiment.robot, experiment.controller, experiment.options, configuration, index)
    if found is None or found.samples >= dropped:
        return dropped, 0
    run.begin(found.state)
    return found.samples, periods


def _repeats(begun: FloatArray, ended: FloatArray) -> bool:
    """Whether the motors (n_sim, n_motor) of all simulations end a period where they began it."""
    away = np.sqrt(((ended - begun) ** 2).mean(axis=0))
    return bool((away <= _AWAY * np.sqrt((ended**2).mean(axis=0))).all())
