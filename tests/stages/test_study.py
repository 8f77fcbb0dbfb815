import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from robid.pipeline import terminal
from robid.pipeline.graph import Run
from robid.studies.frf import study as frf
from robid.studies.settings.study import load_with_study

_HERE = Path(__file__).parent
TASKS = {f"configuration_{index}_chunk_{chunk}" for index in (1, 2) for chunk in (1, 2)}


def names(folder):
    return {path.name.split(".")[0] for path in (folder / "tasks").glob("*.h5")}


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / "study.yaml", shop.folder)
    object.__setattr__(shop, "runs", shop.folder / "runs" / "study")
    return shop


@pytest.fixture(scope="module")
def finished_study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    shutil.copy(_HERE / "study.yaml", folder)
    shutil.copy(_HERE / "arm.yaml", folder)
    command = [sys.executable, "-m", "robid", "study", "study.yaml", "--json"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "runs", json.loads(done.stdout)


@pytest.fixture
def done(study, finished_study):
    shutil.copytree(finished_study[0], study.folder / "runs")
    return study


def test_a_study_makes_its_tasks_and_what_they_need(done, finished_study):
    assert names(done.runs) == TASKS
    made = {str(path.relative_to(done.runs)) for path in done.runs.rglob("*") if path.is_file()}
    assert {path for path in made if not path.startswith("tasks/")} == {
        "bench/excitation.h5",
        "report.html",
        "summary.json",
    }
    summary = json.loads((done.runs / "summary.json").read_text())
    assert finished_study[1]["summary"] == summary
    assert all(isinstance(value, int | float) for value in summary.values())
    assert summary["frf.groups"] == summary["frf.configurations"] == 2
    assert summary["tasks.count"] == 4
    assert summary["bias.nominal.median_diagonal"] < 0.5 * summary["bias.none.median_diagonal"]
    page = (done.runs / "report.html").read_text()
    assert page.count("<html") == 1
    for text in ("logarithmic", "arithmetic", "Against reference figures", "bias.none.median_diagonal"):
        assert text in page


def test_a_study_tells_how_far_it_is_where_there_is_no_terminal(done, monkeypatch):
    monkeypatch.setattr(terminal, "LINE_EVERY_S", 0.0)
    next((done.runs / "tasks").glob("*.h5")).unlink()
    assert "tasks  4 of 4 tasks done" in done.robid("study", "study.yaml").err


def test_a_linear_robot_without_noise_has_no_bias(study):
    study.change("encoder_noise_rad: 1.0e-5, torque_noise_nm: 0.02, friction: lugre", "", "study.yaml")
    study.change("rms: 6", "rms: 1", "study.yaml")
    study.change("transient_periods: 2", "transient_periods: 4\n        steps_per_sample: 4", "study.yaml")
    study.change("compensation: nominal", "compensation: none", "study.yaml")
    answer = study.robid("study", "study.yaml", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["summary"]["bias.none.median_diagonal"] < 2e-3
    assert answer.json["summary"]["frf.logarithmic.diagonal.median_error"] < 2e-3


def test_chunks_differ_in_phases_and_noise_alone(done):
    run = Run(load_with_study(Path("study.yaml")), done.runs, "serial", 1)
    chunks, _, places, *_ = zip(*(task.arguments for task in frf.tasks(run, ())), strict=True)
    assert places == (0, 0, 1, 1)
    assert [len(chunk.reference) for chunk in chunks] == [2, 2, 2, 2]
    seeds = [chunk.options.seed for chunk in chunks]
    assert seeds[0] != seeds[1]
    assert seeds[:2] == seeds[2:]  # the configuration's index seeds as well
    assert not np.allclose(chunks[0].reference, chunks[1].reference)
    assert chunks[0].robot == chunks[1].robot


def test_a_second_study_does_nothing(done):
    before = done.files()
    answer = done.robid("study", "study.yaml")
    assert answer.code == 0
    assert answer.out.strip().endswith("report.html  fresh")
    assert "stays the default" in answer.out or "should be the default" in answer.out
    assert done.files() == before


def test_only_what_a_change_decides_is_done_again(done):
    before = {path.name: path.stat().st_mtime_ns for path in (done.runs / "tasks").iterdir()}
    done.change("bias.none.median_diagonal: 0.1", "bias.none.median_diagonal: 0.2", "study.yaml")
    assert done.robid("study", "study.yaml", "--json").json["outcome"] == "made"
    assert {path.name: path.stat().st_mtime_ns for path in (done.runs / "tasks").iterdir()} == before
    done.change("estimators: [logarithmic, arithmetic]", "estimators: [logarithmic]", "study.yaml")
    answer = done.robid("study", "study.yaml", "--json")
    assert "frf.arithmetic.median_error" not in answer.json["summary"]
    assert not before.keys() & {path.name for path in (done.runs / "tasks").iterdir()}
    assert names(done.runs) == TASKS


def test_a_lost_task_is_done_again_alone_and_force_does_all(done):
    contents = done.contents()
    lost = next((done.runs / "tasks").glob("*.h5"))
    lost.unlink()
    answer = done.robid("study", "study.yaml")
    assert "3 of 4 tasks are there from an earlier run" in answer.err
    assert answer.out.strip().endswith("fresh")
    assert done.contents() == contents
    before = lost.stat().st_mtime_ns
    assert done.robid("study", "study.yaml", "--force").code == 0
    assert lost.stat().st_mtime_ns > before
    assert done.contents() == contents


def test_processes_give_the_same_content(done):
    answer = done.robid("study", "study.yaml", "--run-dir", "other", "--backend", "processes", "--workers", "2")
    assert answer.code == 0, answer.err
    assert done.contents(done.folder / "other") == done.contents()


@pytest.mark.parametrize(
    ("number", "code"), [pytest.param(signal.SIGKILL, -signal.SIGKILL, marks=pytest.mark.slow), (signal.SIGINT, 130)]
)
def test_a_stopped_study_goes_on(study, number, code):
    study.change("periods: 2", "periods: 8", "study.yaml")
    command = [sys.executable, "-m", "robid", "study", "study.yaml"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while not names(study.runs):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said.decode()
    kept = {path: path.stat().st_mtime_ns for path in (study.runs / "tasks").glob("*.h5")}
    assert len(kept) < 4
    assert not (study.runs / "report.html").exists()
    answer = study.robid("study", "study.yaml")
    assert answer.code == 0, answer.err
    assert f"{len(kept)} of 4 tasks are there from an earlier run" in answer.err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept


def test_a_file_without_a_study_is_refused(shop):
    answer = shop.robid("study", "small.yaml")
    assert answer.code == 2
    assert "S343" in answer.err
