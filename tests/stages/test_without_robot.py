"""An experiment of logs alone: a robot of which nothing but commands and positions is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.models import known as files
from robid.models.known import load_experiment
from toy_family import INERTIA

OWN = replace(INERTIA, needs_robot=False)
N_SAMPLE, STEP = 600, 0.01
EXPERIMENT = """schema_version: 1
name: small
campaigns:
  chirps: &campaign
    excitation: &excitation {signal: chirp, grid: full, period_s: 6, low_hz: 0.5, high_hz: 5}
    realizations: 2
    periods: 3
    source: &source
      acquire: &log
        file: chirp_{experiment}_{realization}.csv
        format: csv
        sampling_period_s: 0.01
        inputs:
          - {name: X, variable: sol_x, unit: mm, quantity: position_command, side: tool}
          - {name: A, variable: sol_a, unit: deg, quantity: position_command, side: tool}
        outputs: [{name: X, variable: ist_x, unit: mm, side: tool}, {name: A, variable: ist_a, unit: deg, side: tool}]
  other: {<<: *campaign, source: {acquire: {<<: *log, file: "other_{experiment}_{realization}.csv"}}}
fits:
  own: {family: inertia, from: chirps, validate_on: other}
execution: {backend: serial}
"""


def write_logs(folder, seed, name):
    generator = np.random.default_rng(seed)
    share = np.arange(N_SAMPLE) / N_SAMPLE
    wave = np.tile(np.sin(np.pi * share) * np.sin(2 * np.pi * (3 * share + 14 * share**2)), 4)
    for experiment, realization in np.ndindex(2, 2):
        command = np.zeros((4 * N_SAMPLE, 2))
        command[:, experiment] = wave
        answer = lfilter([0, 0.1], [1, -0.9], command, axis=0) + 1e-4 * generator.normal(size=command.shape)
        answer[:, 1] = (answer[:, 1] + 359.9) % 360 - 180  # A rests where it wraps
        path = folder / f"{name}_{experiment + 1}_{realization + 1}.csv"
        table = np.hstack([command, answer])[N_SAMPLE:]
        np.savetxt(path, table, delimiter=",", header="sol_x,sol_a,ist_x,ist_a", comments="")


@pytest.fixture
def logs(shop, monkeypatch):
    monkeypatch.setattr(files, "FAMILIES", {**files.FAMILIES, "inertia": OWN})
    (shop.folder / "arm.yaml").unlink()
    (shop.folder / "small.yaml").write_text(EXPERIMENT)
    for seed, name in enumerate(("chirp", "other")):
        write_logs(shop.folder, seed, name)
    return shop


def test_every_command_does_without_a_robot(logs):
    answer = logs.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    states = logs.states()
    assert states["fits/own/validation.h5"][0] == "fresh"
    page = (logs.runs / "report.html").read_text()
    assert "Excitation plan" in page
    assert "Configurations</" not in page
    assert logs.robid("inspect", str(logs.runs / "chirps" / "record.h5")).code == 0
    assert logs.robid("export", "small.yaml", "--format", "json").code == 0
    assert "fresh" in logs.robid("run", "small.yaml").err + logs.robid("status", "small.yaml").out


def test_the_record_is_a_block_of_chirps_whose_angles_do_not_jump(logs):
    assert logs.robid("run", "small.yaml").code == 0
    record = record_from_artifact(read_artifact(logs.runs / "chirps" / "record.h5", RECORD))
    assert record.inputs.shape == record.outputs.shape == (1, 2, 2, 3, N_SAMPLE, 2)
    assert record.configurations.shape == (1, 0)
    assert np.ptp(record.outputs[..., 1]) < 0.1
    moved = np.ptp(record.inputs, axis=(0, 1, 3, 4)) > 0
    assert moved.tolist() == [[True, False], [False, True]]


def test_its_frequency_response_is_that_of_the_filter(logs):
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = logs.robid(stage, "small.yaml", "--campaign", "chirps")
        assert answer.code == 0, answer.err
    frf = frf_from_artifact(read_artifact(logs.runs / "chirps" / "frf.h5", FRF))
    z = np.exp(2j * np.pi * frf.frequency_hz * STEP)
    exact = 0.1 / z / (1 - 0.9 / z)
    for channel in range(2):
        found = frf.response[0, :, channel, channel]
        assert np.median(np.abs(found / exact - 1)) < 5e-3


NEAR = "    realizations: 2\n"
LISTED = "        inputs:\n"


@pytest.mark.parametrize(
    ("old", "new", "place", "what"),
    [
        (NEAR, f"{NEAR}    configurations: {{list_deg: [[1]]}}\n", "campaigns.chirps.configurations", "S147"),
        (NEAR, f"{NEAR}    payload_kg: 3\n", "payload_kg", "S150"),
        (NEAR, f"{NEAR}    estimate: {{compensation: nominal}}\n", "estimate.compensation", "S152"),
        ("family: inertia", "family: rigid", "robot: S147 is missing", "`fits.own` (family rigid)"),
        (
            "fits:\n",
            "designs: {best: {campaign: chirps, count: 1}}\nfits:\n",
            "robot: S147 is missing",
            "`designs.best`",
        ),
        ("low_hz: 0.5", "low_hz: 60", "campaigns.chirps.excitation", "60"),
        (LISTED, f"        references: [{{name: X, variable: sol_x}}]\n{LISTED}", "references", "needs `robot`"),
    ],
)
def test_what_needs_a_robot_is_said_with_its_place(logs, old, new, place, what):
    logs.change(old, new)
    logs.refuse(2, place, what)


def test_a_simulation_needs_a_robot(logs):
    text = EXPERIMENT[: EXPERIMENT.index("    source:")] + "    source: {simulate: {seed: 1}}\n"
    (logs.folder / "small.yaml").write_text(text)
    logs.refuse(2, "robot: S147 is missing", "`campaigns.chirps.source` (a simulation)")


def test_a_robot_that_is_named_must_be_there(logs):
    logs.change("name: small\n", "name: small\nrobot: nowhere.yaml\n")
    logs.refuse(2, "robot", "nowhere.yaml")


def test_an_experiment_without_a_robot_has_one_without_joints(logs):
    loaded = load_experiment(logs.folder / "small.yaml")
    assert (loaded.robot.name, loaded.robot.joints, loaded.robot_path) == ("small", (), None)


def test_shots_may_be_given_one_after_the_other(logs):
    logs.change("        sampling_period_s: 0.01\n", "        sampling_period_s: 0.01\n        one_shot: true\n")
    logs.change("    periods: 3\n", "    experiments: 2\n")
    assert logs.robid("simulate-or-acquire", "small.yaml", "--campaign", "chirps").code == 0
    record = record_from_artifact(read_artifact(logs.runs / "chirps" / "record.h5", RECORD))
    assert record.inputs.shape == (1, 2, 2, 1, 3 * N_SAMPLE, 2)
