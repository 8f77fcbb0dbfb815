"""The wheel is enough: an installation that knows no checkout begins with an example and ends with a model."""

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
from importlib.metadata import version
from pathlib import Path
from shutil import copy, copytree, ignore_patterns
from zipfile import ZipFile

import pytest

_ROOT = Path(__file__).parents[2]
_NEEDED = 77
_BUILT = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"


def run(*command, cwd, **environment):
    own = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=own | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def built(what, source):
    """Builds in a source folder as an installer does; returns the file."""
    out = source.parent / "dist"
    return out / run(sys.executable, "-c", _BUILT, what, out, cwd=source).splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from the source distribution as it is for others."""
    if int(version("setuptools").partition(".")[0]) < _NEEDED:
        pytest.skip(f"building needs setuptools {_NEEDED}, which `make install` installs")
    source = tmp_path_factory.mktemp("build") / "source"
    source.mkdir()
    for name in ("robid", "configs"):
        copytree(_ROOT / name, source / name, ignore=ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        copy(_ROOT / name, source)
    archive = built("build_sdist", source)
    with tarfile.open(archive) as held:
        held.extractall(source.parent, filter="data")
    return built("build_wheel", source.parent / archive.name.removesuffix(".tar.gz"))


@pytest.fixture(scope="module")
def fresh(wheel, tmp_path_factory):
    """Python of an environment that has the wheel, and the packages of this one in place of downloads."""
    folder = tmp_path_factory.mktemp("fresh")
    run(sys.executable, "-m", "venv", "--without-pip", folder / "venv", cwd=folder)
    python = folder / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    places = dict.fromkeys(sysconfig.get_path(key) for key in ("purelib", "platlib"))
    places |= dict.fromkeys(path for path in sys.path if path.endswith("site-packages"))
    site = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip())
    (site / "borrowed.pth").write_text("\n".join(places))
    install = ("-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed")
    run(sys.executable, *install, wheel, cwd=folder)
    found = run(python, "-c", "import robid; print(robid.__file__)", cwd=folder).strip()
    assert Path(found).is_relative_to(site)
    return python


def test_every_example_is_in_the_wheel(wheel):
    from robid.scaffold.examples import EXAMPLES, example_files

    with ZipFile(wheel) as held:
        inside = {name.partition("scaffold/examples/")[2]: held.read(name) for name in held.namelist()}
    for name in EXAMPLES.values():
        text = (_ROOT / "configs" / name).read_text()
        robot = text.partition("\nrobot: ")[2].split()[0]
        for file in (name, robot):
            assert inside[file] == (_ROOT / "configs" / file).read_bytes()
    assert sum(name.endswith(".yaml") for name in inside) == 2 * len(EXAMPLES)
    assert example_files("drive", "mine").keys() == {"mine.yaml", "mine_robot.yaml"}


def test_an_installation_without_a_checkout_identifies_the_example(fresh, tmp_path):
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    run(fresh, "-m", "robid", "init", "drive", "--example", "drive", cwd=tmp_path)
    told = json.loads(run(fresh, "-m", "robid", "run", "drive/drive.yaml", "--json", cwd=tmp_path, **threads))
    assert (tmp_path / "runs/drive/report.html").is_file()
    assert [node["grade"] for node in told["nodes"] if node["grade"] is not None] == [2]
