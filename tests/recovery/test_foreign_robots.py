"""Robots from rigid MJCF and URDF files, end to end: springs off by up to a factor of 2 come back."""

import json
from pathlib import Path

import pytest

from robid.cli import run_command

CONFIGS = Path(__file__).parents[2] / "configs"

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("name", "n_gear"), [("ur5e", 6), ("kr210", 6), ("iiwa14", 7)])
def test_all_gears_of_a_foreign_robot_come_back(data_folder, monkeypatch, tmp_path, name, n_gear):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("robot_models").parent))
    assert run_command(["run", str(CONFIGS / f"{name}.yaml"), "--run-dir", str(tmp_path / "run")]) == 0
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    start, errors, deviations = "fits.elastic.parameters.", {}, []
    for key in summary:
        if key.startswith(f"{start}gear_") and key.endswith(".stiffness.truth"):
            stem = key.removesuffix("truth")
            errors[key] = abs(summary[f"{stem}estimate"] / summary[key] - 1)
            deviations.append(summary[key] / summary[f"{stem}nominal"])
    assert len(errors) == n_gear
    assert max(errors.values()) < 0.03
    assert max(deviations) > 1.2
    assert min(deviations) < 0.8
