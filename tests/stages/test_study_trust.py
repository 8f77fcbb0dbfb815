"""A small study of trust, from simulation to page, and what it refuses before anything is made."""

import json
import shutil
from pathlib import Path

import pytest

from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact

_HERE = Path(__file__).parent


@pytest.fixture
def study(shop):
    text = (_HERE / "trust.yaml").read_text()
    before, rest = text.split("study:\n")
    light = before.replace("name: trust", "name: light") + rest[rest.index("execution:") :]
    (shop.folder / "light.yaml").write_text(light)
    shutil.copy(_HERE / "trust.yaml", shop.folder)
    object.__setattr__(shop, "runs", shop.folder / "runs" / "trust")
    return shop


def names(folder):
    return sorted(path.name.split(".")[0] for path in folder.glob("*.h5"))


def times(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.h5")}


@pytest.mark.slow
def test_robots_are_measured_fitted_and_held_against_truth_and_fresh_places(study):
    answer = study.robid("study", "trust.yaml", "--json")
    assert answer.code == 0, answer.err
    summary, tasks = answer.json["summary"], study.runs / "tasks"
    assert summary == json.loads((study.runs / "summary.json").read_text())
    measured = names(tasks / "responses")
    counted = {key: len([name for name in measured if name.startswith(key)]) for key in ("a_1_", "a_2_", "b_3_", "pay")}
    assert counted == {"a_1_": 5 + 6 + 4, "a_2_": 5 + 2, "b_3_": 5 + 2, "pay": 3}
    fitted = ["a_1_designed", "a_1_fresh", "a_1_random", "a_2_random", "b_3_random"]
    fitted += ["c_late_8_random", "c_sound_9_random"]
    fitted += ["light_4_designed", "light_4_fresh", "light_4_random", "payload_5_random"]
    assert names(tasks / "models") == fitted
    assert names(tasks / "linear") == ["linear_6", "linear_file_7"]
    assert names(tasks / "grades") == ["a_1", "a_2", "b_3", "c_late_8", "c_sound_9", "light_4", "payload_5"]
    assert names(tasks / "effects") == ["c_late_8"]
    _one_late_drive_is_told_of(summary, read_artifact(next((tasks / "effects").glob("c_late_8.*")), TASK).attributes)
    shares = (
        "a.effective.coverage_95",
        "a.effective.designed",
        "light.effective.coverage_95",
        "a.physical.coverage_95",
    )
    shares += ("a.physical.worst", "b.physical.coverage_95", "b.trusted_wrong", "linear.coverage_95")
    for key in (*shares, "linear.file.coverage_95", "causes.first", "causes.first_three", "effective.coverage_95"):
        assert 0 <= summary[key] <= 1, key
    assert summary["a.width_ratio"] > 0
    assert "width_ratio" not in summary  # b has no reference, so nothing is known of its widths
    assert "b.effective.coverage_95" not in summary
    page = (study.runs / "report.html").read_text()
    for text in ("What is asked", "a.physical.worst", "Sets of robots", "Causes", "Set C: one defect each"):
        assert text in page
    _places_are_each_robots_own(tasks)
    _nothing_is_done_twice(study, tasks)


def _one_late_drive_is_told_of(summary, effect):
    # Two samples turn the phase at 80 Hz by a radian.
    assert effect["power"] > 0.99
    assert (summary["c.robots"], summary["c.sound"], summary["c.first_cases"]) == (1, 1, 1)
    assert {summary[key] for key in ("c.first", "c.late.first", "c.trusted_wrong", "c.false")} <= {0, 1}
    assert summary["c.late.first"] == summary["c.first"] == 1


def _places_are_each_robots_own(tasks):
    def place(name):
        held = read_artifact(next((tasks / "responses").glob(f"{name}.*")), TASK)
        return tuple(held.datasets["configurations"].values[0].tolist())

    assert len({place(name) for name in ("a_1_random_1", "a_1_fresh_1", "a_2_random_1", "b_3_random_1")}) == 4
    assert place("a_1_designed_1") == place("light_4_designed_1")


def _nothing_is_done_twice(study, tasks):
    before = times(tasks)
    next((tasks / "models").glob("b_3_random.*")).unlink()
    answer = study.robid("study", "trust.yaml")
    assert answer.code == 0, answer.err
    after = times(tasks)
    assert [path.name.split(".")[0] for path in before if before[path] != after[path]] == ["b_3_random"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("fit: elastic\n  designed", "fit: elastik\n  designed", "study.fit: there is no fit `elastik`"),
        ("designed: designed", "designed: desined", "study.designed: there is no campaign `desined`"),
        ("validated_in: 2", "validated_in: 9", "study.validated_in: S424"),
        ("{random: {count: 5, margin_deg: 20}}", "{list_deg: [[0, 0]]}", "campaign `random` needs `random` config"),
        (
            "robots: 2, referenced: 1",
            "robots: 2, referenced: 3",
            "study.sets.a.referenced: S426 the set has 2 robots only",
        ),
        ("springs_each: 1", "springs_each: 2", "study.sets.b.springs_each: S427"),
        ("load_friction", "load_frction", "study.sets.b.imperfections.load_frction"),
        ("axis: [1, 0, 0]", "joint: torn, axis: [1, 0, 0]", "study.sets.b.truth.springs[1].joint"),
        ("named: [payload]", "named: [pailoat]", "study.causes.payload.named[1]: there is no cause `pailoat`"),
        ("choose: {first: 31}", "choose: {first: 5}", "the seeds of `judge` and `choose` overlap"),
        ("  light: light.yaml\n", "", "study.sets.light.robot: S425"),
        ("  light: light.yaml\n", "", "study.single: S520"),
        ("    payload: {named", "    a: {named", "study.causes.a: S428"),
        (
            "late_torque_s: {lift",
            "late_torque_s: {lifd",
            "defects.late.variants.heavy[1].truth.late_torque_s.lifd: S514",
        ),
        ("named: [delay]", "named: [dalay]", "study.single.defects.late.named[1]: there is no cause `dalay`"),
        ("{heavy: [{truth: {late", "{light: [{truth: {late", "study.single.defects.late: S518"),
        (
            "{torque_noise_nm: 0.05}]",
            "{torque_nois_nm: 0.05}]",
            "study.single.noises.heavy[2].imperfections.torque_nois",
        ),
        ("      late:", "      sound:", "study.single: S517"),
        ("    b:\n", "    c:\n", "study.sets.c: S519"),
        ("{backlash_rad: 1.0e-5}", "{backlsh_rad: 1.0e-5}", "study.sets.light.imperfections.backlsh_rad"),
    ],
)
def test_what_cannot_be_made_is_told_before_anything_is_made(study, old, new, message):
    study.change(old, new, "trust.yaml")
    answer = study.robid("study", "trust.yaml")
    assert answer.code == 2, answer.err
    assert message in answer.flat
    assert not [path for path in study.runs.rglob("*") if path.is_file() and path.name != ".lock"]
