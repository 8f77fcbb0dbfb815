import json
import re
import shutil
from pathlib import Path

import pytest

_HERE = Path(__file__).parent
_ROOT = _HERE.parents[1]
TASKS = {"haptic": {"haptic_1", "haptic_3"}, "branch": {"branch_1"}}


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / "janot.yaml", shop.folder)
    robot = (_ROOT / "configs/robots/branch.yaml").read_text()
    slow = "controller: {sampling_period_s: 4.0e-3, position_gain_1_s: 5, speed_bandwidth_hz: 100, delay_samples: 0}"
    (shop.folder / "branch.yaml").write_text(re.sub(r"^controller: .*$", slow, robot, flags=re.MULTILINE))
    emps = (_ROOT / "configs/emps.yaml").read_text()
    (shop.folder / "emps.yaml").write_text(emps.replace("robots/emps.yaml", f"{_ROOT}/configs/robots/emps.yaml"))
    shutil.copy(_ROOT / "data/emps.yaml", shop.folder / "published.yaml")
    (shop.folder / "paper.yaml").write_text("table_3: {value: {ZZ1: 0.123}}\ntable_6: {ZZ1: 0.4567}\n")
    object.__setattr__(shop, "runs", shop.folder / "runs" / "janot")
    return shop


def leave_out(study, *parts):
    path, keys = study.folder / "janot.yaml", tuple(f"  {part}:" for part in parts)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith(keys)))


def files(study):
    return {
        folder: {path.name.split(".")[0] for path in (study.runs / "tasks" / folder).glob("*.h5")} for folder in TASKS
    }


def test_machines_are_judged_beside_the_paper_and_a_lost_task_is_done_again(study, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(study.folder / "nowhere"))
    answer = study.robid("study", "janot.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert files(study) == TASKS
    assert (summary["haptic.seeds"], summary["branch.seeds"], summary["tasks.count"]) == (3, 2, 3)
    assert summary["haptic.bad.verdict_share"] == 1
    assert summary["haptic.good.sigma"] < summary["haptic.bad.sigma"]
    assert summary["haptic.ls.max_error_percent"] > summary["haptic.iv.max_error_percent"]
    assert summary["branch.good.sigma"] < summary["branch.bad.sigma"]
    assert not [name for name in summary if name.startswith("emps.")]
    page = (study.runs / "report.html").read_text()
    for text in ("Table 6", "0.123", "46 %", "Fig. 5", "Limits of H", "DATA_EMPS.mat", "shoulder"):
        assert text in page
    kept = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").rglob("*.h5")}
    lost = next(path for path in kept if path.name.startswith("haptic_3"))
    lost.unlink()
    again = study.robid("study", "janot.yaml")
    assert "1 of 2 tasks are there from an earlier run" in again.err
    assert {path for path, at in kept.items() if path.stat().st_mtime_ns != at} == {lost}


def test_parts_that_are_left_out_leave_no_trace(study):
    text = (study.folder / "janot.yaml").read_text()
    kept = [
        line for line in text.splitlines(keepends=True) if not line.startswith(("  branch:", "  emps:", "  paper:"))
    ]
    (study.folder / "janot.yaml").write_text("".join(kept))
    study.change("seeds: 3", "seeds: 2", "janot.yaml")
    answer = study.robid("study", "janot.yaml", "--json")
    assert answer.code == 0, answer.err
    assert {name.split(".")[0] for name in answer.json["summary"]} == {"haptic", "tasks"}


def test_real_data_stand_beside_their_published_values_once_they_are_there(study, data_folder, monkeypatch):
    folder = data_folder("emps").parent
    text = (study.folder / "janot.yaml").read_text()
    kept = [
        line for line in text.splitlines(keepends=True) if not line.startswith(("  branch:", "  haptic:", "  paper:"))
    ]
    (study.folder / "janot.yaml").write_text("".join(kept))
    monkeypatch.setenv("ROBID_DATA", str(study.folder / "nowhere"))
    assert study.robid("study", "janot.yaml", "--json").json["summary"] == {"tasks.count": 0, "tasks.seconds": 0}
    assert "No part of the study" in (study.runs / "report.html").read_text()
    monkeypatch.setenv("ROBID_DATA", str(folder))
    answer = study.robid("study", "janot.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary["emps.M"] == pytest.approx(95.1089, rel=0.01)
    assert summary["emps.Fv"] == pytest.approx(203.5034, rel=0.01)
    assert summary["emps.Fc"] == pytest.approx(20.3935, rel=0.01)
    assert summary["emps.offset"] == pytest.approx(-3.1648, rel=0.02)
    assert summary["emps.condition"] == pytest.approx(25.9883, rel=0.01)
    assert summary["emps.relative_error_percent"] == pytest.approx(4.083, abs=0.1)
    assert summary["emps.asymmetric_relative_error_percent"] == pytest.approx(3.11, abs=0.1)
    page = (study.runs / "report.html").read_text()
    assert "All 7 figures" in page
