import json
import shutil
from pathlib import Path

import pytest

_HERE = Path(__file__).parent
TASKS = {f"{name}_{number}" for name in ("lls15u", "lls1u", "lls15u_2dec", "lls15u_plain", "lls1u_plain")
         for number in (1, 2)}  # fmt: skip


def names(folder):
    return {path.name.split(".")[0] for path in (folder / "tasks" / "starts").glob("*.h5")}


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / "estimators.yaml", shop.folder)
    (shop.folder / "paper.yaml").write_text("reasonable: {lls15u: 0.123}\ntable_1: {k_1: [1, 2, 3, 4, 5, 6]}\n")
    object.__setattr__(shop, "runs", shop.folder / "runs" / "estimators")
    return shop


def test_models_are_scored_and_a_lost_task_is_done_again(study):
    answer = study.robid("study", "estimators.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert names(study.runs) == TASKS
    assert (summary["fits"], summary["tasks.count"]) == (12, 12)
    individuals = (study.runs / "tasks" / "individuals").glob("*.h5")
    assert {path.name.split(".")[0] for path in individuals} == {"lls15u_other_1", "lls15u_other_2"}
    assert 0 < summary["lls15u.individual_error"] < 0.1
    assert summary["lls15u.individual_std"] > 0
    assert 0 <= summary["lls15u.individual_covered"] <= 1
    assert summary["lls15u.best_cost"] == 1
    assert summary["lls15u.reasonable"] == 1
    assert summary["lls15u.springs_within_2"] == 1
    assert 0.5 < summary["best_over_truth"] <= 1
    assert summary["lls1u.best_cost"] >= 1
    assert summary["best_configuration"] in (1, 2)
    assert summary["fits12_s"] > 0
    assert {"lls15u.reasonable_2dec", "lls1u.reasonable_plain", "conclusion_7"} <= summary.keys()
    page = (study.runs / "report.html").read_text()
    for text in ("12 %", "Fig. 3", "Fig. 9", "Using phase information", "Table 1", "k_1", "Several individuals"):
        assert text in page
    kept = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks" / "starts").iterdir()}
    lost = next(iter(kept))
    lost.unlink()
    again = study.robid("study", "estimators.yaml")
    assert "9 of 10 tasks are there from an earlier run" in again.err
    assert {path for path, at in kept.items() if path.stat().st_mtime_ns != at} == {lost}


@pytest.mark.slow
def test_more_starts_leave_the_first_ones_as_they_are(study):
    study.change("  wide: [lls15u]\n", "  plain: false\n", "estimators.yaml")
    assert study.robid("study", "estimators.yaml").code == 0
    few = json.loads((study.runs / "summary.json").read_text())
    assert names(study.runs) == {"lls15u_1", "lls15u_2", "lls1u_1", "lls1u_2"}
    study.change("starts: 6", "starts: 8", "estimators.yaml")
    many = study.robid("study", "estimators.yaml", "--json").json["summary"]
    assert (few["fits"], many["fits"]) == (12, 16)
    assert many["lls15u.best_cost"] == 1


def test_a_missing_paper_is_told_before_the_fits(study):
    (study.folder / "paper.yaml").unlink()
    answer = study.robid("study", "estimators.yaml")
    assert answer.code == 2
    assert "paper.yaml" in answer.err
    assert not study.runs.exists() or not (study.runs / "bench").exists()
