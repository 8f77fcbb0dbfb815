"""The examples of machines known by their logs alone, through the command line, against their published figures."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.models.external.files import solution_from_artifact

CONFIGS = Path(__file__).parents[2] / "configs"
CABLE_M = 0.4557


@pytest.fixture
def example(shop, data_folder, monkeypatch):
    """Runs an example in a folder of its own; its exit code, summary and solution."""

    def run(name, folder, fit):
        monkeypatch.setenv("ROBID_DATA", str(data_folder(folder).parent.resolve()))
        shutil.copy(CONFIGS / f"{name}.yaml", shop.folder)
        answer = shop.robid("run", f"{name}.yaml")
        runs = shop.folder / "runs" / name
        summary = json.loads((runs / "summary.json").read_text())
        found = {key.removeprefix(f"fits.{fit}."): value for key, value in summary.items()}
        model = solution_from_artifact(read_artifact(runs / "fits" / fit / "model.h5", MODEL))
        return answer, found, model, (runs / "report.html").read_text()

    return run


def test_the_ball_screw_in_its_loop_is_two_poles(example):
    answer, found, model, page = example("emps_loop", "emps", "loop")
    assert answer.code == 0, answer.err
    assert found["parameters.carriage.pole1.frequency.estimate"] == pytest.approx(126.4, rel=0.01)
    assert found["parameters.carriage.pole1.damping.estimate"] == pytest.approx(0.414, rel=0.01)
    measured, simulated = model.traces.measured, model.traces.simulated
    relative = np.linalg.norm(measured - simulated) / np.linalg.norm(measured)
    assert relative <= 5e-5  # published: 0.005 %
    assert "known by its logs alone" in page


def test_the_crane_is_an_integrator_and_a_pendulum_and_says_what_it_cannot(example):
    answer, found, model, page = example("crane", "crane", "crane")
    assert answer.code == 5, answer.err  # friction damps the load differently in both recordings
    assert "cable is predicted with an NRMSE" in answer.err
    assert (found["cart.poles"], found["cart.zeros"], found["cable.poles"], found["cable.zeros"]) == (1, 0, 2, 1)
    assert abs(found["parameters.cart.pole1.estimate"]) < 2e-3  # rad/s, of a band that begins at 0.04
    gain = model.transfer(0).numerator[0, 0, 0]
    assert gain == pytest.approx(0.59, rel=0.05)
    pendulum_hz = found["parameters.cable.pole1.frequency.estimate"] / (2 * np.pi)
    assert pendulum_hz == pytest.approx(np.sqrt(9.81 / CABLE_M) / (2 * np.pi), rel=0.01)
    assert found["validation.cart.nrmse"] > 0.95
    assert model.coupling.own.all()
    assert re.findall(r'data-option="(\w+)"', page)[:2] == ["cart", "cable"]
