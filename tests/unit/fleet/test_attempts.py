"""Two attempts at one row, interleaved by hand as workers and commands can: one whole row, and nothing half made."""

from pathlib import Path

import pytest

from fabricated_fleets import ledger
from robid.errors import ArtifactError, SettingsError
from robid.fleet import folders, row
from robid.fleet.folders import at_work, begin, put_in_place, recover
from robid.fleet.ledger import file_key, read_ledger, write_ledger
from robid.fleet.row import RowError, RowTask, Told, fail_row, run_row
from robid.settings.placeholders import Row

MODEL = "fits/elastic/model.h5"


def task_of(folder, name="r1.b", **changed):
    (folder / "rows").mkdir(exist_ok=True)
    made = Row(name, "fleet.csv:2", folder, {})
    return RowTask(made, folder / "arm.yaml", "", folder / "rows", **{"keep": False, **changed})


def begun(task, text):
    """An attempt that has got as far as its model."""
    task = task.anew()
    begin(task.work)
    write_model(task, text)
    return task


def write_model(task, text):
    (task.work / MODEL).parent.mkdir(parents=True, exist_ok=True)
    (task.work / MODEL).write_text(text)


def finish(task, error=None):
    return row._finish(task, None, {}, row._Found(), Told(), error, 0.0)


def names(task):
    return sorted(path.name for path in task.rows.iterdir())


def assert_whole(task, text):
    made = read_ledger(task.folder)
    assert (made.status, list(made.outputs)) == ("done", [MODEL])
    assert (task.folder / MODEL).read_text() == text
    assert made.outputs[MODEL].holds(task.folder / MODEL)
    assert names(task) == [task.row.id]


@pytest.mark.parametrize("goes_on", ["nowhere", "writes again"])
def test_an_orphan_leaves_the_row_to_the_command_that_took_it_over(tmp_path, goes_on):
    task = task_of(tmp_path)
    orphan = begun(task, "the orphan's")
    recover(task.rows)
    new = begun(task, "half of the n")
    if goes_on == "writes again":
        write_model(orphan, "the orphan's")
    with pytest.raises(ArtifactError, match="A025"):
        finish(orphan)
    assert not task.folder.exists()
    assert names(task) == [new.work.name]
    write_model(new, "the new one")
    finish(new)
    assert_whole(task, "the new one")


def test_an_orphan_that_ends_late_leaves_a_finished_row_alone(tmp_path):
    task = task_of(tmp_path)
    orphan = begun(task, "the orphan's")
    recover(task.rows)
    finish(begun(task, "the new one"))
    with pytest.raises(ArtifactError, match="A025"):
        finish(orphan, RowError("data", "a.csv", "does not exist", ""))
    assert_whole(task, "the new one")


def test_an_attempt_that_loses_an_output_is_not_put_in_place(tmp_path, monkeypatch):
    task = begun(task_of(tmp_path), "model")

    def written(folder, made):
        write_ledger(folder, made)
        (folder / MODEL).unlink()

    monkeypatch.setattr(row, "write_ledger", written)
    with pytest.raises(ArtifactError, match="A025"):
        finish(task)
    assert not task.folder.exists()


def test_two_attempts_that_both_finish_leave_one_whole_row(tmp_path):
    task = task_of(tmp_path)
    first, second = begun(task, "first"), begun(task, "second")
    assert at_work(task.rows) == {"r1.b"}
    finish(second)
    assert (task.folder / MODEL).read_text() == "second"
    finish(first)
    assert_whole(task, "first")


@pytest.mark.parametrize("there", [False, True])
def test_two_that_put_in_place_at_once_leave_one_whole_row(tmp_path, monkeypatch, there):
    """The other one comes between, just before ours moves its folder."""
    task = task_of(tmp_path)
    if there:
        finish(begun(task, "old"))
        (task.folder / "mine.txt").write_text("mine")
    ours, other = begun(task, "ours"), begun(task, "the other's")
    rename, waits = Path.replace, [other]

    def replace(path, to):
        if path == ours.work and waits:
            finish(waits.pop())
        return rename(path, to)

    monkeypatch.setattr(Path, "replace", replace)
    finish(ours)
    assert not waits
    assert_whole(task, "ours")
    assert (task.folder / "mine.txt").exists() == there


def test_a_row_that_cannot_be_put_in_place_stays_as_it_was(tmp_path, monkeypatch):
    task = task_of(tmp_path)
    finish(begun(task, "old"))
    ours, rename = begun(task, "ours"), Path.replace

    def replace(path, to):
        if path == ours.work:
            raise PermissionError(13, "no")
        return rename(path, to)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(ArtifactError, match="cannot be written"):
        finish(ours)
    assert (task.folder / MODEL).read_text() == "old"


@pytest.mark.parametrize("name", [".r1.b~{token}", ".r1.b"])
def test_folders_aside_are_found_again_also_those_of_an_earlier_version(tmp_path, name):
    name = name.format(token=folders.new_attempt())
    for kind in ("old", "work", "page"):
        (tmp_path / f"{name}.{kind}").mkdir()
        (tmp_path / f"{name}.{kind}/model.h5").write_text(kind)
    assert at_work(tmp_path) == {"r1.b"}
    recover(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["r1.b"]
    assert (tmp_path / "r1.b/model.h5").read_text() == "old"


def test_every_run_of_a_row_is_an_attempt_of_its_own_and_leaves_nothing_aside(tmp_path, monkeypatch):
    task, works = task_of(tmp_path, keep=True), []

    def load(each):
        works.append(each.work)
        assert each.work.is_dir()
        raise SettingsError("no", where=str(each.work / "x"))

    monkeypatch.setattr(row, "load_task", load)
    assert run_row(task).error.where == "r1.b/x", "a message says nothing of the attempt"
    run_row(task)
    assert len(set(works)) == 2
    assert names(task) == ["r1.b"]
    assert [path.name for path in task.folder.iterdir()] == ["row.json"], "the mark of an attempt goes, with --keep too"


def test_a_row_that_killed_its_worker_fails_in_an_attempt_of_its_own(tmp_path, monkeypatch):
    task = task_of(tmp_path)
    dead = begun(task, "half")
    monkeypatch.setattr(row, "load_task", lambda _: None)
    monkeypatch.setattr(row, "_inputs", lambda _: {})
    assert fail_row(task).error.kind == "memory"
    assert (dead.work / MODEL).exists(), "whoever may still be there is not written to"
    assert read_ledger(task.folder).outputs == {}


def test_messages_name_neither_the_folder_of_the_experiment_file_nor_where_it_leads(tmp_path, monkeypatch):
    for name in ("real", "floor", "data"):
        (tmp_path / name).mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "data"))
    task = RowTask(Row("r1", "", tmp_path / "floor", {}), tmp_path / "link/arm.yaml", "", tmp_path / "real/rows", False)
    told = {
        tmp_path / "link/robots/a.yaml": "robots/a.yaml",
        tmp_path / "real/robots/a.yaml": "robots/a.yaml",
        tmp_path / "link/arm.yaml": "arm.yaml",
        tmp_path / "real/arm.yaml": "arm.yaml",
        tmp_path / "floor/logs/a.csv": "logs/a.csv",
        tmp_path / "data/a.csv": "${ROBID_DATA}/a.csv",
        task.work / "record.h5": "r1/record.h5",
    }
    for path, short in told.items():
        assert row._shortened(f"see {path}.", task) == f"see {short}."


def test_links_and_empty_folders_that_a_user_put_there_stay(tmp_path):
    task = task_of(tmp_path)
    finish(begun(task, "old"))
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/a.jpg").write_text("a")
    (task.folder / "photos").symlink_to(tmp_path / "photos")
    (task.folder / "fits/later").symlink_to("nowhere")
    (task.folder / "notes/empty").mkdir(parents=True)
    finish(begun(task, "new"))
    assert (task.folder / "photos").is_symlink()
    assert (task.folder / "photos/a.jpg").read_text() == "a"
    assert (task.folder / "fits/later").readlink() == Path("nowhere")
    assert list((task.folder / "notes").iterdir()) == [task.folder / "notes/empty"]
    assert_whole(task, "new")


def test_what_an_earlier_run_made_is_not_carried_over(tmp_path):
    task = task_of(tmp_path)
    task.folder.mkdir()
    (task.folder / "truth.json").write_text("{}")
    write_ledger(task.folder, ledger("r1.b", outputs={"truth.json": file_key(task.folder / "truth.json")}))
    made = begun(task, "new").work
    put_in_place(made, task.folder)
    assert sorted(path.name for path in task.folder.rglob("*")) == ["elastic", "fits", "model.h5"]
