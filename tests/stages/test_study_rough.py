"""A small study of rough robot files, from drawn robots to page, and what it refuses."""

import json
import shutil
from pathlib import Path

import pytest

from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact

_HERE = Path(__file__).parent
_ROOT = _HERE.parents[1]


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / "rough.yaml", shop.folder)
    emps = (_ROOT / "configs/emps.yaml").read_text()
    (shop.folder / "emps.yaml").write_text(emps.replace("robots/emps.yaml", f"{_ROOT}/configs/robots/emps.yaml"))
    object.__setattr__(shop, "runs", shop.folder / "runs" / "rough")
    return shop


def tasks(study):
    folders = sorted((study.runs / "tasks").iterdir())
    return {folder.name: sorted(path.name.split(".")[0] for path in folder.glob("*.h5")) for folder in folders}


def test_a_robot_is_drawn_fitted_twice_and_held_against_new_motions(study, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(study.folder / "nowhere"))
    for old, new in (("robots: 2", "robots: 1"), ("added: 1", "added: 0"), ("{high: {encoder", "{} # {high: {encoder")):
        study.change(old, new, "rough.yaml")
    answer = study.robid("study", "rough.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert [names for names in tasks(study).values() if names] == [["heavy_1"]]
    assert (summary["rough.validated.good"], summary["rough.one_motion.bad"]) == (1, 1)
    assert not [name for name in summary if name.startswith("cutoff")]
    page = (study.runs / "report.html").read_text()
    for text in ("What is asked", "Grades that are wrong", "DATA_EMPS.mat"):
        assert text in page


@pytest.mark.slow
def test_robots_are_added_while_fits_are_too_few_and_cut_offs_are_compared(study, data_folder):
    data_folder("emps")
    answer = study.robid("study", "rough.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    # No fit of one motion is good, since all are poor: robots are added as often as may be.
    rounds = {f"robots_{at}": [f"heavy_{1 + at}"] for at in (2, 3, 4)}
    assert tasks(study) == {"robots_1": ["heavy_1", "heavy_2"], **rounds, "cutoffs": ["emps", "heavy_high"]}
    assert (summary["rough.robots"], summary["rough.one_motion.bad"]) == (5, 5)
    assert summary["rough.validated.median_error"] < summary["rough.one_motion.median_error"]
    assert summary["cutoff.loss"] == max(summary["cutoff.heavy_high.loss"], summary["cutoff.emps.loss"])
    # Held-out forces of the real axis are known to some percent, as its published fit has them.
    assert summary["cutoff.emps.error"] < 0.1
    held = [read_artifact(path, TASK) for path in (study.runs / "tasks").rglob("heavy_?.*")]
    assert sorted(one.attributes["balanced"] for one in held) == [False, False, True, True, True]
    made = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").rglob("*.h5")}
    next(path for path in made if path.name.startswith("heavy_4")).unlink()
    assert study.robid("study", "rough.yaml").code == 0
    changed = [path.name.split(".")[0] for path, at in made.items() if path.stat().st_mtime_ns != at]
    assert changed == ["heavy_4"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("balanced: lift", "balanced: left", "S434 study.arms.heavy: there is no joint `left`"),
        ("home_deg: [0, 20]", "home_deg: [0]", "S434 study.arms.heavy: `home_deg` has 1 angles for 2 joints"),
    ],
)
def test_an_arm_must_fit_its_robot_file(study, old, new, message):
    study.change(old, new, "rough.yaml")
    answer = study.robid("study", "rough.yaml")
    assert answer.code == 2, answer.err
    assert message in answer.flat
