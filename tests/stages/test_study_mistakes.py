import json
import shutil
from pathlib import Path

import pytest

from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.studies.mistakes import cases as mistakes_cases

_HERE = Path(__file__).parent
CASES = {
    *("sound_heavy_1", "sound_heavy_2", "sound_light_1", "torque_sign_heavy_1", "swapped_light_1"),
    *("payload_heavy_1", "nothing_to_blame_heavy_1"),
}


@pytest.fixture
def study(shop):
    text = (_HERE / "mistakes.yaml").read_text()
    before, rest = text.split("study:\n")
    light = before.replace("name: mistakes", "name: light") + rest[rest.index("execution:") :]
    (shop.folder / "light.yaml").write_text(light)
    shutil.copy(_HERE / "mistakes.yaml", shop.folder)
    object.__setattr__(shop, "runs", shop.folder / "runs" / "mistakes")
    return shop


def names(folder):
    return {path.name.split(".")[0] for path in folder.glob("*.h5")}


def times(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


@pytest.mark.slow
def test_mistakes_are_made_fitted_and_graded(study, monkeypatch):
    answer = study.robid("study", "mistakes.yaml", "--json")
    assert answer.code == 0, answer.err
    summary, tasks = answer.json["summary"], study.runs / "tasks"
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert names(tasks / "cases") == names(tasks / "models") == CASES
    simulated = names(tasks / "responses")
    assert len(simulated) == 3 + 1, "two heavy robots and a light one are sound, one carries another payload"
    assert summary["sound.robots"] == 3
    assert summary["sound.deserve_trust"] == 1
    assert summary["sound.worst_spring_error"] < 0.01
    assert summary["torque_sign.right_mean"] == 0
    assert summary["payload.worst_spring_error"] == summary["nothing_to_blame.worst_spring_error"] > 0.05
    assert "nothing_to_blame.named" not in summary
    for key in ("graded", "named", "false_alarms"):
        assert 0 <= summary[key] <= 1
    page = (study.runs / "report.html").read_text()
    for text in ("torque sign", "nothing to blame", "do not use", "Right grade"):
        assert text in page
    _is_stored(tasks)
    _is_graded_anew(study, monkeypatch)


def _is_stored(tasks):
    """What thresholds are chosen on is there, case by case."""
    held = read_artifact(next((tasks / "cases").glob("torque_sign_heavy_1.*")), TASK)
    numbers = ("share_above", "share_correlated", "misfit", "cost_ratio", "telling_above", "median_error_db")
    assert all(held.attributes[key] >= 0 for key in numbers)
    assert (held.attributes["case"], held.attributes["robot"], held.attributes["seed"]) == ("torque_sign", "heavy", 1)
    assert {"causes", "strength", "decisive", "messages"} <= set(held.datasets)


def _is_graded_anew(study, monkeypatch):
    """Other rules of the grade ask for no simulation and no fit."""
    tasks = study.runs / "tasks"
    kept = {name: times(tasks / name) for name in ("responses", "models", "cases")}
    monkeypatch.setattr(mistakes_cases, "GRADING", 0)
    answer = study.robid("study", "mistakes.yaml")
    assert answer.code == 0, answer.err
    assert times(tasks / "responses") == kept["responses"]
    assert times(tasks / "models") == kept["models"]
    assert not kept["cases"].keys() & times(tasks / "cases").keys()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("fit: elastic\n  light", "fit: elastik\n  light", "study.fit: there is no fit `elastik`"),
        ("validate_on: validation", "starts: 1", "one to `validate_on`"),
        ("cause: payload", "cause: pailoat", "there is no cause `pailoat`"),
        ("{turn: -1}", "{torn: -1}", "there is no joint `torn`"),
        ("torque_factor: {turn: -1}", "without_springs: [gear]", "there is no spring `gear`"),
        ("{unmodelled_payload_kg: 3}}\n    n", "{unmodelled: 3}}\n    n", "mistakes.payload.imperfections.unmodelled"),
        ("choose: {first: 11", "choose: {first: 2", "the seeds of `judge` and `choose` overlap"),
        ("  light: light.yaml\n", "", "the study has no `light` robot"),
        ("robot: light, swapped: [1, 3]", "robot: light, angle_factor: {torn: -1}", "there is no joint `torn`"),
    ],
)
def test_what_cannot_be_made_is_told_before_anything_is_made(study, old, new, message):
    study.change(old, new, "mistakes.yaml")
    answer = study.robid("study", "mistakes.yaml")
    assert answer.code == 2
    assert message in answer.flat
    assert not [path for path in study.runs.rglob("*") if path.is_file() and path.name != ".lock"]


UNITS = """\
  only: units
  units:
    robots:
      drive:
        experiment: drive.yaml
        fit: elastic
        torque_constant_nm_a: 0.05
        variants: [{imperfections: {friction: tanh}}]
    mistakes:
      in_deg: {scale: motor_angle x 180/pi, same: {drive: [torque / 180/pi]}}
      stamps_in_ms: {scale: time x 1000, refusals: [time unit]}
  mistakes:
"""

DRIVE = """\
schema_version: 1
name: drive
robot: geared_drive.yaml
campaigns:
  estimation: &estimation
    configurations: {list_deg: [[0], [60]]}
    excitation: {period_s: 0.5, low_hz: 4, high_hz: 80, count: 14, rms: 15, seed: 1, phase_iterations: 5}
    periods: 2
    source: {simulate: {seed: 1, imperfections: {encoder_noise_rad: 1.0e-5, torque_noise_nm: 0.005, friction: lugre}}}
    estimate: {compensation: nominal}
  validation: {<<: *estimation, configurations: {list_deg: [[30]]}}
fits:
  elastic: {family: elastic, from: estimation, validate_on: validation, free: [stiffness, damping]}
"""


@pytest.fixture
def units(study):
    shutil.copy(_HERE.parents[1] / "configs" / "robots" / "geared_drive.yaml", study.folder)
    (study.folder / "drive.yaml").write_text(DRIVE)
    study.change("  mistakes:\n", UNITS, "mistakes.yaml")
    study.change("mistakes: 1, heavy: 2, light: 1}", "mistakes: 1, units: 1, rough: 1}", "mistakes.yaml")
    study.change("choose: {first: 11", "choose: {first: 111", "mistakes.yaml")
    return study


def test_logs_in_wrong_units_are_read_through_the_whole_chain(units):
    answer = units.robid("study", "mistakes.yaml", "--json")
    assert answer.code == 0, answer.err
    summary, tasks = answer.json["summary"], units.runs / "tasks"
    assert names(tasks / "units") == {"drive_units_1", "drive_rough_1"}
    assert not names(tasks / "cases")
    assert (summary["units.cases"], summary["units.sound"], summary["units.false"]) == (2, 1, 0)
    assert summary["units.stamps_in_ms.named"] == 1
    assert summary["units.named"] == summary["units.drive.named"] >= 0.5
    held = read_artifact(next((tasks / "units").glob("drive_units_1.*")), TASK)
    refusals = dict(zip(held.datasets["case"].values.tolist(), held.datasets["refusal"].values.tolist(), strict=True))
    assert "D123" in refusals["stamps_in_ms"]
    assert "/tmp" not in refusals["stamps_in_ms"]
    page = (units.runs / "report.html").read_text()
    for text in ("in deg", "Wrong units", "Rough robot files"):
        assert text in page
    before = times(tasks)
    units.change("same: {drive: [torque / 180/pi]}", "same: {}", "mistakes.yaml")
    assert units.robid("study", "mistakes.yaml").code == 0
    assert times(tasks) == before, "another group asks for no other reading"


RIGID = """\
schema_version: 1
name: rigid
robot: rigid_arm.yaml
campaigns:
  exciting: &exciting
    configurations: {list_deg: [[20, 30]]}
    excitation: {signal: trajectory, period_s: 3, starts: 1, evaluations: 15, seed: 1}
    periods: 1
    source: {simulate: {seed: 1, imperfections: {friction: tanh, encoder_noise_rad: 1.0e-5}}}
  new: {<<: *exciting, excitation: {signal: trajectory, period_s: 3, starts: 1, evaluations: 15, seed: 2}}
fits:
  rigid: {family: rigid, from: exciting, validate_on: new}
"""


def test_a_fit_that_reads_records_is_read_as_one_shot(units):
    shutil.copy(_HERE / "rigid_arm.yaml", units.folder)
    (units.folder / "rigid.yaml").write_text(RIGID)
    units.change(
        "experiment: drive.yaml\n        fit: elastic", "experiment: rigid.yaml\n        fit: rigid", "mistakes.yaml"
    )
    answer = units.robid("study", "mistakes.yaml", "--json")
    assert answer.code == 0, answer.err
    held = read_artifact(next((units.runs / "tasks" / "units").glob("drive_units_1.*")), TASK)
    columns = (held.datasets[key].values.tolist() for key in ("case", "causes", "refusal"))
    said = {case: (causes, refusal) for case, causes, refusal in zip(*columns, strict=True)}
    assert "D123" in said["stamps_in_ms"][1]
    assert said["in_deg"][0].split("; ")[0] == "units"
    assert answer.json["summary"]["units.named"] == 1
    assert answer.json["summary"]["units.false"] == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("motor_angle x 180/pi,", "motor_angle x 179,", "study.units.mistakes.in_deg.scale"),
        (
            "fit: elastic\n        torque",
            "fit: rigid\n        torque",
            "study.units.robots.drive.fit: there is no fit `rigid`",
        ),
        ("{friction: tanh}", "{frickion: tanh}", "study.units.robots.drive.variants[1].imperfections.frickion"),
        ("180/pi, same", "180/pi, log: {drive: [angle, arm]}, same", "S390"),
        ("same: {drive: ", "same: {drove: ", "there is no robot `drove`"),
        (
            "  units:\n    robots",
            "  units:\n    only: [drove]\n    robots",
            "study.units.only: there is no robot `drove`",
        ),
        ("choose: {first: 111", "choose: {first: 3", "the seeds of `judge` and `choose` overlap"),
    ],
)
def test_units_that_cannot_be_made_wrong_are_told_before_anything_is_made(units, old, new, message):
    units.change("units: 1, rough: 1", "units: 3, rough: 1", "mistakes.yaml")
    units.change(old, new, "mistakes.yaml")
    answer = units.robid("study", "mistakes.yaml")
    assert answer.code == 2
    assert message in answer.flat
    assert not [path for path in units.runs.rglob("*") if path.is_file() and path.name != ".lock"]
