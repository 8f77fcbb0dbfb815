"""What a slow motion leaves of the bias that friction gives an uncompensated response."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.excitation.excitation import design_signal
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.known import load_experiment
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Imperfections, SimulateOptions

CONFIGS = Path(__file__).parents[2] / "configs"
CONFIGURATION = np.deg2rad([20.0, -70.0, 80.0, 30.0, 40.0, 10.0])


def bias(loaded, slow_rad_s, line):
    """Median over lines and motors of the diagonal's relative distance from the frictionless linearisation."""
    robot, controller = loaded.robot.to_robot(), loaded.robot.controller
    options = loaded.experiment.campaigns["estimation"].excitation
    options = replace(options, slow_motion_rad_s=slow_rad_s, slow_motion_line=line, phase_iterations=10)
    excitation = design_signal(options, 6, 1, controller.sampling_period_s)
    experiment = SimulatedExperiment(
        robot=robot,
        controller=controller,
        options=SimulateOptions(imperfections=Imperfections(friction="lugre")),
        reference=excitation.reference,
        inject=excitation.kind,
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=1,
    )
    record = simulate(experiment, CONFIGURATION, 0, 2)
    found = estimate_frf(record, EstimateOptions(compensation="none")).response[0]
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, CONFIGURATION[None]))
    nominal = nominal_parameters(robot, linear, controller.delay_samples * controller.sampling_period_s)
    exact = response(linear, nominal, record.frequency_hz, controller.sampling_period_s).sampled[0]
    return float(np.median(np.abs(np.einsum("kii->ki", found) / np.einsum("kii->ki", exact) - 1)))


@pytest.mark.slow
def test_a_slow_motion_takes_most_of_the_bias_of_friction():
    loaded = load_experiment(CONFIGS / "kr300.yaml")
    without, slow, fast = bias(loaded, 0.0, 2), bias(loaded, 20.0, 2), bias(loaded, 60.0, 4)
    assert without > 0.08
    assert slow < 0.65 * without
    assert fast < 0.25 * without
