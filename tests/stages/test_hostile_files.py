"""Pipes and devices in the place of files that users name: refused at once, and nothing waits for a writer."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

_STAGES = Path(__file__).parent
_SECONDS = 60  # Where something waits, it waits for ever


def _robid(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "robid", *arguments]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=_SECONDS, stdin=subprocess.DEVNULL
    )


@pytest.fixture
def folder(tmp_path):
    for name in ("bench.yaml", "bench_robot.yaml"):
        shutil.copy(_STAGES / name, tmp_path / name)
    os.mkfifo(tmp_path / "pipe.yaml")
    return tmp_path


@pytest.mark.parametrize("command", ["status", "run", "study", "inspect", "upgrade"])
def test_a_pipe_is_no_settings_file(folder, command):
    done = _robid(folder, command, "pipe.yaml")
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("robid: pipe.yaml: S")
    assert len(done.stderr.strip().splitlines()) == 2


@pytest.mark.parametrize("robot", ["pipe.yaml", "/dev/zero"])
def test_a_pipe_or_a_device_is_no_robot_file(folder, robot):
    text = (folder / "bench.yaml").read_text(encoding="utf-8").replace("bench_robot.yaml", robot)
    (folder / "other.yaml").write_text(text, encoding="utf-8")
    done = _robid(folder, "status", "other.yaml")
    assert done.returncode == 2, done.stderr
    assert "S333" in done.stderr


def test_a_pipe_is_no_model_of_a_robot(folder):
    for suffix in ("urdf", "xml"):
        os.mkfifo(folder / f"pipe.{suffix}")
        assert _robid(folder, "init", "made", "--model", f"pipe.{suffix}").returncode == 4


def test_a_pipe_in_the_place_of_an_output_is_told(folder):
    run = folder / "runs/here"
    for relative in ("log/excitation.h5", "report.html"):
        path = run / relative
        path.parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(path)
        told = _robid(folder, "status", "bench.yaml", "--run-dir", "runs/here")
        assert told.returncode == 0, told.stderr
        done = _robid(folder, "run", "bench.yaml", "--run-dir", "runs/here")
        assert done.returncode == 3, done.stderr
        assert "pipe" in done.stderr
        path.unlink()


def test_a_pipe_is_no_log(folder):
    os.mkfifo(folder / "log.mat")
    for command in ("run", "simulate-or-acquire"):
        done = _robid(folder, command, "bench.yaml")
        assert done.returncode in (2, 3), done.stderr
    assert _robid(folder, "inspect", "log.mat").returncode == 2
    assert _robid(folder, "status", "bench.yaml").returncode == 0
