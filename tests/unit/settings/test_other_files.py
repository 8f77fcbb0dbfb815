"""Files that are another kind than the one asked for are named as what they are, in one message."""

import shlex
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from robid.cli import run_command
from robid.errors import SettingsError
from robid.fleet.manifest import read_manifest
from robid.models.known import load_experiment
from robid.settings.load import load_robot
from robid.settings.other_files import refuse_no_log

CONFIGS = Path(__file__).parents[3] / "configs"
MODEL = """<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="turn" axis="0 0 1" range="-1 1"
    limited="true"/><geom type="capsule" size="0.05" fromto="0 0 0 0.5 0 0" mass="5"/></body></worldbody></mujoco>"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An experiment, its robot, and files of many other kinds."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robots").mkdir()
    shutil.copy(CONFIGS / "drive.yaml", tmp_path / "drive.yaml")
    shutil.copy(CONFIGS / "robots" / "geared_drive.yaml", tmp_path / "robots" / "geared_drive.yaml")
    (tmp_path / "fleet.csv").write_text("id,log\n1,a.csv\n2,b.csv\n")
    (tmp_path / "fleet.txt").write_text("id;log\n1;a.csv\n2;b.csv\n")
    (tmp_path / "arm.xml").write_text(MODEL)
    (tmp_path / "arm.urdf").write_text('<?xml version="1.0"?>\n<robot name="arm"><link name="base"/></robot>')
    (tmp_path / "noise.yaml").write_bytes(bytes(range(256)) * 3)
    (tmp_path / "utf16.yaml").write_text("name: x", encoding="utf-16")
    (tmp_path / "summary.json").write_text('{"grade": "trust", "parameters": 6}')
    (tmp_path / "list.json").write_text("[1, 2]")
    (tmp_path / "empty.yaml").touch()
    savemat(tmp_path / "log.mat", {"a": np.zeros(3)})
    with h5py.File(tmp_path / "frf.h5", "w") as file:
        file["a"] = np.zeros(3)
    return Path()


def refused(load, path):
    """Returns the message: one, of readable length, with the exit code of settings."""
    with pytest.raises(SettingsError) as caught:
        load(path)
    assert caught.value.exit_code == 2
    assert len(caught.value.what.splitlines()) == 1
    assert len(str(caught.value)) < 400
    return str(caught.value)


KINDS = [
    ("fleet.csv", "S527 is a table"),
    ("fleet.txt", "S527 is a table"),
    ("arm.xml", "S526 is an MJCF"),
    ("arm.urdf", "S526 is a URDF"),
    ("noise.yaml", "S548 is a binary file"),
    ("utf16.yaml", "S334"),
    ("summary.json", "S529 is no settings file"),
    ("list.json", "S336"),
    ("empty.yaml", "S335"),
    ("log.mat", "S548 is a MAT file"),
    ("frf.h5", "S548 is an HDF5 file"),
    ("robots", "S525 is a folder"),
]


@pytest.mark.parametrize(("name", "told"), [*KINDS, ("robots/geared_drive.yaml", "S549 is a robot file")])
def test_what_is_no_experiment_is_named(folder, name, told):
    assert f"{folder / name}" in refused(load_experiment, folder / name)
    assert told in refused(load_experiment, folder / name)


@pytest.mark.parametrize(("name", "told"), [*KINDS, ("drive.yaml", "S528 is an experiment file")])
def test_what_is_no_robot_is_named_on_the_line_that_names_it(folder, name, told):
    change(folder, "robots/geared_drive.yaml", name)
    message = refused(load_experiment, folder / "drive.yaml")
    assert f"drive.yaml:{line_of(folder, 'robot: ')}: robot: {folder / name}" in message
    assert told in message
    refused(load_robot, folder / name)


def change(folder, old, new):
    text = (folder / "drive.yaml").read_text()
    assert old in text
    (folder / "drive.yaml").write_text(text.replace(old, new, 1))


def line_of(folder, start):
    return next(
        i for i, line in enumerate((folder / "drive.yaml").read_text().splitlines(), 1) if line.startswith(start)
    )


@pytest.mark.parametrize(
    ("named", "proposed"), [("robots/geard_drive.yaml", "robots/geared_drive.yaml"), ("nowhere/arm.yaml", "no folder")]
)
def test_a_robot_file_that_is_not_there_is_told_with_what_was_meant(folder, named, proposed):
    change(folder, "robots/geared_drive.yaml", named)
    assert proposed in refused(load_experiment, folder / "drive.yaml")


def test_a_file_with_another_ending_is_proposed(folder):
    assert f"did you mean `{folder / 'drive.yaml'}`" in refused(load_experiment, folder / "drive.yml")


@pytest.mark.parametrize(
    ("name", "told"), [("drive.yaml", "S523"), ("frf.h5", "S548 is an HDF5 file"), ("robots", "S525 is a folder")]
)
def test_what_is_no_manifest_is_named(folder, name, told):
    assert told in refused(read_manifest, folder / name)


def test_the_remedy_for_a_rigid_model_works(folder, capsys):
    change(folder, "robots/geared_drive.yaml", "arm.xml")
    remedy = refused(load_experiment, Path("drive.yaml")).split("`")[1].replace("NAME", "mine")
    assert run_command(shlex.split(remedy)[1:]) == 0
    assert run_command(["status", "mine/mine.yaml"]) == 0
    capsys.readouterr()
    assert load_experiment(Path("mine/mine.yaml")).robot.model is not None


@pytest.mark.usefixtures("folder")
def test_the_remedy_for_a_robot_file_works(capsys):
    remedy = refused(load_experiment, Path("robots/geared_drive.yaml")).split("`robid ")[1].split("`")[0]
    assert run_command(shlex.split(remedy.replace("NAME", "mine"))) == 0
    capsys.readouterr()
    load_experiment(Path("mine/mine.yaml"))


@pytest.mark.parametrize("version", ["0", "-1", "'2'", "1.5", "true", "two", "[2]", "", None])
def test_a_version_that_is_none_is_told_once_with_the_one_to_write(folder, version):
    change(folder, "schema_version: 2\n", "" if version is None else f"schema_version: {version}\n")
    message = refused(load_experiment, folder / "drive.yaml")
    assert f"schema_version: {'S531' if version else 'S522'}" in message
    assert "write `schema_version: 2`" in message


def test_a_file_without_a_version_that_counts_from_0_is_told_so(folder):
    change(folder, "schema_version: 2\n", "")
    change(folder, "family: elastic,", "family: elastic, configurations: [0, 2],")
    assert "write `schema_version: 1`" in refused(load_experiment, folder / "drive.yaml")


def test_nothing_is_said_of_a_newer_file_but_that(folder):
    change(folder, "schema_version: 2", "schema_version: 3")
    change(folder, "campaigns:", "experiments:")
    message = refused(load_experiment, folder / "drive.yaml")
    assert f"drive.yaml:{line_of(folder, 'schema')}: S521 `schema_version: 3` is newer" in message
    robot = folder / "robots" / "geared_drive.yaml"
    robot.write_text(robot.read_text().replace("schema_version: 2", "schema_version: 7").replace("joints:", "axes:"))
    assert "S521 `schema_version: 7` is newer" in refused(load_robot, robot)


@pytest.mark.parametrize("written", ["robot:\n", ""])
def test_a_forgotten_robot_is_told_once(folder, written):
    change(folder, (folder / "drive.yaml").read_text().splitlines()[line_of(folder, "robot: ") - 1] + "\n", written)
    message = refused(load_experiment, folder / "drive.yaml")
    assert "robot: S147 is missing" in message
    assert "`campaigns.estimation.source` (a simulation)" in message


URDF = '<?xml version="1.0"?>\n<robot name="a"><link name="b"/></robot>\n'


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("robot.yaml", (CONFIGS / "robots/tx40.yaml").read_text("utf-8"), "a robot file"),
        ("drive.yaml", (CONFIGS / "drive.yaml").read_text("utf-8"), "an experiment file"),
        ("arm.urdf", URDF, "a URDF"),
        ("arm.xml", '<mujoco model="a"/>', "an MJCF"),
        ("report.html", "<!doctype html>\n<html></html>", "a page"),
    ],
)
def test_inspect_names_a_file_that_is_neither_artifact_nor_log(tmp_path, capsys, name, text, told):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    assert run_command(["inspect", str(path)]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"S580 is {told}," in said
    assert "remedy:" in said
    assert "D085" not in said


def test_a_log_of_text_is_none_of_them(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,joints\n0,1\n1,2\n", encoding="utf-8")
    refuse_no_log(path)
    for log in CONFIGS.glob("**/*.csv"):
        refuse_no_log(log)
