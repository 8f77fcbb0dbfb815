"""A long record of a six-axis robot, and its base parameters by Huber's estimator: for speed and memory.

Run as a script it prints by how much the estimate of so many samples raises this process's memory.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from default_campaign import ROBOT
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.regression import huber, reduce_rows
from robid.models.rigid.fit.rows import Reading, Remembered, prepare
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import build_rigid_model

PERIOD_S = 1e-3
OPTIONS = PreprocessingOptions(position_cut_hz=50.0, decimation=10)
_REPEATED = 20_000
_BLOCK = 1000


def arm_motion(n_sample):
    """Positions, speeds and accelerations (3, n_sample, 6) of the arm, ever the same 20 s."""
    generator = np.random.default_rng(1)
    line = np.arange(1, 21)[:, None, None]
    rate = 2 * np.pi * line / (_REPEATED * PERIOD_S)
    level = generator.uniform(0.2, 1, (20, 1, 6)) / line
    angle = rate * (PERIOD_S * np.arange(_REPEATED))[:, None] + generator.uniform(0, 2 * np.pi, level.shape)
    waves = np.stack([level * np.sin(angle), rate * level * np.cos(angle), -(rate**2) * level * np.sin(angle)]).sum(1)
    middle, half = (ROBOT.upper + ROBOT.lower) / 2, (ROBOT.upper - ROBOT.lower) / 2
    waves *= 0.7 * half / np.abs(waves[0]).max(axis=0)
    waves[0] += middle
    return np.tile(waves, (1, -(-n_sample // _REPEATED), 1))[:, :n_sample]


def long_record(n_sample):
    """Motor positions and torques (n_sample, 6) with noise, a few of whose samples are far off."""
    model, generator = build_rigid_model(ROBOT), np.random.default_rng(2)
    motion = arm_motion(min(n_sample, _REPEATED)) @ ROBOT.motor_per_arm.T
    torque = model.torques(model.nominal, *motion)
    times = -(-n_sample // len(torque))
    position, torque = np.tile(motion[0], (times, 1))[:n_sample], np.tile(torque, (times, 1))[:n_sample]
    size = torque.std(axis=0)
    for first in range(0, n_sample, _BLOCK):
        part = torque[first : first + _BLOCK]
        noise = generator.standard_normal(part.shape)
        noise[generator.random(part.shape) < 0.02] *= 20
        part += 0.05 * size * noise
    return position, torque


def estimate(position, torque):
    """Huber's estimate of the base parameters, from the samples on."""
    model = build_rigid_model(ROBOT)
    base = find_base_parameters(model)
    motion = prepare(position, torque, PERIOD_S, OPTIONS)
    rows = Remembered(Reading([motion], model.only(base.columns.tolist()), OPTIONS.decimator(PERIOD_S)))
    return base, huber(rows, reduce_rows(rows))


def _memory_bytes(kind):
    """Memory of this process as Linux counts it: VmRSS now, VmHWM at its highest."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{kind}:"))


if __name__ == "__main__":
    estimate(*long_record(30_000))  # what is imported on the way
    record = long_record(int(sys.argv[1]))
    before = _memory_bytes("VmRSS")
    estimate(*record)
    print(_memory_bytes("VmHWM") - before)  # noqa: T201
