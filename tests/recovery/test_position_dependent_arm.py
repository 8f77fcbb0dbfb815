"""Axis 1 of a simulated arm over the angle of axis 2: the model meets the true robot at angles that no fit has seen."""

import json
from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.cli import run_command
from robid.models.known import load_experiment
from robid.models.lpv.family import evaluate
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.truth import true_robot

EXAMPLE = Path(__file__).parents[2] / "configs" / "kr300_lpv.yaml"

pytestmark = pytest.mark.slow


def true_response(configurations, frequency_hz):
    """Of the true robot without friction: motor 1 by its own torque (n_conf, n_freq)."""
    loaded = load_experiment(EXAMPLE)
    source = loaded.experiment.campaigns["left_out"].source.simulate
    robot, controller = true_robot(loaded.robot.to_robot(), source.truth), loaded.robot.controller
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    nominal = nominal_parameters(robot, linear, controller.delay_samples * controller.sampling_period_s)
    return response(linear, nominal, frequency_hz, controller.sampling_period_s).sampled[..., 0, 0]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm") / "run"
    assert run_command(["run", str(EXAMPLE), "--run-dir", str(folder)]) == 0
    return folder, json.loads((folder / "summary.json").read_text())


def test_the_response_of_axis_1_is_that_of_the_true_robot_at_angles_left_out(done):
    folder, summary = done
    frf = frf_from_artifact(read_artifact(folder / "left_out" / "frf.h5", FRF))
    exact = true_response(frf.configurations, frf.frequency_hz)
    model = evaluate(folder / "fits" / "axis_1" / "model.h5")
    found = model.frozen_response(frf.configurations[:, [1]], frf.frequency_hz)[..., 0, 0]
    decibels = np.abs(20 * np.log10(np.abs(found / exact)))
    shift = np.abs(np.argmax(np.abs(found), axis=1) - np.argmax(np.abs(exact), axis=1))
    beside = true_response(np.radians([[0, -110, 60, 0, 30, 0]]), frf.frequency_hz)[0]
    nearest = np.median(np.abs(20 * np.log10(np.abs(beside / exact[0]))))
    print(f"off by {np.median(decibels):.3f} dB (median); a fitted position 7 degrees away by {nearest:.2f} dB;")
    print({key: value for key, value in summary.items() if "share" in key or "excess" in key})
    assert np.median(decibels) < 0.1
    assert nearest > 0.5
    assert np.all(shift <= 1)
    assert summary["fits.axis_1.blocks_dropped"] > 0


@pytest.mark.xfail(
    strict=True, reason="0.15 at the resonance: five states miss these data by eight deviations; more are unstable"
)
def test_no_line_is_far_off(done):
    assert done[1]["fits.axis_1.validation.excess"] < 0.12
