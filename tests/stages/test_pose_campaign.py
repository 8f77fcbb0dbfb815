"""A campaign of pose commands goes through the chain: designed, simulated, estimated, exported, told what is wrong."""

import csv
import re
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.kinds import (
    EXCITATION,
    FRF,
    RECORD,
    excitation_from_artifact,
    frf_from_artifact,
    record_from_artifact,
)
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.design.excitation.options import PoseChirpOptions
from robid.models.known import load_experiment
from robid.pipeline.graph import graph
from robid.settings.robot_parts import tool_arm
from robid.simulate.pose_response import pose_response

HERE = Path(__file__).parent
FILE = "pose.yaml"


def prepared(shop):
    shop.experiment, shop.runs = FILE, shop.folder / "runs" / "pose"
    for name in (FILE, "pose_arm.yaml"):
        shutil.copy(HERE / name, shop.folder)
    return shop


@pytest.fixture
def poses(shop):
    """A folder with the experiment, not run yet."""
    return prepared(shop)


@pytest.fixture(scope="module")
def moved(tmp_path_factory, workshop):
    """A run that many tests look at, with the responses."""
    with pytest.MonkeyPatch.context() as patch:
        shop = prepared(workshop(tmp_path_factory.mktemp("moved"), patch))
        answer = shop.robid("run", FILE)
        assert answer.code == 0, answer.err
        assert "warning" not in answer.err
        for campaign in ("moved", "watched"):
            assert shop.robid("estimate-frf", FILE, "--campaign", campaign).code == 0
        yield shop


def read(shop, path, kind, convert):
    return convert(read_artifact(shop.runs / path, kind))


def test_commands_and_measured_poses_are_recorded(moved):
    excitation = read(moved, "moved/excitation.h5", EXCITATION, excitation_from_artifact).excitation
    assert excitation.reference.shape == (1, 3, 250, 3)
    record = read(moved, "moved/record.h5", RECORD, record_from_artifact)
    assert record.inputs.shape == record.outputs.shape == (2, 1, 3, 2, 250, 3)
    assert record.sampling_period_s == 0.012
    assert record.input_names == record.output_names == ("X", "R", "A")
    np.testing.assert_allclose(record.inputs[1, 0, :, 1], excitation.reference[0], atol=1e-9)
    peak = np.abs(record.outputs).max(axis=(0, 1, 2, 3, 4)) / np.abs(excitation.reference).max(axis=(0, 1, 2))
    assert (peak > 0.7).all()
    assert (peak < 1.3).all()
    truth = read_truth(moved.runs / "moved/truth.json", moved.runs / "moved/record.h5")
    assert truth.delay_s == pytest.approx(0.024)


@pytest.mark.parametrize(("campaign", "measured"), [("moved", "motors"), ("watched", "tool")])
def test_the_response_is_near_that_of_the_linearised_loop(moved, campaign, measured):
    frf = read(moved, f"{campaign}/frf.h5", FRF, frf_from_artifact)
    loaded = load_experiment(moved.folder / FILE)
    robot = loaded.robot.to_robot()
    home = np.array([1.0, *np.deg2rad([40.0, -70, 30])])
    arm, file = tool_arm(loaded.robot, robot), loaded.robot
    expected = pose_response(
        robot, arm, file.controller, file.pose_interface, home, frf.frequency_hz, ("X", "R", "A"), measured
    )
    size = np.array([5e-3, 4e-3, np.deg2rad(1)])
    apart = np.abs(frf.response[0] - expected) * size / size[:, None]
    # Friction of a few per cent of the torque limits is not in the linearised loop.
    assert np.median(apart) < 0.015
    assert apart.max() < 0.2


def test_everything_is_fresh_reported_and_shown(moved):
    states = moved.states()
    assert {status for status, _ in states.values()} == {"fresh"}
    assert "m, or rad" in (moved.runs / "report.html").read_text()
    shown = moved.robid("design-excitation", FILE, "--campaign", "moved", "--run-dir", "other").out
    flat = " ".join(shown.split())
    assert "commanded one after the other, at most: X 4.3" in flat
    assert "excursions are from the middle of the range" in flat
    assert "wrist" in flat


def test_the_commands_are_exported_at_the_rate_of_the_interface(moved):
    answer = moved.robid("export", FILE, "--campaign", "moved", "--format", "csv", "--json")
    assert answer.code == 0, answer.err
    paths = sorted(moved.folder / path for path in answer.json["files"])
    assert [path.name for path in paths] == [f"excitation_r1_e{index}.csv" for index in (1, 2, 3)]
    lines = paths[2].read_text().splitlines()
    assert any("250 samples of 0.012 s" in line for line in lines)
    assert any("displacement from the home pose" in line for line in lines)
    head, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    assert head == ["time [s]", "X [m]", "R [m]", "A [rad]"]
    values = np.array(rows, float)
    np.testing.assert_allclose(np.diff(values[:, 0]), 0.012)
    excitation = read(moved, "moved/excitation.h5", EXCITATION, excitation_from_artifact).excitation
    np.testing.assert_array_equal(np.float32(values[:, 1:]), np.float32(excitation.reference[0, 2]))
    assert moved.robid("export", FILE, "--campaign", "moved", "--format", "mat").code == 0


@pytest.mark.parametrize(
    ("old", "new", "file", "stale"),
    [
        ("delay_samples: 2", "delay_samples: 3", "pose_arm.yaml", {"excitation", "record"}),
        ("position_gain_1_s: 12", "position_gain_1_s: 13", "pose_arm.yaml", {"record"}),
        ("limits_deg: [-120, 120]", "limits_deg: [-119, 120]", "pose_arm.yaml", {"excitation"}),
        ("coulomb_nm: 0.01", "coulomb_nm: 0.011", "pose_arm.yaml", {"excitation", "record"}),
        ("channels: [X, R, A]", "channels: [R, X, A]", FILE, {"excitation"}),
        ("seed: 1}", "seed: 2}", FILE, {"record"}),
        ("measured_pose: tool", "measured_pose: motors", FILE, set()),
    ],
)
def test_what_decides_a_pose_campaign_makes_it_stale(moved, old, new, file, stale):
    before = (moved.folder / file).read_text()
    moved.change(old, new, file)
    states = moved.states()
    (moved.folder / file).write_text(before)
    own = {kind for kind in ("excitation", "record") if "settings changed" in states[f"moved/{kind}.h5"][1]}
    assert own == stale
    if not stale:
        assert states["watched/record.h5"][0] == "stale"


def test_every_setting_of_a_pose_chirp_decides_it(poses):
    loaded = load_experiment(poses.folder / FILE)
    plan = next(node.plan for node in graph(loaded) if node.output == "moved/excitation.h5")
    assert set(plan.settings["campaigns.moved.excitation"]) == {each.name for each in fields(PoseChirpOptions)}
    assert "pose_interface" in plan.settings["robot"]
    assert "controller" not in plan.settings["robot"]
    plan = next(node.plan for node in graph(loaded) if node.output == "moved/record.h5")
    assert {"pose_interface", "controller"} <= set(plan.settings["robot"])
    assert plan.needed_bytes == 2 * 4 * 2 * 3 * 2 * 250 * 6


def test_a_killed_simulation_goes_on_where_it_was(poses, monkeypatch):
    import robid.pipeline.simulate_or_acquire as stage

    assert poses.robid("design-excitation", FILE, "--campaign", "moved").code == 0
    real, done = stage.simulate_poses, []

    def killed(experiment, configuration, index, threads=1):
        if index == 1:
            raise KeyboardInterrupt
        done.append(index)
        return real(experiment, configuration, index, threads)

    monkeypatch.setattr(stage, "simulate_poses", killed)
    assert poses.robid("simulate-or-acquire", FILE, "--campaign", "moved").code == 130
    monkeypatch.setattr(stage, "simulate_poses", lambda *of: done.append(of[2]) or real(*of))
    assert poses.robid("simulate-or-acquire", FILE, "--campaign", "moved").code == 0
    assert done == [0, 1]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("channels: [X, R, A]", "channels: [X, R, Q]", ("excitation.channels[3]", "no channel `Q`")),
        ("channels: [X, R, A]", "channels: [X, R, A, X]", ("excitation.channels[4]", "`X` is there twice")),
        ("amplitude_mm: {X: 5, R: 4}", "amplitude_mm: {X: 5}", ("excitation.amplitude_mm", "lacks R")),
        (
            "amplitude_mm: {X: 5, R: 4}",
            "amplitude_mm: {X: 5, R: 4, A: 1}",
            ("amplitude_mm.A", "S123"),
        ),
        ("amplitude_deg: 1", "amplitude_deg: 0", ("excitation.amplitude_deg", "must be above 0")),
        ("period_s: 3,", "period_s: 3.01,", ("not a whole number", "3.012")),
        ("high_hz: 5,", "high_hz: 50,", ("Nyquist",)),
        ("periods: 2", "periods: 2\n    experiments: 2", ("moved.experiments", "S116")),
        ("periods: 2", "periods: 2\n    outputs: [motors, rail.arm]", ("moved.outputs", "S117")),
        ("periods: 2", "periods: 2\n    estimate: {compensation: nominal}", ("estimate.compensation", "pose commands")),
        ("signal: pose_chirp, channels: [X, R, A]", "signal: pose_chirp, rms: 2", ("rms",)),
    ],
)
def test_wrong_settings_of_a_campaign_are_told(poses, old, new, words):
    poses.change(old, new, FILE)
    poses.refuse(2, *words, command=("design-excitation", FILE, "--campaign", "moved"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("external_axes: [rail]", "external_axes: [shoulder]", ("external_axes[1]", "S111", "rail")),
        ("external_axes: [rail]", "external_axes: [track]", ("external_axes[1]", "no joint `track`")),
        ("external_axes: [rail]", "external_axes: [rail, shoulder]", ("external_axes[2]", "`shoulder` is revolute")),
        (
            "sampling_period_s: 0.012",
            "sampling_period_s: 0.011",
            ("pose_interface.sampling_period_s", "whole multiple"),
        ),
        ("pose_interface:", "# ", ("excitation.signal", "S119")),
        ("max_torque_nm: 3,", "", ("S144", "`motor.max_torque_nm` of ")),
    ],
)
def test_wrong_settings_of_the_interface_are_told(poses, old, new, words):
    poses.change(old, new, "pose_arm.yaml")
    poses.refuse(2, *words, command=("design-excitation", FILE, "--campaign", "moved"))


def test_only_pose_chirps_measure_poses_and_no_design_chooses_among_them(poses):
    text = (poses.folder / FILE).read_text()
    (poses.folder / FILE).write_text(
        re.sub(r"signal: pose_chirp.*amplitude_deg: 1", "signal: chirp, period_s: 3", text)
    )
    answer = poses.robid("run", FILE)
    assert answer.code == 2
    assert "campaigns.watched.source.simulate.measured_pose: S115" in answer.flat
    shutil.copy(HERE / FILE, poses.folder)
    poses.change("execution:", "designs: {best: {campaign: moved, count: 1}}\nexecution:", FILE)
    told = poses.robid("run", FILE)
    assert told.code == 2
    assert "designs.best.campaign: S157 campaign `moved` commands poses" in told.flat


def test_out_of_reach_is_told_before_anything_is_simulated(poses):
    poses.change("amplitude_mm: {X: 5, R: 4}", "amplitude_mm: {X: 2000, R: 4}", FILE)
    poses.refuse(
        2, "channel X, configuration", "mm would do", command=("design-excitation", FILE, "--campaign", "moved")
    )
