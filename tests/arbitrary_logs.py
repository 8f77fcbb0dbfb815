"""Logs of simulated robots that play what nobody here designed: noise, a swept sine, moves of a production cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import savemat
from scipy.signal import butter, sosfilt

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions

STEP_S = 1e-3


def white_noise(n_sample: int, n_motor: int, seed: int, *, rms: float = 6.0, high_hz: float = 100.0) -> FloatArray:
    """A speed reference (n_sample, n_motor) of noise up to a frequency, each motor its own [rad/s]."""
    noise = np.random.default_rng(seed).standard_normal((n_sample, n_motor))
    filtered = sosfilt(butter(4, high_hz, fs=1 / STEP_S, output="sos"), noise, axis=0)
    return rms * filtered / filtered.std(axis=0)


def swept_sine(n_sample: int, n_motor: int, seed: int, *, peak: float = 8.0) -> FloatArray:
    """A speed reference of sines that sweep to and fro in a time that is no part of the log, shifted per motor."""
    generator = np.random.default_rng(seed)
    time = STEP_S * np.arange(n_sample)
    columns = []
    for _ in range(n_motor):
        sweep_s, start = generator.uniform(3.7, 5.3), generator.uniform(0, 1)
        turn = (time / sweep_s + start) % 1.0
        frequency = 1.0 * 80.0 ** (1 - np.abs(2 * turn - 1))
        columns.append(peak * np.sin(2 * np.pi * STEP_S * np.cumsum(frequency) + generator.uniform(0, 2 * np.pi)))
    return np.stack(columns, axis=1)


def production_moves(n_sample: int, n_motor: int, seed: int, *, peak: float = 12.0) -> FloatArray:
    """A speed reference of short moves to and fro with pauses between them, each with ramps of its own."""
    generator = np.random.default_rng(seed)
    speed = np.zeros((n_sample, n_motor))
    for motor in range(n_motor):
        at, sign = 0, 1.0
        while at < n_sample:
            ramp, cruise, pause = generator.integers(4, 40), generator.integers(0, 60), generator.integers(5, 80)
            up = np.sin(np.linspace(0, np.pi / 2, ramp)) ** 2
            move = sign * peak * generator.uniform(0.4, 1) * np.concatenate([up, np.ones(cruise), up[::-1]])
            part = move[: n_sample - at]
            speed[at : at + len(part), motor] = part
            at, sign = at + len(move) + pause, -sign
    return speed


SIGNALS = {"noise": white_noise, "sweep": swept_sine, "moves": production_moves}


def play(robot: Robot, reference: FloatArray, configuration: FloatArray, flaws: Imperfections, seed: int = 1) -> Record:
    """Plays speed references (n_exp, n_sample, n_motor) once, from rest."""
    lines = np.arange(1, int(100 * STEP_S * reference.shape[1]))
    experiment = SimulatedExperiment(
        robot=robot,
        controller=Controller(sampling_period_s=STEP_S),
        options=SimulateOptions(transient_periods=0, imperfections=flaws, seed=seed),
        reference=reference[None],
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        periods=1,
    )
    return simulate(experiment, configuration, 0)


def write_logs(record: Record, folder: Path) -> None:
    """Writes one MAT log for each experiment of a record."""
    folder.mkdir(exist_ok=True)
    for index in range(record.inputs.shape[2]):
        variables = {
            "torque": record.inputs[0, 0, index, 0],
            "angle": record.outputs[0, 0, index, 0] + record.output_offset[0],
            "reference": record.reference[0, 0, index],
        }
        savemat(folder / f"log{index + 1}.mat", variables)


def truth(robot: Robot, configuration: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
    """The linearised robot's sampled response (n_freq, n_motor, n_motor) from torque command to acceleration."""
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configuration[None]), tuple(j.name for j in robot.joints))
    return response(linear, nominal_parameters(robot, linear, STEP_S), frequency_hz, STEP_S).sampled[0]
