"""A batch whose rows take no time: what runs and why, and what a stop or a defect leaves of the table."""

import json
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest

from fabricated_fleets import sound
from robid.commands import reprocess
from robid.errors import BackendError, WorkerError
from robid.fleet import run as fleet_run
from robid.fleet.folders import begin
from robid.fleet.ledger import file_key, write_ledger
from robid.fleet.manifest import Manifest, robots_of
from robid.fleet.row import Told
from robid.fleet.rows import Fleet, PlannedRow
from robid.fleet.run import Options, run_fleet
from robid.pipeline.terminal import Shell, make_console
from robid.settings.placeholders import Row
from robid.settings.yaml import Document

IDS = [f"r{number}" for number in range(10)]
NOTHING = Options(pages="none")
LEDGERS = {name: replace(each, id=name) for name, each in zip(IDS, sound(len(IDS)), strict=True)}


class Bench:
    """A fleet in a folder, whose rows are done by writing their ledgers."""

    def __init__(self, folder):
        self.folder, self.rows, self.table = folder / "run", folder / "run/rows", folder / "run/results.parquet"
        self.logs = {name: folder / f"{name}.csv" for name in IDS}
        for log in self.logs.values():
            log.write_text("log")
        rows = tuple(Row(name, f"fleet.csv:{line}", folder, {}) for line, name in enumerate(IDS, start=2))
        manifest = Manifest(None, (), rows)
        planned = tuple(PlannedRow(row, "s", {"c: log": self.logs[row.id]}) for row in rows)
        experiment = SimpleNamespace(name="arms")
        template = Document(folder / "arm.yaml", {}, None)
        self.fleet = Fleet(template, "", manifest, planned, robots_of(manifest), experiment, ())
        self.opened, self.asked, self.stop = 0, [], None

    @contextmanager
    def open_map(self, *, one):
        self.opened += 1

        def mapped(_, tasks, on_done=None):
            results = []
            for index, task in enumerate(tasks):
                if self.stop is not None:
                    self.stop(task)
                self.asked.append((task.row.id, one))
                results.append(self.make(task.row.id))
                if on_done is not None:
                    on_done(index, results[-1])
            return results

        yield mapped

    def make(self, name):
        folder = self.rows / name
        (folder / "fits").mkdir(parents=True, exist_ok=True)
        (folder / "fits/model.h5").write_text(name)
        made = replace(
            LEDGERS[name],
            inputs={"c: log": file_key(self.logs[name])},
            outputs={"fits/model.h5": file_key(folder / "fits/model.h5")},
        )
        write_ledger(folder, made)
        return made.outline

    def run(self, options=NOTHING, **told):
        self.opened, self.asked = 0, []
        return run_fleet(self.fleet, self.folder, options, self.open_map, Told(), lambda *_: None, **told)

    def look(self, **changed):
        return fleet_run.look(self.fleet, self.rows, **{"keep": False, "force": False, **changed})

    def statuses(self):
        return {row["id"]: row["status"] for row in pq.read_table(self.table).to_pylist()}

    def is_compared(self):
        return pq.read_table(self.table).column("outlier_row").null_count == 0


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


@pytest.fixture
def done(bench):
    bench.run()
    return bench


def test_rows_whose_logs_are_away_stay_and_are_told(done):
    before = {path: path.read_bytes() for path in done.rows.rglob("*") if path.is_file()}
    done.logs["r2"].unlink()
    done.logs["r5"].unlink()
    done.logs["r7"].write_text("another")
    batch = done.run()
    assert done.asked == [("r7", False)]
    assert batch.away == {"r2": ("c: log",), "r5": ("c: log",)}
    assert not batch.failed
    assert all(path.read_bytes() == text for path, text in before.items() if "r7" not in str(path))
    assert reprocess.batch_answer(batch).logs_away == {"r2": ("c: log",), "r5": ("c: log",)}
    assert done.look(keep=True).away == batch.away, "nothing can be kept of a log that is not there"


def test_a_row_whose_log_is_away_runs_where_its_result_does_not_hold(done):
    for log in done.logs.values():
        log.unlink()
    (done.rows / "r3/fits/model.h5").write_text("flipped")
    write_ledger(done.rows / "r4", replace(LEDGERS["r4"], settings_hash="t"))
    assert done.look().reasons == {"fits/model.h5 changed": ["r3"], "settings changed": ["r4"]}
    assert len(done.look().away) == len(IDS) - 2


def test_with_nothing_to_do_no_map_is_opened_and_the_table_stays(done):
    before = done.table.read_bytes()
    assert (done.run().made, done.opened) == (0, 0)
    assert done.table.read_bytes() == before
    assert done.is_compared()


def test_a_stop_before_the_first_row_leaves_a_complete_table_as_it_was(done):
    before = done.table.read_bytes()
    done.logs["r2"].write_text("another")

    def lost(_):
        raise BackendError("The scheduler does not answer.")

    done.stop = lost
    with pytest.raises(BackendError):
        done.run()
    assert done.table.read_bytes() == before


def test_a_stop_later_tables_what_is_finished(done):
    for name in ("r2", "r3"):
        done.logs[name].write_text("another")

    def interrupted(task):
        if task.row.id == "r3":
            raise KeyboardInterrupt

    done.stop = interrupted
    with pytest.raises(KeyboardInterrupt):
        done.run()
    assert done.statuses() == {name: "pending" if name == "r3" else "done" for name in IDS}


def test_a_defect_of_the_comparison_leaves_a_table_without_it_and_is_raised(bench, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(fleet_run, "compare", broken)
    with pytest.raises(ZeroDivisionError):
        bench.run()
    assert set(bench.statuses().values()) == {"done"}
    assert not bench.is_compared()
    monkeypatch.undo()
    assert bench.run().made == 0
    assert bench.is_compared()


def test_rows_at_work_when_a_worker_died_run_alone_and_leave_nothing_aside(bench):
    died = []

    def dies(task):
        if task.row.id in ("r1", "r2") and not died:
            begin(task.anew().work)
        if task.row.id == "r2" and not died:
            died.append(task.row.id)
            raise WorkerError("A worker process ended before its task was done.")

    bench.stop = dies
    bench.run()
    assert [name for name, one in bench.asked if one] == ["r2"], "r1 was done"
    assert sorted(path.name for path in bench.rows.iterdir()) == IDS


def test_what_is_to_be_made_is_told_with_its_reasons_before_it_runs(done, capsys):
    for name in ("r2", "r3"):
        done.logs[name].write_text("another")
    done.logs["r4"].unlink()
    (done.rows / "r5/row.json").write_text("{")
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    done.run(announce=lambda found: reprocess._announce(shell, "arms", found))
    told = capsys.readouterr()
    assert told.out == ""
    assert "arms  3 rows to make: c: log changed 2, not made yet 1\n" in told.err
    assert "warning: 1 row stays as it is, because its log is not there or may not be read: r4; " in told.err


@pytest.fixture
def dry(done, monkeypatch):
    """Runs the command without doing anything."""
    execution = SimpleNamespace(log_level="info", backend="serial")
    fleet = replace(done.fleet, experiment=SimpleNamespace(name="arms", execution=execution))
    monkeypatch.setattr(reprocess, "load_fleet", lambda *_: fleet)

    def run(**changed):
        asked = {"strict": False, "as_json": False, "stream": False, "dry_run": True, **changed}
        return reprocess.reprocess(Path("m"), Path("e"), done.folder, NOTHING, None, None, None, **asked)

    return run


@pytest.mark.parametrize("as_json", [False, True])
def test_a_dry_run_says_what_would_run_and_why_and_writes_nothing(done, dry, capsys, as_json):
    for name in ("r2", "r3", "r6", "r7"):
        done.logs[name].write_text("another")
    done.logs["r4"].unlink()
    write_ledger(done.rows / "r5", replace(LEDGERS["r5"], settings_hash="t"))
    before = {path: path.stat().st_mtime_ns for path in done.folder.rglob("*")}
    assert dry(as_json=as_json) == 0
    told = capsys.readouterr()
    if as_json:
        assert json.loads(told.out) == {
            "type": "reprocess-dry-run",
            "json_version": "1.0",
            "fresh": 5,
            "logs_away": {"r4": ["c: log"]},
            "due": {"c: log changed": ["r2", "r3", "r6", "r7"], "settings changed": ["r5"]},
        }
    else:
        assert told.out.splitlines() == [
            "10 rows: 5 to make, 5 fresh",
            "  c: log changed, 4 rows: r2, r3, r6 and 1 more",
            "  settings changed, 1 row: r5",
        ]
        assert "r4; bring the logs back" in told.err
    assert {path: path.stat().st_mtime_ns for path in done.folder.rglob("*")} == before
    assert done.asked == [(name, False) for name in IDS], "of the run before alone"


def test_workers_must_see_the_folders_that_rows_read_from(bench, tmp_path, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "data"))
    assert list(reprocess._folders(bench.fleet)) == [tmp_path, tmp_path]
    (tmp_path / "data").mkdir()
    assert list(reprocess._folders(bench.fleet)) == [tmp_path, tmp_path], "no row reads from it"
    log = PlannedRow(bench.fleet.rows[0].row, "s", {"c: log": tmp_path / "data/a.csv"})
    for changed in ({"rows": (log,)}, {"text": "file: ${ROBID_DATA}/a.csv"}):
        assert list(reprocess._folders(replace(bench.fleet, **changed)))[-1] == tmp_path / "data"
