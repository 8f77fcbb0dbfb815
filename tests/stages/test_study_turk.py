"""The study of position-dependent models on a small arm: its parts, its page, and going on where it stopped."""

import json
import shutil
from pathlib import Path

import pytest

_HERE = Path(__file__).parent
FILE = "turk.yaml"


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / FILE, shop.folder)
    shutil.copy(_HERE.parents[1] / "data/turk2018.yaml", shop.folder / "paper.yaml")
    object.__setattr__(shop, "runs", shop.folder / "runs" / "turk")
    return shop


def leave_out(study, *parts):
    path = study.folder / FILE
    before, after = path.read_text().split("study:\n")
    kept = [
        line for line in after.splitlines(keepends=True) if not line.startswith(tuple(f"  {one}:" for one in parts))
    ]
    path.write_text(f"{before}study:\n{''.join(kept)}")


def test_a_model_is_held_against_deviations_beside_the_paper_and_a_lost_task_is_done_again(study):
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert (summary["synthetic.runs"], summary["tasks.count"]) == (2, 2)
    assert summary["synthetic.exact_structure_share"] in (0, 0.5, 1)
    assert summary["blocks"] == 8
    for name in ("local", "left_out"):
        assert 0 <= summary[f"{name}.share_within_1std"] <= summary[f"{name}.share_within_2std"] <= 1
        assert summary[f"{name}.median_deviation_db.turn"] > 0
    ratio = summary["left_out.error_ratio"] / summary["left_out.full_error_ratio"]
    assert summary["left_out.excess_percent"] == pytest.approx(100 * (ratio - 1))
    page = (study.runs / "report.html").read_text()
    for text in ("Table IV", "10⁻¹⁵", "B1, C2, C3, C4, D1, D2, D4", "Figs 3 to 6", "by noise alone", "A1, B2"):
        assert text in page
    kept = {path: path.stat().st_mtime_ns for path in study.runs.rglob("*.h5")}
    lost = next(path for path in kept if path.name.startswith("runs_2"))
    lost.unlink()
    again = study.robid("study", FILE)
    assert "1 of 2 tasks are there from an earlier run" in again.err
    assert {path for path, at in kept.items() if path.stat().st_mtime_ns != at} == {lost}


def test_a_part_that_is_left_out_leaves_no_trace(study):
    leave_out(study, "synthetic")
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    assert not [name for name in answer.json["summary"] if name.startswith("synthetic")]
    assert "known structure" not in (study.runs / "report.html").read_text()
    leave_out(study, "local")
    shutil.rmtree(study.runs)
    answer = study.robid("study", FILE, "--json")
    assert answer.code == 0, answer.err
    assert set(answer.json["summary"]) == {"tasks.count", "tasks.seconds"}
    assert "No part of the study could be done." in (study.runs / "report.html").read_text()
