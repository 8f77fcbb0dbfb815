"""The study of fleets through the command line: sixteen arms, one with each kind of fault."""

import csv
import json
import shutil
from pathlib import Path

import pytest
from scipy.io import loadmat

from robid.backends.map import make_map
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.studies.fleet import logs, reprocessed
from robid.studies.fleet.logs import fleet_robots
from robid.studies.settings.study import KINDS, load_with_study

_HERE = Path(__file__).parent
RATES = {("serial", 1): 1.0, ("dask", 1): 1.0, ("dask", 2): 1.5}


@pytest.fixture
def study(shop, monkeypatch):
    for name in ("many.yaml", "many_logs.yaml"):
        shutil.copy(_HERE / name, shop.folder)
    object.__setattr__(shop, "runs", shop.folder / "runs" / "many")
    monkeypatch.setattr(reprocessed, "core_count", lambda: 2)

    def finish_times(_, way):
        rate = RATES.get(way, 1.9)
        # The first rows of two workers are there at once.
        return [row / rate for row in range(11)] if way[1] == 1 else [0, *(row / rate for row in range(10))]

    monkeypatch.setattr(reprocessed, "finish_times", finish_times)
    monkeypatch.setattr(reprocessed, "make_map", lambda kind, *_, **__: make_map(kind.replace("dask", "serial"), 1))
    return shop


def loaded_run(study, folder, *changes):
    for old, new in changes:
        study.change(old, new, "many.yaml")
    return Run(load_with_study(Path("many.yaml")), study.folder / folder, "serial", 1)


@pytest.mark.slow
def test_faults_are_in_the_logs_and_found_in_the_fleet(study):
    answer = study.robid("study", "many.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert (summary["fleet.robots"], summary["fleet.planted"], summary["fleet.sound"]) == (16, 6, 10)
    assert summary["fleet.found"] == sum(summary[f"fleet.{kind}.found"] for kind in KINDS) == 6
    assert [summary[f"fleet.{kind}.failed"] for kind in ("dead", "gap", "file")] == [1, 1, 1]
    assert summary["fleet.false_alarms"] == 0
    assert summary["fleet.memory_rows"] == 16
    assert 0.9 < summary["fleet.memory_growth"] < 1.3
    assert summary["fleet.efficiency_processes"] == pytest.approx(0.95)
    assert summary["fleet.two_workers"] == pytest.approx(1.5)
    assert summary["fleet.scheduled.rows"] == 20
    assert 200 < summary["fleet.scheduled.bytes_back"] < 2000 < 2 * summary["fleet.scheduled.bytes_out"]
    missed = "4 of 6 figures that are asked for are reached; missed: fleet.efficiency_dask, fleet.two_workers."
    assert answer.json["verdict"] == {"text": missed, "level": "warn"}
    page = (study.runs / "report.html").read_text()
    for text in ("A damaged file", "Memory after each row", "Rows a second", "fleet.efficiency_dask", "reached"):
        assert text in page
    _has_the_faults(study)
    _goes_on(study)


def _has_the_faults(study):
    """Against the same robots without any fault."""
    run = loaded_run(study, "runs/many")
    robots = {robot.name: robot for robot in fleet_robots(run)}
    true = {
        one.of.name: one.robot
        for task in logs.log_tasks(run, run.loaded.experiment.study, {})
        for one in task.arguments[2]
    }
    sound_run = loaded_run(study, "sound", ("faults: {each: 1}", "faults: {each: 0}"))
    shutil.copytree(study.runs / "estimation", study.folder / "sound/estimation")
    sound: dict[str, Robot] = {}
    for task in logs.log_tasks(sound_run, sound_run.loaded.experiment.study, {}):
        logs.write_logs(*task.arguments)
        sound |= {one.of.name: one.robot for one in task.arguments[2]}
    study.change("faults: {each: 0}", "faults: {each: 1}", "many.yaml")
    for name, robot in robots.items():
        log, own = (study.folder / folder / robot.log for folder in ("sound", "runs/many"))
        softer = [
            after.stiffness / before.stiffness
            for before, after in zip(sound[name].springs, true[name].springs, strict=True)
        ]
        assert sorted(softer) == pytest.approx([0.7, 1] if robot.kind == "spring" else [1, 1])
        more = true[name].payload.mass_kg - sound[name].payload.mass_kg
        assert more == pytest.approx(5 if robot.kind == "payload" else 0)
        assert (log.read_bytes() == own.read_bytes()) == (not robot.kind)
        assert loadmat(log, simplify_cells=True)["c1_r2_e2"]["angle_lift"].shape == (1500,)
    with (study.runs / "manifest.csv").open() as stream:
        assert {row["payload_kg"] for row in csv.DictReader(stream)} == {"5"}


def _goes_on(study):
    """What is there is not made again, and a log that is gone is written as it was."""
    before = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").rglob("*.h5")}
    lost = study.runs / "logs/r0016.mat"
    content = lost.read_bytes()
    lost.unlink()
    answer = study.robid("study", "many.yaml")
    assert answer.code == 0, answer.err
    assert lost.read_bytes() == content
    after = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").rglob("*.h5")}
    assert [path.name.split(".")[0] for path in before if after[path] != before[path]] == ["r0013"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("campaign: estimation", "campaign: estimate", "study.campaign: there is no campaign `estimate`"),
        ("each: 1", "each: 3", "study.faults.each: S419 makes 18 robots with a fault, of 16"),
        ("rows: 3", "rows: 11", "study.speed.rows: S420 must be of sound robots, of which there are 10"),
        ("each: 1", "each: 1, lost_samples: [5, 3]", "lost_samples: S421"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_made(study, old, new, message):
    study.change(old, new, "many.yaml")
    study.refuse(2, message, command=("study", "many.yaml"))


def test_a_cluster_is_refused(study):
    answer = study.robid("study", "many.yaml", "--backend", "dask")
    assert answer.code == 2
    assert "S342" in answer.flat
    assert not (study.runs / "logs").exists()
