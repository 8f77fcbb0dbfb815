"""A small arm with torque sensors at its joints: its robot file, logs of it, and the experiments that read them."""

from __future__ import annotations

import numpy as np

from rigid_logs import PERIOD_S, fourier_motion
from robid.robot.regressor.model import RigidModel, build_rigid_model

ROBOT = """schema_version: 1
name: sensed
joints:
  - name: turn
    frame: {position_m: [0, 0, 0.3]}
    limits_deg: [-150, 150]
    link: {mass_kg: 10, com_m: [0, 0.1, 0.1], inertia_kgm2: {xx: 0.3, yy: 0.3, zz: 0.2}}
    TURN
  - name: lift
    frame: {rotation: [[1, 0, 0], [0, 0, 1], [0, -1, 0]]}
    limits_deg: [-110, 110]
    link: {mass_kg: 4, com_m: [0.3, 0, 0.1], inertia_kgm2: {xx: 0.05, yy: 0.05, zz: 0.05}}
    torque_measured_at: joint
  - name: slide
    type: prismatic
    frame: {position_m: [0.5, 0, 0], rotation: [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}
    limits_m: [-0.4, 0.4]
    link: {mass_kg: 3, com_m: [0.2, 0.01, 0], inertia_kgm2: {xx: 0.02, yy: 0.05, zz: 0.05}}
    torque_measured_at: joint
"""
SENSOR = "torque_measured_at: joint"
MOTOR = "motor: {inertia_kgm2: 2.0e-4, gear_ratio: 60}"
EXPERIMENT = """schema_version: 1
name: sensed
robot: robot.yaml
campaigns:
  motion: {source: {acquire: &log {file: motion.csv, sampling_period_s: 2.0e-3, one_shot: true, time: {variable: t},
    inputs: [
      {name: turn.arm, variable: u1, hold: band_limited},
      {name: lift.arm, variable: u2, hold: band_limited},
      {name: slide.arm, variable: u3, unit: N, hold: band_limited}],
    outputs: [
      {name: turn.arm, variable: q1}, {name: lift.arm, variable: q2}, {name: slide.arm, variable: q3, unit: m}]}}}
  other: {source: {acquire: {<<: *log, file: other.csv}}}
fits:
  arm: {family: rigid, from: motion, validate_on: other, filters: {position_cut_hz: 10}}
execution: {backend: serial}
"""


def true_values(model: RigidModel) -> np.ndarray:
    """Standard parameters that are off the robot file's, with friction and offsets."""
    values = model.nominal.copy()
    for index, (name, kind) in enumerate(zip(model.names, model.kinds, strict=True)):
        own = 1 + 0.05 * (index % 5)
        friction = {"viscous": 2.0 * own, "coulomb": 1.0 * own, "torque_offset": 0.3 * own}
        small = 1 / 60 if name.startswith("turn") and "turn.motor_inertia" in model.names else 1.0
        values[index] = friction[kind] * small if kind in friction else values[index] * own
    return values


def write_logs(folder, robot, noise=0.0, n_sample=4000):
    """Writes two motions of the arm with the torques that its joints feel, arm side; returns what they are made of."""
    model = build_rigid_model(robot)
    values = true_values(model)
    for seed, name in enumerate(("motion", "other")):
        motion = fourier_motion(robot, n_sample, seed)
        torque = model.torques(values, *(motion @ robot.motor_per_arm.T)) @ robot.motor_per_arm
        torque += noise * torque.std(axis=0) * np.random.default_rng(seed).standard_normal(torque.shape)
        table = np.column_stack([PERIOD_S * np.arange(n_sample), motion[0], torque])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="t,q1,q2,q3,u1,u2,u3", comments="")
    return model, values
