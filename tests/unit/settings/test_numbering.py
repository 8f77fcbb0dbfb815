"""Numbers of configurations: from 1, in files of version 1 from 0, and the way from one to the other."""

import re
import shutil
from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.settings.robot_parts import plain_settings
from robid.settings.upgrade import upgraded
from robid.studies.settings.study import load_with_study

ROOT = Path(__file__).parents[3]
EXPERIMENTS = sorted(
    path
    for path in (ROOT / "configs").rglob("*.yaml")
    if "robot:" in path.read_text() and path.parent.name not in ("robots", "fleet")
)
ROBOTS = sorted((ROOT / "configs" / "robots").glob("*.yaml"))
NEW, OLD = "schema_version: 2", "schema_version: 1"


LISTS = re.compile(r"((?:configurations|choose_on|swapped): (?:&\w+ )?\[)([\d, ]+)\]")


def as_version_1(text):
    """A file as it was written when configurations counted from 0."""

    def lowered(found):
        return found[1] + ", ".join(str(int(number) - 1) for number in found[2].split(",")) + "]"

    return LISTS.sub(lowered, text.replace(NEW, OLD))


def plain(path):
    found = plain_settings(load_with_study(path).experiment)
    return {key: value for key, value in found.items() if key != "schema_version"}


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_an_example_of_version_1_says_the_same_once_it_is_upgraded(path, tmp_path, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "nowhere"))
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    here = tmp_path / "configs" / path.relative_to(ROOT / "configs")
    text = here.read_text()
    assert NEW in text
    wanted, old = plain(here), as_version_1(text)
    here.write_text(old)
    assert plain(here) == wanted
    assert upgraded(here, old) == text


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_of_a_robot_file_only_the_version_changes(path):
    text = path.read_text()
    assert upgraded(path, text.replace(NEW, OLD)) == text
    assert upgraded(path, text) is None


CONFIGURATIONS = """\
{version}
name: two
robot: arm.yaml
campaigns:
  measured: &measured
    configurations: {{list_deg: [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0], [50, 0]]}}
    excitation: {{period_s: 1, low_hz: 3, high_hz: 60, count: 20, rms: [1, 1]}}
    realizations: 2
    source: {{simulate: {{}}}}
fits:
  some: &some {{family: elastic, from: measured, configurations: {numbers}}}
  again: {{<<: *some, starts: 2}}  # merged
"""


def file_of(folder, version, numbers):
    shutil.copy(ROOT / "tests" / "stages" / "arm.yaml", folder)
    path = folder / "two.yaml"
    path.write_text(CONFIGURATIONS.format(version=version, numbers=numbers))
    return path


def indices(path):
    return [fit.configurations for fit in load_experiment(path).experiment.fits.values()]


def test_version_2_counts_from_1_and_version_1_from_0(tmp_path):
    assert indices(file_of(tmp_path, NEW, "[1, 6]")) == [(0, 5)] * 2
    assert indices(file_of(tmp_path, OLD, "[0, 5]")) == [(0, 5)] * 2


def test_numbers_that_are_merged_are_upgraded_once(tmp_path):
    path = file_of(tmp_path, OLD, "[0, 5]")
    text = upgraded(path, path.read_text())
    assert "[1, 6]" in text
    assert text.endswith("{<<: *some, starts: 2}  # merged\n")
    path.write_text(text)
    assert indices(path) == [(0, 5)] * 2


@pytest.mark.parametrize(
    ("version", "numbers", "codes"),
    [(NEW, "[0, 6]", {"S535"}), (NEW, "[1, 7]", {"S201"}), (OLD, "[0, 6]", {"S201"}), (NEW, "[2, 2]", {"S202"})],
)
def test_numbers_that_there_are_not_are_refused(tmp_path, version, numbers, codes):
    with pytest.raises(SettingsError) as refused:
        load_experiment(file_of(tmp_path, version, numbers))
    assert set(refused.value.codes) == codes
    assert "fits.some.configurations[" in str(refused.value)


def test_a_version_that_nobody_knows_is_not_upgraded(tmp_path):
    for text in ("schema_version: 3\nname: x\n", "name: x\n"):
        with pytest.raises(SettingsError) as refused:
            upgraded(tmp_path / "x.yaml", text)
        assert refused.value.codes == ("S536",)
