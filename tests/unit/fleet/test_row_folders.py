"""Folders of rows: old or new at any moment, and files known by content or by times that vouch for it."""

import os
from dataclasses import replace

import pytest

from robid.errors import ArtifactError
from robid.fleet import ledger as ledgers
from robid.fleet.folders import put_in_place, recover
from robid.fleet.ledger import FileKey, Ledger, RowError, file_key, logs_away, read_ledger, why_stale, write_ledger

LEDGER = Ledger(
    id="r1", settings_hash="s", settings={"name": "x"}, inputs={}, outputs={}, status="done", error=None,
    warnings=("a warning",), grades={"elastic": (1, "It predicts.")}, results=({"estimate": 1.0},), misfits={},
    kept=False, seconds=1.0, finished_utc="2024-01-31T00:00:00+00:00",
)  # fmt: skip


def make(folder, text):
    folder.mkdir()
    (folder / "model.h5").write_text(text)
    write_ledger(folder, replace(LEDGER, outputs={"model.h5": file_key(folder / "model.h5")}))
    return folder


def test_a_ledger_is_read_as_it_was_written_but_for_the_settings(tmp_path):
    failed = replace(LEDGER, status="failed", error=RowError("data", "a.csv", "is empty", "log again"))
    write_ledger(tmp_path, failed)
    found = read_ledger(tmp_path)
    assert found == replace(failed, settings={})
    assert read_ledger(tmp_path / "none") is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"formats": 3}', '{"formats": {"row": "1"}}'])
def test_a_damaged_ledger_counts_as_none(tmp_path, text):
    (tmp_path / "row.json").write_text(text)
    assert read_ledger(tmp_path) is None


def test_a_ledger_with_another_number_counts_as_none(tmp_path):
    write_ledger(tmp_path, LEDGER)
    text = (tmp_path / "row.json").read_text()
    assert '"estimate": 1.0' in text
    (tmp_path / "row.json").write_text(text.replace('"estimate": 1.0', '"estimate": 3.0'))
    assert read_ledger(tmp_path) is None


def test_a_folder_of_somebody_else_is_refused(tmp_path):
    with pytest.raises(ArtifactError, match="A026"):
        read_ledger(tmp_path)


@pytest.mark.parametrize("damaged", [False, True])
def test_a_new_folder_takes_the_place_and_foreign_files_come_along(tmp_path, damaged):
    put_in_place(make(tmp_path / ".r1.work", "old"), tmp_path / "r1")
    (tmp_path / "r1/notes").mkdir()
    (tmp_path / "r1/notes/mine.txt").write_text("mine")
    if damaged:
        (tmp_path / "r1/row.json").write_text("{")
    put_in_place(make(tmp_path / ".r1.work", "new"), tmp_path / "r1")
    assert (tmp_path / "r1/model.h5").read_text() == "new"
    assert (tmp_path / "r1/notes/mine.txt").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["r1"]


@pytest.mark.parametrize("step", ["before", "between", "after"])
def test_a_kill_at_any_moment_leaves_old_or_new(tmp_path, step):
    """The states that a kill can leave: before the first rename, between the two, before the old one is gone."""
    make(tmp_path / ("r1" if step == "before" else ".r1.old"), "old")
    make(tmp_path / ("r1" if step == "after" else ".r1.work"), "new")
    make(tmp_path / "r2", "other")
    recover(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r1", "r2"]
    assert (tmp_path / "r1/model.h5").read_text() == ("new" if step == "after" else "old")


def test_a_file_is_known_by_its_times_once_they_are_old_enough(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text("1")
    assert file_key(path).stat == (), "a change within the same tick would not show"
    monkeypatch.setattr(ledgers, "_SETTLED_NS", -1)
    key = file_key(path)
    assert key.stat
    monkeypatch.setattr(ledgers, "file_sha256", lambda _: pytest.fail("the times vouch for it"))
    assert key.holds(path)
    monkeypatch.undo()
    before = path.stat()
    path.write_text("2")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not key.holds(path), "size and time of writing can be set, that of the last change cannot"
    path.unlink()
    assert not key.holds(path)
    assert FileKey("").holds(path), "it was missing and still is"


def test_a_folder_is_known_by_what_is_in_it(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/a.db3").write_text("1")
    key = file_key(tmp_path / "bag")
    assert key.holds(tmp_path / "bag")
    (tmp_path / "bag/a.db3").write_text("2")
    assert not key.holds(tmp_path / "bag")


def test_a_row_says_why_it_is_stale(tmp_path):
    log, folder = tmp_path / "log.csv", tmp_path / "r1"
    log.write_text("1")
    make(folder, "model")
    made = replace(read_ledger(folder), inputs={"c: log": file_key(log), "robot": FileKey("other")})
    failed = replace(made, status="failed")

    def why(ledger=made, settings="s", logs=None, keep=False, force=False):
        return why_stale(ledger, settings, logs or {"c: log": log}, folder, keep=keep, force=force)

    assert why() == "", "of the robot file the settings' hash counts"
    assert why(None) == "not made yet"
    assert why(settings="t") == "settings changed"
    assert why(replace(made, formats={**made.formats, "model": "0.1"})) == "made by another version"
    assert why(logs={"c: log": log, "d: log": log}) == "d: log changed"
    assert why(keep=True) == "records and responses are to be kept"
    assert (why(failed), why(failed, force=True)) == ("", "failed, and is tried again")
    assert why(replace(failed, robid_version="0.0.1")) == "failed, and is tried again"
    assert why(force=True) == "", "what is done is not done again"
    log.write_text("2")
    assert why() == "c: log changed"
    log.unlink()
    assert why() == why(keep=True) == "", "made again it could only fail"
    assert logs_away(made, {"c: log": log}) == ("c: log",)
    assert (why(failed), logs_away(failed, {"c: log": log})) == ("c: log changed", ())
    log.write_text("1")
    assert logs_away(made, {"c: log": log}) == ()
    (folder / "model.h5").write_text("flipped")
    assert why() == "model.h5 changed"
