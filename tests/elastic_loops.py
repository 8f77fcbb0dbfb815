"""Closed-loop experiments on small elastic arms, and the analytic responses that they must give."""

from dataclasses import replace

import numpy as np

from exact_systems import two_joint_robot
from robid.frf.options import EstimateOptions
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment
from robid.simulate.options import Controller, SimulateOptions

PLAIN = EstimateOptions(compensation="none")
CONFIGURATION = np.array([0.3, -0.8])


def odd_lines(period_s, count, low_hz=2.0, high_hz=80.0):
    lines = np.unique(np.round(np.geomspace(low_hz * period_s, high_hz * period_s, count) / 2).astype(int) * 2 + 1)
    return lines[lines < high_hz * period_s]


def experiment(robot=None, *, period_s=2.0, rms=5.0, count=25, inject="speed_reference", realizations=1, **options):
    robot = robot or two_joint_robot()
    controller = Controller()
    n_motor, n_sample = len(robot.joints), round(period_s / controller.sampling_period_s)
    lines = odd_lines(period_s, count)
    amplitude = np.full((n_motor, lines.size), rms * np.sqrt(2 / lines.size))
    phase = np.random.default_rng(5).uniform(0, 2 * np.pi, (realizations, n_motor, lines.size))
    reference = time_signal(multisine(amplitude, phase), lines, n_sample)
    return SimulatedExperiment(
        robot=robot,
        controller=controller,
        options=SimulateOptions(**options),
        reference=reference,
        inject=inject,
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        periods=1,
    )


def analytic(robot, configuration, frequency_hz, controller, outputs=None, rates=()):
    model = build_model(robot, balanced=True)
    linear = replace(linearize(model, solve_statics(model, configuration[None]), outputs), rates=rates)
    delay_s = controller.delay_samples * controller.sampling_period_s
    parameters = nominal_parameters(robot, linear, delay_s)
    return response(linear, parameters, frequency_hz, controller.sampling_period_s).sampled


def diagonal(frf_response):
    return np.diagonal(frf_response, axis1=2, axis2=3)
