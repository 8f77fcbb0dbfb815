"""What is not a file of ours alone is never opened for writing."""

import os

import pytest

from robid.artifacts.atomic import check_folders, locked, remove_leftovers, replacing, write_json
from robid.errors import ArtifactError
from robid.writing import NotOwnError, create_new, open_own


@pytest.fixture
def other(tmp_path):
    """A file of somebody else."""
    path = tmp_path / "letter.txt"
    path.write_text("dear all")
    return path


WAYS = {
    "link": lambda path, other: path.symlink_to(other),
    "link to nothing": lambda path, other: path.symlink_to(other.with_name("new")),
    "second name": lambda path, other: path.hardlink_to(other),
    "pipe": lambda path, _: os.mkfifo(path),
    "folder": lambda path, _: path.mkdir(),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_lock_that_is_not_a_file_of_ours_is_refused_and_left_alone(tmp_path, other, way):
    lock = tmp_path / "run" / ".lock"
    lock.parent.mkdir()
    WAYS[way](lock, other)
    with pytest.raises(ArtifactError) as caught, locked(lock, "robid run"):
        pass
    assert caught.value.remedy
    assert os.path.lexists(lock)
    assert {path.name for path in tmp_path.iterdir()} == {"letter.txt", "run"}
    assert other.read_text() == "dear all"


@pytest.mark.parametrize("way", [way for way in WAYS if way != "folder"])
def test_an_unfinished_file_of_any_kind_is_not_written_through(tmp_path, other, way):
    path = tmp_path / "summary.json"
    WAYS[way](tmp_path / "summary.json.partial", other)
    write_json(path, {"a": 1})
    assert path.read_text().startswith("{")
    assert not path.is_symlink()
    assert {found.name for found in tmp_path.iterdir()} == {"letter.txt", "summary.json"}
    assert other.read_text() == "dear all"


def test_an_output_that_is_a_link_is_replaced_and_what_it_leads_to_stays(tmp_path, other):
    path = tmp_path / "summary.json"
    path.symlink_to(other)
    with replacing(path) as partial:
        partial.write_text("mine")
    assert other.read_text() == "dear all"
    assert path.read_text() == "mine"
    assert not path.is_symlink()


def test_files_are_created_where_nothing_is_and_opened_where_they_are_ours(tmp_path, other):
    for path in (other, tmp_path):
        with pytest.raises(FileExistsError):
            create_new(path)
    own = tmp_path / "own"
    os.close(create_new(own))
    own.write_text("one")
    with os.fdopen(open_own(own), "a") as file:
        file.write(" two")
    assert own.read_text() == "one two"
    with pytest.raises(NotOwnError):
        open_own(tmp_path.joinpath("/dev/null"))


def test_files_behind_a_folder_that_is_a_link_are_neither_written_nor_removed(tmp_path):
    run, outside = tmp_path / "run", tmp_path / "outside"
    (outside / "one").mkdir(parents=True)
    (run / "fits").mkdir(parents=True)
    files = [outside / "model.h5.partial", outside / "one/model.h5.partial"]
    for file in files:
        file.touch()
    (run / "away").symlink_to(outside)
    (run / "fits/away").symlink_to(outside)
    for inside in ("away/frf.h5", "fits/away/model.h5", "away/one/frf.h5"):
        with pytest.raises(ArtifactError):
            check_folders(run, [run / inside])
    remove_leftovers(run, ())
    assert all(file.exists() for file in files)
    (tmp_path / "link").symlink_to(run)
    check_folders(tmp_path / "link", [tmp_path / "link/fits/model.h5"])
