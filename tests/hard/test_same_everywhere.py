"""The same content wherever a command runs: backends, BLAS threads, folders, fresh environments."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import damage
import jobs
from hard_summary import note

pytest.importorskip("pyarrow")
pytestmark = pytest.mark.hard
ROOT = Path(__file__).parents[2]
PLACES = {
    "processes": ("processes", {}),
    "dask": ("dask", {}),
    "two threads": ("serial", {"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}),
    "three threads in processes": ("processes", {"OPENBLAS_NUM_THREADS": "3", "OMP_NUM_THREADS": "3"}),
    "another world": ("serial", {"LC_ALL": "C", "TZ": "Asia/Tokyo", "PYTHONHASHSEED": "7", "COLUMNS": "40"}),
    "no home": ("serial", {"HOME": "/nowhere", "PYTHONDONTWRITEBYTECODE": "1"}),
}


@pytest.fixture(scope="module")
def truths(tmp_path_factory):
    return {name: jobs.truth_of(name, tmp_path_factory.mktemp(name) / "truth") for name in jobs.JOBS}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", jobs.JOBS)
def test_the_place_does_not_change_the_content(truths, name, place, tmp_path):
    if place == "dask":
        pytest.importorskip("distributed")
    backend, environment = PLACES[place]
    folder = tmp_path / "a folder of other length and with spaces"
    folder.mkdir()
    truths[name].job.make(folder)
    code, err = jobs.run(truths[name].job, folder, backend, **environment)
    other = truths[name].check(folder) if code in (0, 5) else f"{code}: {err[-1500:]}"
    note(f"place {place}", list(jobs.JOBS).index(name), {0: f"WRONG: {name}: {other}" if other else "same"})


@pytest.mark.parametrize("which", [1, 2])
def test_a_fresh_environment_does_not_change_the_content(truths, which, tmp_path):
    """Installed anew, with the versions that pip finds today within the project's bounds."""
    source = tmp_path / "source"
    shutil.copytree(ROOT / "robid", source / "robid", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "configs", source / "configs")
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "fresh"], check=True)
    python = tmp_path / "fresh/bin/python"
    installed = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", source], capture_output=True, text=True, check=False, timeout=900
    )
    if installed.returncode and "No matching distribution" in installed.stderr:
        pytest.skip("no index of packages can be reached")
    assert not installed.returncode, installed.stderr
    truth, folder = truths["run"], tmp_path / "work"
    folder.mkdir()
    truth.job.make(folder)
    environment = {key: value for key, value in damage._environment().items() if key != "PYTHONPATH"}
    command = [str(python), "-m", "robid", *truth.job.command]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    other = truth.check(folder) if done.returncode in (0, 5) else f"{done.returncode}: {done.stderr[-1500:]}"
    note("environment", which, {which: f"WRONG: {other}" if other else "same"})
