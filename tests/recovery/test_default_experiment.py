"""The default experiment over ten seeds, and the figures that the noise-free robot must reach."""

import json
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.cli import run_command
from robid.models.known import load_experiment
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.truth import true_robot

CONFIGS = Path(__file__).parents[2] / "configs"
SEEDS = range(1, 11)

pytestmark = pytest.mark.slow


def reseeded(name, seed, folder):
    """Writes a copy of an example whose truth, noise and phases come from other seeds."""
    yaml = YAML(typ="safe")
    plain = yaml.load((CONFIGS / name).read_text())
    plain["robot"] = str(CONFIGS / plain["robot"])
    for number, campaign in enumerate(("estimation", "validation")):
        plain["campaigns"][campaign]["excitation"]["seed"] = 10 * seed + number
        simulate = plain["campaigns"][campaign]["source"]["simulate"]
        simulate["seed"] = 10 * seed + number
        simulate["truth"]["seed"] = seed
    plain["fits"]["elastic"]["bootstrap"] = 100
    path = folder / f"{seed}.yaml"
    with path.open("w") as stream:
        yaml.dump(plain, stream)
    return path


def parameters(folder):
    """Returns the fit's flat summary as one dict per parameter."""
    summary = json.loads((folder / "summary.json").read_text())
    rows = {}
    for key, value in summary.items():
        parts = key.split(".")
        if parts[:3] == ["fits", "elastic", "parameters"]:
            rows.setdefault(".".join(parts[3:-1]), {})[parts[-1]] = value
    return rows


def test_ten_seeds_recover_springs_and_intervals_hold(tmp_path):
    within, covered, repeated, half_width, starts = [], {}, [], [], []
    for seed in SEEDS:
        folder = tmp_path / f"run{seed}"
        assert run_command(["run", str(reseeded("kr300.yaml", seed, tmp_path)), "--run-dir", str(folder)]) == 0
        rows = parameters(folder)
        springs = {name: row for name, row in rows.items() if name.endswith(".stiffness")}
        errors = {name: abs(row["estimate"] / row["truth"] - 1) for name, row in springs.items()}
        within.append(sum(error <= 0.02 for error in errors.values()))
        half_width.append(np.median([(r["upper"] - r["lower"]) / (2 * r["estimate"]) for r in springs.values()]))
        for name, row in rows.items():
            if row["identifiable"] and row.get("truth") is not None:
                covered.setdefault(name, []).append(row["lower"] <= row["truth"] <= row["upper"])
                repeated.append(row["bootstrap_lower"] <= row["truth"] <= row["bootstrap_upper"])
        summary = json.loads((folder / "summary.json").read_text())
        starts.append(summary["fits.elastic.starts_at_best"] / summary["fits.elastic.starts"])
        print(
            f"seed {seed}: {within[-1]} springs within 2 %, worst {max(errors.values()):.2%}, starts {starts[-1]:.0%}"
        )
    shares = {name: float(np.mean(hits)) for name, hits in covered.items()}
    for name, share in sorted(shares.items(), key=lambda item: item[1]):
        print(f"{name}: interval holds the truth in {share:.0%} of {len(covered[name])} seeds")
    coverage = np.mean(list(shares.values()))
    print(f"springs within 2 %, median seed: {np.median(within)}")
    print(f"all imperfections: coverage_95 {coverage:.3f}, bootstrap {np.mean(repeated):.3f} ({len(SEEDS)} seeds)")
    print(f"median spring half-width: {np.median(half_width):.3%}; share of starts at the best minimum: {starts}")
    assert np.median(within) >= 12
    assert coverage >= 0.8
    assert np.median(half_width) <= 0.03
    assert min(starts) >= 0.95


def test_noise_free_robot_costs_no_accuracy(tmp_path):
    path = CONFIGS / "kr300_linear.yaml"
    assert run_command(["run", str(path), "--run-dir", str(tmp_path / "run")]) == 0
    frf = frf_from_artifact(read_artifact(tmp_path / "run" / "estimation" / "frf.h5", FRF))
    loaded = load_experiment(path)
    robot = true_robot(loaded.robot.to_robot(), loaded.experiment.campaigns["estimation"].source.simulate.truth)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, frf.configurations))
    period = loaded.robot.controller.sampling_period_s
    nominal = nominal_parameters(robot, linear, loaded.robot.controller.delay_samples * period)
    exact = response(linear, nominal, frf.frequency_hz, period).sampled
    error = np.median(np.abs(np.diagonal(frf.response / exact, axis1=2, axis2=3) - 1))
    errors = {name: row["estimate"] / row["truth"] - 1 for name, row in parameters(tmp_path / "run").items()}
    worst = max(errors, key=lambda name: abs(errors[name]))
    print(f"median error of the diagonal {error:.2e}; worst parameter {worst} {errors[worst]:+.4%}")
    assert error < 5e-4
    assert abs(errors[worst]) < 5e-3
