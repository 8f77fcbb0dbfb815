"""Logs of a rigid arm on smooth large motions, and the experiments that read them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.models.rigid.fit.shots import Shot
from robid.robot.regressor.model import build_rigid_model

PERIOD_S = 2e-3
_FUNDAMENTAL_HZ = 0.2
_HARMONICS = 5


def fourier_motion(robot, n_sample, seed=0, share=0.6):
    """Positions, speeds and accelerations (3, n_sample, n_joint) of the arm over a share of the joints' ranges."""
    generator = np.random.default_rng(seed)
    order = np.arange(1, _HARMONICS + 1)[:, None, None]
    rate = 2 * np.pi * _FUNDAMENTAL_HZ * order
    level = generator.uniform(0.3, 1, (_HARMONICS, 1, len(robot.joints))) / order
    angle = rate * (PERIOD_S * np.arange(n_sample))[:, None] + generator.uniform(0, 2 * np.pi, level.shape)
    waves = [level * np.sin(angle), rate * level * np.cos(angle), -(rate**2) * level * np.sin(angle)]
    size = share * (robot.upper - robot.lower) / 2 / np.abs(waves[0].sum(axis=0)).max(axis=0)
    position, velocity, acceleration = (size * wave.sum(axis=0) for wave in waves)
    return np.stack([position + (robot.upper + robot.lower) / 2, velocity, acceleration])


def shot_along(robot, motion, noise=0.01, seed=0):
    """What a motor-side log of a rigid robot holds along a motion (3, n_sample, n_joint) of its arm."""
    model = build_rigid_model(robot)
    position, velocity, acceleration = motion @ robot.motor_per_arm.T
    torque = model.torques(model.nominal, position, velocity, acceleration)
    torque += noise * torque.std(axis=0) * np.random.default_rng(seed).standard_normal(torque.shape)
    return Shot(position, torque, PERIOD_S, held=False)


def with_masses(robot, factors):
    """The robot with its links' masses and inertias multiplied."""
    joints = tuple(
        replace(
            joint,
            link=replace(joint.link, mass_kg=f * joint.link.mass_kg, inertia_kgm2=f * joint.link.inertia_kgm2),
        )
        for joint, f in zip(robot.joints, factors, strict=True)
    )
    return replace(robot, joints=joints)


def write_log(path, shot, time_s=None):
    """Writes a shot as a table: `t`, then `q1`, `u1` and so on, on the motor side."""
    time = PERIOD_S * np.arange(len(shot.position)) if time_s is None else time_s
    n_joint = shot.position.shape[1]
    names = ["t", *(f"{kind}{index + 1}" for kind in "qu" for index in range(n_joint))]
    table = np.column_stack([time, shot.position, shot.torque])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
