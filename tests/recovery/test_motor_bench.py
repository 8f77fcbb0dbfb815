"""A measured two-inertia drive through the whole chain, against the figures that come with its recording."""

import json
from pathlib import Path

import pytest

from robid.cli import run_command

CONFIG = Path(__file__).parents[2] / "configs/motor_bench.yaml"
# Relative to the torque constant; resonances in Hz.
REFERENCE = {
    "coupling.stiffness": (546.4, 0.01),
    "drive.motor_inertia": (4.780e-3, 0.01),
    "drive.link_inertia": (4.752e-3, 0.01),
}
MODES = {"antiresonance": 53.97, "resonance": 76.21}


def test_the_drive_is_that_of_its_reference(data_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("motor_bench").parent))
    monkeypatch.chdir(tmp_path)
    assert run_command(["run", str(CONFIG)]) == 5, "the drive has more than two inertias and a spring"
    told = capsys.readouterr().out
    assert "Do not use: the error of the fit's own data costs" in told
    assert "dB" not in told.partition("Do not use")[2], "the responses are met in the median"
    summary = json.loads((tmp_path / "runs/motor_bench/summary.json").read_text())
    for name, (value, tolerance) in REFERENCE.items():
        assert summary[f"fits.two_mass.parameters.{name}.estimate"] == pytest.approx(value, rel=tolerance)
    for kind, hz in MODES.items():
        found = [
            v for key, v in summary.items() if f".{kind}" in key and key.endswith(".model_hz") and ".drive." in key
        ]
        assert min(abs(value / hz - 1) for value in found) < 0.003, (kind, found)
