"""The rows of a manifest as experiments, before any of them runs."""

import shutil
from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.fleet.rows import load_fleet

_CONFIGS = Path(__file__).parents[3] / "configs/fleet"


@pytest.fixture
def load(tmp_path):
    shutil.copytree(_CONFIGS, tmp_path, dirs_exist_ok=True)

    def load(lines):
        manifest = tmp_path / "fleet.csv"
        manifest.write_text("id,log,payload_kg,note\n" + "".join(f"{line}\n" for line in lines))
        return load_fleet(manifest, tmp_path / "logs.yaml")

    return load


def test_a_log_that_two_rows_have_is_told(load, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "link.mat").symlink_to("a.mat")
    found = load(["a,a.mat,5,x", "b,sub/../a.mat,5,y", "c,b.mat,5,", "d,link.mat,5,z", "e,a.mat,4,"]).warnings
    place = tmp_path / "fleet.csv"
    assert [text for text in found if "again" in text] == [
        f"{place}:{line}: row {name} is row a again, {place}:2: the same logs and settings"
        for line, name in ((3, "b"), (5, "d"))
    ]


@pytest.mark.parametrize(("log", "text"), [("loop.mat", "S360"), ("a\0.mat", "a NUL character")])
def test_a_log_whose_name_leads_nowhere_is_told_with_its_line(load, tmp_path, log, text):
    (tmp_path / "loop.mat").symlink_to("loop.mat")
    with pytest.raises(SettingsError) as caught:
        load(["a,a.mat,5,", f"b,{log},5,"])
    [line] = str(caught.value.what).splitlines()
    assert f"fleet.csv:3: row b, column `log`: {tmp_path}" in line
    assert text in line


def test_a_number_that_is_none_is_told_with_its_line(load):
    with pytest.raises(SettingsError, match=r"fleet.csv:3: row b, column `payload_kg`.*found '-_'"):
        load(["a,a.mat,5,", "b,b.mat,-_,"])
