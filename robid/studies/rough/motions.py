"""Random motions within a robot's limits, rich and poor ones, and their logs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.trajectory.design import random_trajectory, trajectory_problem
from robid.models.rigid.fit.shots import Shot, shots_of
from robid.models.rigid.judge.scales import Motions, motions_of
from robid.pipeline.design_excitation import base_model
from robid.robot.description import Robot
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions


@dataclass(frozen=True)
class Rig:
    """A robot with its controller, ready to be moved and logged."""

    robot: Robot
    controller: Controller
    home: FloatArray  # (n_joint,) where all motions begin and end [rad]
    flaws: Imperfections
    torque_noise_nm: FloatArray  # (n_joint,) deviation of the noise of each recorded torque [N m]


def random_motions(
    rig: Rig, options: TrajectoryOptions, sizes: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Returns motor speeds (n_motion, n_sample, n_joint) of random motions [rad/s].

    Args:
        rig: The robot, within whose limits they stay.
        options: Their length, harmonics and share of the limits.
        sizes (n_motion, n_joint): Size of each joint's motion over one within the limits.
        generator: What draws them.
    """
    problem = trajectory_problem(base_model(rig.robot, options), rig.home[None], options)
    n_sample = round(options.period_s / rig.controller.sampling_period_s)
    speed = problem.series.grid(n_sample)[1]
    drawn = np.array([random_trajectory(problem, generator) * size for size in sizes])
    return np.asarray(speed @ drawn @ rig.robot.motor_per_arm.T)


def log(rig: Rig, speed: FloatArray, seed: int, lines: int) -> tuple[tuple[Shot, ...], Motions]:
    """Simulates motions in the robot's closed loop, and returns what is logged of each, and in which channels.

    Args:
        rig: The robot.
        speed (n_motion, n_sample, n_joint): Motor speeds that it is told [rad/s].
        seed: Seed of the noise.
        lines: Harmonics of the motions.
    """
    experiment = SimulatedExperiment(
        robot=rig.robot,
        controller=rig.controller,
        options=SimulateOptions(imperfections=rig.flaws, transient_periods=0, seed=seed),
        reference=speed[:, None],
        inject="speed_reference",
        excited_lines=np.arange(1, lines + 1),
        detection_lines=np.zeros(0, int),
        periods=1,
    )
    record = simulate(experiment, rig.home, 0)
    # The noise is that of a current sensor: it is recorded, and moves nothing.
    noise = np.random.default_rng([seed, 1]).standard_normal(record.inputs.shape) * rig.torque_noise_nm
    noisy = replace(record, inputs=record.inputs + noise)
    shots = shots_of(noisy, rig.robot, late_samples=rig.controller.delay_samples)
    return shots, motions_of(noisy, rig.robot)


def shortened(shot: Shot, duration_s: float, first_s: float = 0.0) -> Shot:
    """Returns a part of a shot, which no longer is what its command told [s]."""
    first = round(first_s / shot.sampling_period_s)
    rows = slice(first, first + round(duration_s / shot.sampling_period_s))
    return replace(shot, position=shot.position[rows], torque=shot.torque[rows], command=None)
