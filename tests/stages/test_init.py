"""A folder to begin with: from an example."""

import pytest

from answers import ask
from robid.models.known import load_experiment
from robid.scaffold.examples import EXAMPLES, examples_folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_is_a_folder_of_two_files_that_load(here, example):
    told = ask("init", "first", "--example", example, "--json").json
    assert sorted(path.name for path in (here / "first").iterdir()) == sorted(told["files"])
    assert sorted(told["files"]) == ["first.yaml", "first_robot.yaml"]
    loaded = load_experiment(here / "first/first.yaml")
    source = load_experiment(examples_folder() / EXAMPLES[example])
    assert loaded.experiment.name == "first"
    assert loaded.experiment.campaigns == source.experiment.campaigns
    assert loaded.robot == source.robot
    for command in told["next"]:
        assert command.endswith("first/first.yaml")
    assert ask(*told["next"][0].split()[1:]).code == 0


def test_a_folder_that_holds_something_stays_as_it_is(here):
    (here / "mine").mkdir()
    (here / "mine/robot.yaml").write_text("kept")
    answer = ask("init", "mine", "--example", "drive")
    assert (answer.code, "S553" in answer.err) == (2, True)
    assert [(path.name, path.read_text()) for path in (here / "mine").iterdir()] == [("robot.yaml", "kept")]


def test_an_empty_folder_is_filled(here):
    (here / "mine").mkdir()
    assert ask("init", "mine", "--example", "drive").code == 0
    assert (here / "mine/mine.yaml").is_file()


@pytest.mark.parametrize(
    ("name", "options", "code"),
    [("mine", (), "S555"), ("a b", ("--example", "drive"), "S551"), ("file", ("--example", "drive"), "S552")],
)
def test_what_cannot_be_begun_leaves_nothing(here, name, options, code):
    (here / "file").write_text("kept")
    answer = ask("init", name, *options)
    assert (answer.code, code in answer.err) == (2, True)
    assert [path.name for path in here.iterdir()] == ["file"]


def test_a_folder_below_a_file_is_refused(here):
    (here / "file").write_text("kept")
    answer = ask("init", "file/inside", "--example", "drive")
    assert (answer.code, "S552" in answer.err) == (2, True)
