"""An exciting trajectory goes through the chain: designed, simulated, exported, never made a response of."""

import csv
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.kinds import EXCITATION, RECORD, excitation_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.options import TrajectoryOptions
from robid.models.known import load_experiment
from robid.pipeline.design_excitation import base_model
from robid.pipeline.graph import graph
from robid.settings.load import load_robot

HERE = Path(__file__).parent
FILE = "trajectory.yaml"
KIND = "signal: trajectory, period_s: 4, starts: 1, evaluations: 40, seed: 1"


def prepared(shop):
    shop.experiment, shop.runs = FILE, shop.folder / "runs" / "trajectory"
    for name in (FILE, "rigid_arm.yaml"):
        shutil.copy(HERE / name, shop.folder)
    return shop


@pytest.fixture
def swing(shop):
    """A folder with the experiment, not run yet."""
    return prepared(shop)


def test_a_trajectory_is_designed_simulated_reported_and_exported(swing):
    answer = swing.robid("run", FILE)
    assert answer.code == 0, answer.err
    assert sorted(path.name for path in swing.runs.rglob("*.h5")) == ["excitation.h5", "record.h5"]
    assert "condition number" in answer.err
    content = excitation_from_artifact(read_artifact(swing.runs / "exciting/excitation.h5", EXCITATION))
    excitation = content.excitation
    assert excitation.reference.shape == (2, 1, 4000, 2)
    assert excitation.plan.condition.shape == (2,)
    record = record_from_artifact(read_artifact(swing.runs / "exciting/record.h5", RECORD))
    assert record.outputs.shape == (1, 2, 1, 1, 4000, 2)
    np.testing.assert_allclose(record.output_offset[0], np.deg2rad([20 * 60, 30 * 50]))
    np.testing.assert_allclose(
        np.abs(record.outputs).max(axis=(0, 1, 2, 3, 4)) / [60, 50], excitation_peaks(content), rtol=0.05
    )
    assert {status for status, _ in swing.states().values()} == {"fresh"}

    shown = swing.robid("design-excitation", FILE, "--force").out
    assert "condition number of the base parameters' regressor" in shown
    answer = swing.robid("export", FILE, "--campaign", "exciting", "--format", "csv", "--json")
    assert answer.code == 0, answer.err
    paths = sorted(swing.folder / path for path in answer.json["files"])
    assert [path.name for path in paths] == ["excitation_r1_e1.csv", "excitation_r2_e1.csv"]
    lines = paths[1].read_text().splitlines()
    assert any("2 realizations of 1 experiment in each of 1 configuration" in line for line in lines)
    _, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    np.testing.assert_array_equal(np.float32(np.array(rows, float)[:, 1:]), np.float32(excitation.reference[1, 0]))
    assert swing.robid("export", FILE, "--campaign", "exciting", "--format", "mat").code == 0


def excitation_peaks(content):
    """Largest way of each joint [rad]."""
    reference = content.excitation.reference[:, 0]
    way = np.cumsum(reference, axis=1) * 1e-3
    return np.abs(way).max(axis=(0, 1)) / [60, 50]


def test_no_response_is_made_of_a_trajectory(swing):
    answer = swing.robid("estimate-frf", FILE, "--campaign", "exciting")
    assert answer.code == 2
    assert "Traceback" not in answer.err
    swing.change(
        "execution:",
        "fits: {elastic: {family: elastic, from: exciting}}\n"
        "designs: {best: {campaign: exciting, count: 1}}\nexecution:",
        FILE,
    )
    told = swing.robid("run", FILE)
    assert told.code == 2
    assert (
        "fits.elastic.from: S196 campaign `exciting` plays a trajectory, which has no frequency response" in told.flat
    )
    assert "designs.best.campaign: S156 campaign `exciting` plays a trajectory" in told.flat


@pytest.mark.parametrize(
    ("new", "words"),
    [
        (f"{KIND}, rms: 3", "rms: S386"),
        (f"{KIND}, inject: torque", "inject"),
        (f"{KIND}, harmonics: 2", "harmonics"),
        (KIND.replace("period_s: 4", "period_s: 0.05"), "5 harmonics leave fewer than 20 of 50 samples"),
        (KIND.replace("period_s: 4", "period_s: 0.3"), "joint `lift` reaches"),
        (f"{KIND}, torque_share: 0.2", "of its torque limit to hold the arm"),
    ],
)
def test_what_cannot_be_played_is_told_before_anything_is_made(swing, new, words):
    swing.change(KIND, new, FILE)
    swing.refuse(2, words, command=("design-excitation", FILE))


def test_a_robot_file_without_limits_and_a_campaign_with_blocks_are_told(swing):
    swing.change("max_torque_nm: 8", "ripple_nm: 0", "rigid_arm.yaml")
    swing.change("realizations: 2", "realizations: 2\n    experiments: 1", FILE)
    answer = swing.robid("design-excitation", FILE)
    assert answer.code == 2
    assert "`motor.max_torque_nm` of lift, bend" in answer.flat
    assert "experiments: S179" in answer.flat


def test_a_configuration_beyond_the_limits_is_told(swing):
    swing.change("[[20, 30]]", "[[20, 145]]", FILE)
    swing.refuse(2, "bend", "140", command=("design-excitation", FILE))


def test_what_decides_a_trajectory_makes_it_stale(swing):
    assert swing.robid("design-excitation", FILE).code == 0
    swing.change("coulomb_nm: 0.2", "coulomb_nm: 0.15", "rigid_arm.yaml")
    assert swing.states()["exciting/excitation.h5"][0] == "stale"


@pytest.mark.parametrize(
    ("friction", "left_out"), [("none", {"viscous", "coulomb"}), ("viscous", {"coulomb"}), ("asymmetric", set())]
)
def test_friction_that_is_not_asked_for_is_not_judged_but_costs_torque(friction, left_out):
    robot = load_robot(HERE / "rigid_arm.yaml").to_robot()
    base = base_model(robot, TrajectoryOptions(friction=friction))
    kinds = {kind for kind, judged in zip(base.model.kinds, base.judged, strict=True) if not judged}
    assert kinds == left_out
    motion = np.zeros((3, 1, 2))
    still = base.torques(np.zeros((1, 2)), motion)
    motion[1] = 1e-9
    np.testing.assert_allclose(base.torques(np.zeros((1, 2)), motion) - still, 0.2, rtol=1e-6)


def test_every_setting_of_a_trajectory_decides_it(swing):
    loaded = load_experiment(swing.folder / FILE)
    plan = next(node.plan for node in graph(loaded) if node.output == "exciting/excitation.h5")
    assert set(plan.settings["campaigns.exciting.excitation"]) == {each.name for each in fields(TrajectoryOptions)}
    assert {"loop_links", "gravity_m_s2", "payload", "floor_m"} <= set(plan.settings["robot"])
    joint = plan.settings["robot"]["joints"][0]
    assert {"counterbalance", "limits_deg"} <= set(joint)
    assert {"max_speed_rad_s", "max_torque_nm"} <= set(joint["motor"])
    assert "coulomb_nm" in joint["motor"]["friction"]
