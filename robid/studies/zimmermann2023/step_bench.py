"""The steps of one configuration: each model's control on the true robot and on the model itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot
from robid.robot.inverse import inverse_motion
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.signals.waveforms import smooth_step
from robid.simulate.engine import true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.playback import Playback, Played, play, turned_tool
from robid.studies.zimmermann2023.step_profile import StepProfile

_OVERSAMPLING = 4
_LEAD_SAMPLES = 20


@dataclass(frozen=True)
class StepBench:
    """What all configurations share.

    Attributes:
        true: The true robot with its tool point, without the imperfections.
        models: The models by name, with the same tool point.
        controller: The controller of all of them.
        simulation: Imperfections of the true robot.
        duration_s: Time from the beginning of the steps [s].
    """

    true: Robot
    models: Mapping[str, Robot]
    controller: Controller
    simulation: SimulateOptions
    duration_s: float

    @property
    def time_s(self) -> FloatArray:
        """Times of the controller's samples (n_time,), 0 where the steps begin [s]."""
        period = self.controller.sampling_period_s
        return period * np.arange(-_LEAD_SAMPLES, round(self.duration_s / period) + 1)


@dataclass(frozen=True)
class StepTask:
    """One configuration.

    Attributes:
        index: Its index.
        configuration (n_joint,): Arm-side angles that the encoders show at rest [rad].
        profiles: Step of each axis.
    """

    index: int
    configuration: FloatArray
    profiles: Sequence[StepProfile]


@dataclass(frozen=True)
class StepRun:
    """What happened in one configuration.

    Attributes:
        path (n_axis, n_time, 3): Commanded displacement of the tool point [m].
        tool (2, n_model, n_axis, n_time, 3): Displacement of the tool point of the true robot and of the model [m].
        torque (2, n_model, n_axis, n_time): Torque of the stepped axis of both [N m].
    """

    path: FloatArray
    tool: FloatArray
    torque: FloatArray


def run_steps(bench: StepBench, task: StepTask) -> StepRun:
    """Steps every axis of one configuration with every model."""
    tools, torques = [], []
    friction = bench.simulation.imperfections.friction
    # A model knows its own springs and friction; noise, ripple and the rest are the true robot's alone.
    ideal = SimulateOptions(Imperfections(friction=friction), steps_per_sample=bench.simulation.steps_per_sample)
    for robot in bench.models.values():
        motion = step_control(robot, bench, task)
        sides = [
            play(each, bench.controller, options, task.configuration, task.index, motion)
            for each, options in ((bench.true, bench.simulation), (robot, ideal))
        ]
        tools.append([(side.tool - side.tool[0]).swapaxes(0, 1) for side in sides])
        torques.append([_own_torques(side) for side in sides])
    return StepRun(_paths(bench, task), np.array(tools).swapaxes(0, 1), np.array(torques).swapaxes(0, 1))


def step_control(robot: Robot, bench: StepBench, task: StepTask) -> Playback:
    """Designs motor motions and feed-forward torques with a model, one simulation per axis.

    Torque commands aim at the middle of the time for which they are held, after the controller's delay; the
    reference is known that far ahead.
    """
    model = build_model(robot, balanced=True)
    rest = solve_statics(model, task.configuration[None])
    period, delay, n_time = bench.controller.sampling_period_s, bench.controller.delay_samples, bench.time_s.size
    fine = bench.time_s[0] + period / _OVERSAMPLING * np.arange(_OVERSAMPLING * (n_time + delay) + 1)
    now = _OVERSAMPLING * np.arange(n_time)
    held = now + _OVERSAMPLING * delay + _OVERSAMPLING // 2
    law = [joint.motor.friction for joint in robot.joints]
    coulomb = np.array([each.coulomb_nm for each in law]) * (bench.simulation.imperfections.friction != "none")
    smooth = np.array([each.stribeck_rad_s for each in law])
    angles, torques = [], []
    for axis, profile in enumerate(task.profiles):
        arm = np.zeros((3, fine.size, len(robot.joints)))
        arm[..., axis] = smooth_step(fine, profile.size_rad, profile.speed_rad_s, profile.ramp_s)
        found = inverse_motion(model, rest, arm, period / _OVERSAMPLING, _OVERSAMPLING)
        rate = np.gradient(found.angle, period / _OVERSAMPLING, axis=0)
        angles.append(found.angle[now])
        torques.append((found.torque + coulomb * np.tanh(rate / smooth))[held])
    return Playback(np.stack(angles, axis=1), np.stack(torques, axis=1))


def _paths(bench: StepBench, task: StepTask) -> FloatArray:
    at_rest = replace(bench.simulation, steps_per_sample=1)
    model = true_model(bench.true, bench.controller, at_rest, sensors=False)
    rest = solve_statics(model, task.configuration[None])
    return np.array(
        [
            turned_tool(model, rest, axis, smooth_step(bench.time_s, p.size_rad, p.speed_rad_s, p.ramp_s)[0])
            for axis, p in enumerate(task.profiles)
        ]
    )


def _own_torques(played: Played) -> FloatArray:
    """Torque of each simulation's own axis (n_axis, n_time)."""
    axes = np.arange(played.torque.shape[1])
    return np.asarray(played.torque[:, axes, axes].T)
