"""The tutorial of the KR300: its commands run, on the small drive that it offers instead, and its table is true."""

import re
import shlex

import pytest

from answers import ask
from robid.models.known import load_experiment
from robid.scaffold.examples import EXAMPLES, examples_folder
from robid.simulate.truth import true_robot
from settings_tables import ROOT

PAGE = (ROOT / "docs/tutorials/kr300.md").read_text(encoding="utf-8")
FENCE = re.compile(r"^```\n(.*?)^```", re.MULTILINE | re.DOTALL)
SETTING = re.search(r"In `(.*?)`, set `(\w+)` of the fit to (\d+)", PAGE)


def test_every_command_runs_with_the_example_that_takes_a_minute(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before, after = PAGE.split(SETTING[0])
    assert "robid run" in before
    for part in (before, after):
        for line in "".join(FENCE.findall(part)).splitlines():
            if line.startswith("robid "):
                answer = ask(*shlex.split(line.replace("kr300", "drive"))[1:])
                assert answer.code == 0, (line, answer.err)
                if part is after and " status " in line:
                    states = dict(re.findall(r"^(\S+) +(fresh|stale|missing)", answer.out, re.MULTILINE))
                    made_again = {"fits/elastic/model.h5", "fits/elastic/validation.h5", "report.html"}
                    assert {name for name, state in states.items() if state != "fresh"} == made_again
        file, key, value = SETTING.groups()
        text, changed = re.subn(rf"\b{key}: \d+", f"{key}: {value}", (tmp_path / file).read_text(encoding="utf-8"))
        assert changed == 1
        (tmp_path / file).write_text(text, encoding="utf-8")
    assert (tmp_path / "runs/first/report.html").is_file()
    assert len(list((tmp_path / "runs/first/fits/elastic/export").iterdir())) == 2


def test_the_campaigns_are_those_of_the_example():
    experiment = load_experiment(examples_folder() / EXAMPLES["kr300"]).experiment
    listed = set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE))
    assert listed == {*experiment.campaigns, *experiment.designs, *experiment.fits}


@pytest.mark.parametrize("name", ["gear_1", "bearing_1x", "forearm"])
def test_nominal_and_true_stiffness_are_those_of_the_example(name):
    loaded = load_experiment(examples_folder() / EXAMPLES["kr300"])
    robot = loaded.robot.to_robot()
    truth = true_robot(robot, loaded.experiment.campaigns["estimation"].source.simulate.truth)
    row = re.search(rf"^\| {name} \|.*\| (?:a )?([\d.]+) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
    for shown, described in zip(row.groups(), (robot, truth), strict=True):
        value = next(spring.stiffness for spring in described.springs if spring.name == name) / 1e6
        assert f"{value:.{len(shown.partition('.')[2])}f}" == shown
