import json
import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

_HERE = Path(__file__).parent
_ROOT = _HERE.parents[1]
FILE = "oliveira.yaml"
TASKS = {"plants": {"Z", "C"}, "coverage": {"Z_1", "Z_2", "C_1", "C_2"}, "synthetic": {"plants_1", "plants_2"}}


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / FILE, shop.folder)
    paper = YAML(typ="safe").load(_ROOT / "data/oliveira2019.yaml")
    paper["duration_s"] = 30
    paper["table_3"] = {name: paper["table_3"][name] for name in ("Z", "C")}
    YAML().dump(paper, shop.folder / "paper.yaml")
    shutil.copy(_ROOT / "configs/emps_loop.yaml", shop.folder)
    object.__setattr__(shop, "runs", shop.folder / "runs" / "oliveira")
    return shop


def leave_out(study, *parts):
    path, keys = study.folder / FILE, tuple(f"  {part}:" for part in parts)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith(keys)))


def files(study):
    return {
        folder: {path.name.split(".")[0] for path in (study.runs / "tasks" / folder).glob("*.h5")} for folder in TASKS
    }


def test_channels_are_held_against_the_truth_beside_the_paper_and_a_lost_task_is_done_again(study, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(study.folder / "nowhere"))
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert files(study) == TASKS
    assert (summary["Z.poles"], summary["Z.zeros"], summary["Z.delay_samples"]) == (2, 1, 4)
    assert summary["Z.nrmse"] > 0.99
    assert summary["max_band_error_percent"] < 1
    assert summary["max_band_error_percent"] == max(summary["Z.band_error_percent"], summary["C.band_error_percent"])
    assert summary["C.undershoot"] == pytest.approx(summary["C.undershoot_true"], abs=5 * summary["C.undershoot_std"])
    assert 0.5 < summary["coverage_97"] <= 1
    assert (summary["coverage.seeds"], summary["synthetic.plants"], summary["tasks.count"]) == (2, 2, 8)
    assert not [name for name in summary if name.startswith(("emps.", "arm."))]
    page = (study.runs / "report.html").read_text()
    for text in ("Table 1", "Table 3", "0.984", "24.08 s + 1362", "Fig. 6", "DATA_EMPS.mat", "not of minimum phase"):
        assert text in page
    kept = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").rglob("*.h5")}
    lost = next(path for path in kept if path.name.startswith("C_2"))
    lost.unlink()
    again = study.robid("study", FILE)
    assert "3 of 4 tasks are there from an earlier run" in again.err
    assert {path for path, at in kept.items() if path.stat().st_mtime_ns != at} == {lost}


def test_parts_that_are_left_out_leave_no_trace(study):
    leave_out(study, "plants", "emps")
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    assert {name.split(".")[0] for name in answer.json["summary"]} == {"synthetic", "tasks"}


def test_the_real_axis_is_as_near_as_was_published(study, data_folder, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("emps").parent))
    leave_out(study, "plants", "synthetic")
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary["emps.relative_error_percent"] <= 0.005
    assert summary["emps.natural_frequency"] == pytest.approx(126.4, rel=0.01)
    assert "All 2 figures" in (study.runs / "report.html").read_text()


ARM = """
schema_version: 1
name: oliveira
robot: pose_arm.yaml
campaigns:
  told:
    configurations: {list: [[1, 40, -70, 30]]}
    excitation: &chirp
      {signal: pose_chirp, channels: [X, R, A], period_s: 6, low_hz: 0.3, high_hz: 5, amplitude_mm: {X: 5, R: 4}}
    periods: 1
    source:
      simulate: &simulate {imperfections: {friction: lugre, encoder_noise_rad: 1.0e-5}, seed: 1}
  again:
    configurations: {list: [[1, 40, -70, 30]]}
    excitation: {<<: *chirp, high_hz: 4}
    periods: 1
    source: {simulate: {<<: *simulate, seed: 2}}
  homes:
    configurations: {list: [[1, 40, -70, 30], [0.5, -30, 80, 10]]}
    excitation: *chirp
    periods: 1
    source: {simulate: {<<: *simulate, measured_pose: tool}}
fits:
  poses: {family: external, from: told, validate_on: again, poles: 3, zeros: 2, max_delay_samples: 4, hold: foh}
study:
  kind: oliveira2019
  arm: {fit: poses, homes: homes}
  paper: paper.yaml
execution: {backend: serial, workers: 1}
"""


def test_an_arm_is_mapped_in_its_homes_beside_its_linearised_loop(study):
    shutil.copy(_HERE / "pose_arm.yaml", study.folder)
    (study.folder / FILE).write_text(ARM)
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert {name for name in summary if name.endswith(".nrmse")} == {f"arm.{channel}.nrmse" for channel in "XRA"}
    assert summary["arm.X.nrmse"] > 0.9
    for home in (1, 2):
        assert summary[f"arm.home_{home}.resonance_hz"] <= 5
        assert summary[f"arm.home_{home}.decoupled_hz"] <= 5
    assert summary["arm.linear_error_percent"] < 20
    assert summary["arm.coupling_agreement"] > 0.7
    page = (study.runs / "report.html").read_text()
    for text in ("What couples", "X to Z, Z to R, X to R, Z to X", "home 2: Fig. 9", "A resonance that moves"):
        assert text in page


def test_what_an_arm_lacks_is_told_with_its_field(study):
    (study.folder / FILE).write_text(
        ARM.replace("homes: homes}", "homes: home}").replace("fit: poses", "fit: pose").replace("pose_arm", "arm")
    )
    answer = study.robid("study", FILE)
    assert answer.code == 2
    assert "study.arm.homes: there is no campaign `home`; did you mean `homes`?" in answer.flat
    assert "study.arm.fit: there is no fit `pose`; did you mean `poses`?" in answer.flat
