"""Gears that stiffen under load: cubic coefficients from one and from two amplitudes, and what they are worth."""

import json
from pathlib import Path

import pytest

from robid.cli import run_command

EXAMPLE = Path(__file__).parents[2] / "configs" / "kr300_stiffening.yaml"

pytestmark = pytest.mark.slow


def test_cubic_coefficients_of_the_simulated_robot(tmp_path):
    assert run_command(["run", str(EXAMPLE), "--run-dir", str(tmp_path)]) == 5
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["fits.linear.grade"] == 0  # it lacks what the others have
    assert summary["fits.linear.springs.worst_error"] > 0.1

    def row(fit, axis):
        prefix = f"fits.{fit}.parameters.gear_{axis}.cubic"
        return {key: summary[f"{prefix}.{key}"] for key in ("estimate", "truth", "identifiable", "covered")}

    for fit in ("one_amplitude", "two_amplitudes"):
        rows = {axis: row(fit, axis) for axis in range(1, 7)}
        errors = {axis: each["estimate"] / each["truth"] - 1 for axis, each in rows.items()}
        print(fit, {axis: f"{100 * error:+.1f} %" for axis, error in errors.items()})
        assert max(abs(errors[2]), abs(errors[3])) < 0.03
        assert all(each["covered"] for each in rows.values() if each["identifiable"])
        assert rows[2]["identifiable"] == rows[3]["identifiable"] == 1
        assert summary[f"fits.{fit}.springs.worst_error"] < 0.02
        assert summary[f"fits.{fit}.grade"] > 0
    assert row("one_amplitude", 1)["identifiable"] == 0
    assert row("two_amplitudes", 1)["identifiable"] == 1
    print({key: value for key, value in summary.items() if "cubic." in key and "parameters" not in key})
    assert summary["cubic.max_relative_error"] < 0.1
    assert summary["cubic.cost_ratio"] < 0.5
