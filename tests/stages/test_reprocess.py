"""`robid reprocess`: rows of a manifest, each from a log of its own; what is finished stays, what is wrong is told."""

import json
import os
import shutil
import signal
import sys
from contextlib import contextmanager

import pytest
from scipy.io import savemat

from fleet_floor import COMMAND, FACTORS, MANIFEST, Floor
from page_words import said
from robid.artifacts.atomic import locked
from robid.artifacts.store import read_header
from robid.errors import WorkerError
from robid.fleet import run as fleet_run
from robid.fleet.folders import begin
from two_mass_log import STIFFNESS, bench_log


@pytest.fixture(scope="module")
def finished(tmp_path_factory, workshop):
    folder = tmp_path_factory.mktemp("floor")
    with pytest.MonkeyPatch.context() as monkeypatch:
        floor = Floor(workshop(folder, monkeypatch))
        floor.start()
        floor.json()
    return folder


@pytest.fixture
def done(shop, finished):
    shutil.copytree(finished, shop.folder, dirs_exist_ok=True)
    return Floor(shop)


@pytest.fixture
def floor(shop):
    found = Floor(shop)
    found.start()
    return found


def test_the_table_has_the_parameters_of_every_robot(done):
    rows = done.results()
    springs = {row["id"]: row for row in rows if row["parameter"] == "coupling.stiffness"}
    assert list(springs) == list(FACTORS)
    for name, row in springs.items():
        assert row["estimate"] == pytest.approx(FACTORS[name] * STIFFNESS, rel=0.01)
        assert row["physical_low"] < row["physical"] < row["physical_high"]
        assert (row["nominal"], row["unit"], row["kind"], row["joint"]) == (400, "N m/rad", "stiffness", "drive")
        assert (row["row.hall"], row["row.step_s"], row["row.log"]) == ("north", 1e-3, f"logs/{name}.mat")
        assert (row["status"], row["error"], row["fit"], row["identifiable"]) == ("done", None, "two_mass", True)
        assert row["model_sha256"] == read_header(done.rows / name / "fits/two_mass/model.h5").content_sha256
        assert row["settings_sha256"] == done.ledger(name)["settings_hash"]
    assert {row["parameter"] for row in rows} >= {"delay", "drive.motor_inertia", "coupling.damping"}


def test_a_row_leaves_its_model_and_a_ledger_without_paths_of_this_machine(done, finished):
    assert sorted(path.name for path in (done.rows / "soft").rglob("*") if path.is_file()) == ["model.h5", "row.json"]
    ledger = done.ledger("soft")
    assert ledger["settings"]["campaigns"]["log"]["source"]["acquire"]["file"] == "logs/soft.mat"
    assert set(ledger["inputs"]) == {"robot", "log: log"}
    assert str(finished) not in (done.rows / "soft" / "row.json").read_text()
    header = read_header(done.rows / "soft/fits/two_mass/model.h5")
    assert str(finished) not in repr(header.provenance)


def test_a_second_run_does_and_rewrites_nothing(done):
    before = done.times()
    answer = done.json()
    assert (answer["made"], answer["fresh"], answer["outcome"]) == (0, 3, "fresh")
    assert {path: time for path, time in done.times().items() if path.is_file()} == {
        path: time for path, time in before.items() if path.is_file()
    }


def test_only_what_changed_runs_again(done):
    done.write_log("mean", 1.2)
    done.write_log("new", 0.8)
    done.write(["new", "soft", "mean"], head="id,log,step_s,tester", line="{0},logs/{0}.mat,1e-3,B")
    untouched = done.ledger("soft")
    lines = [json.loads(line) for line in done.robid("--json", "--stream").out.splitlines()]
    assert [(line["id"], line["outcome"]) for line in lines[:-1]] == [
        ("soft", "fresh"),
        ("new", "made"),
        ("mean", "made"),
    ]
    assert (lines[-1]["made"], lines[-1]["removed"]) == (2, ["hard"])
    assert done.ledger("soft") == untouched
    springs = {row["id"]: row for row in done.results() if row["parameter"] == "coupling.stiffness"}
    assert list(springs) == ["new", "soft", "mean"]
    assert springs["mean"]["estimate"] == pytest.approx(1.2 * STIFFNESS, rel=0.01)
    assert springs["soft"]["row.tester"] == "B"
    assert (done.rows / "hard/fits/two_mass/model.h5").exists()


def test_settings_outputs_and_a_ledger_that_changed_are_noticed(done):
    (done.rows / "soft/fits/two_mass/model.h5").unlink()
    (done.rows / "mean/row.json").write_text("{")
    assert done.json()["made"] == 2
    (done.rows / "soft/notes.txt").write_text("kept by hand")
    done.shop.change("starts: 1", "starts: 2", "fleet.yaml")
    done.shop.change("execution: {backend: serial}", "execution: {backend: serial, log_level: warning}", "fleet.yaml")
    assert done.json()["made"] == 3
    assert (done.rows / "soft/notes.txt").read_text() == "kept by hand"


def test_a_table_with_a_flipped_bit_is_written_again(done):
    whole, before = done.table.read_bytes(), done.results()
    at = whole.index(b"coupling.stiffness")
    done.table.write_bytes(whole[:at] + b"C" + whole[at + 1 :])
    assert done.results() != before
    assert done.json()["made"] == 0
    assert done.results() == before


def test_a_bad_log_fails_its_row_alone(done):
    good = (done.folder / "floor/logs/soft.mat").read_bytes()
    (done.folder / "floor/logs/soft.mat").write_bytes(good[: len(good) // 2])
    (done.folder / "floor/logs/hard.mat").write_text("")
    told = done.robid("--json")
    assert told.code == 5
    assert "floor/robots.csv:2: row soft failed: " in told.err
    answer = told.json
    assert {error["id"]: error["kind"] for error in answer["failed"]} == {"soft": "data", "hard": "data"}
    assert (answer["made"], answer["fresh"]) == (2, 1)
    failed = {row["id"]: row for row in done.results() if row["status"] == "failed"}
    assert list(failed) == ["soft", "hard"]
    assert "logs/soft.mat" in failed["soft"]["error"]
    assert failed["hard"]["remedy"]
    assert str(done.folder) not in json.dumps([done.ledger("soft"), done.ledger("hard")])
    assert len([row for row in done.results() if row["id"] == "mean"]) > 3
    page = said((done.table.parent / "report.html").read_text())
    assert "1 of 3 rows done; 2 failed." in page
    assert all(
        text in page
        for text in ("Failures by cause", *(error["message"].replace("`", "") for error in answer["failed"]))
    )
    answer = done.robid()
    assert (answer.code, "0 made, 3 fresh; 2 failed" in answer.out) == (5, True)
    assert "--force" in answer.out
    assert done.json("--force", code=5)["made"] == 2
    (done.folder / "floor/logs/soft.mat").write_bytes(good)
    done.write_log("hard")
    assert done.json()["made"] == 2


def test_logs_that_are_away_cost_no_model_and_are_told(done):
    before = {path: path.read_bytes() for path in done.rows.rglob("*") if path.is_file()}
    (done.folder / "floor/logs").rename(done.folder / "elsewhere")
    plan = done.json("--dry-run")
    assert (plan["fresh"], plan["due"], list(plan["logs_away"])) == (3, {}, list(FACTORS))
    answer = done.robid("--json", "--force", "--keep")
    assert (answer.code, answer.json["made"], list(answer.json["logs_away"])) == (0, 0, list(FACTORS))
    assert "3 rows stay as they are" in answer.err
    assert {path: path.read_bytes() for path in done.rows.rglob("*") if path.is_file()} == before


def test_an_interrupt_keeps_what_is_finished_and_tables_the_rest_as_pending(floor, monkeypatch):
    run_row, asked = fleet_run.run_row, []

    def interrupted(task):
        asked.append(task.row.id)
        if len(asked) == 2:
            begin(task.anew().work)
            raise KeyboardInterrupt
        return run_row(task)

    monkeypatch.setattr(fleet_run, "run_row", interrupted)
    answer = floor.robid()
    assert answer.code == 130
    assert {row["id"]: row["status"] for row in floor.results()} == {
        "soft": "done",
        "mean": "pending",
        "hard": "pending",
    }
    monkeypatch.setattr(fleet_run, "run_row", run_row)
    assert floor.json()["made"] == 2
    assert {path.name for path in floor.rows.iterdir()} == set(FACTORS)


@pytest.mark.parametrize("backend", ["processes", pytest.param("dask", marks=pytest.mark.slow)])
def test_other_backends_give_what_serial_gives_and_keep_what_they_are_told(done, finished, backend):
    shutil.rmtree(done.rows)
    answer = done.shop.robid("reprocess", MANIFEST, "fleet.yaml", "--workers", "2", "--backend", backend, "--keep")
    assert answer.code == 0, answer.err
    for name in FACTORS:
        assert (done.rows / name / "log/record.h5").exists()
        model = "fits/two_mass/model.h5"
        before = read_header(finished / "runs/benches/rows" / name / model)
        assert read_header(done.rows / name / model).content_sha256 == before.content_sha256
    assert done.json()["made"] == 0


def test_a_sign_that_is_wrong_is_graded_and_fails_only_when_asked(floor):
    log = bench_log()
    log["load"] = -log["load"]
    savemat(floor.folder / "floor/logs/soft.mat", log)
    floor.write(["soft"])
    answer = floor.json()
    assert answer["do_not_use"] == ["soft"]
    assert floor.json("--strict", code=5)["made"] == 0
    assert {row["grade_word"] for row in floor.results()} == {"do not use"}


HEAD = "id,log,step_s,hall"


@pytest.mark.parametrize(
    ("manifest", "texts"),
    [
        ("id,step_s,hall\nsoft,1e-3,n", ["fleet.yaml:12", "file: the manifest has no column `log`", "known here: "]),
        (f"{HEAD}\nsoft,logs/soft.mat,1e-3,n\nsoft,logs/mean.mat,1e-3,n", ["robots.csv:3: id: `soft` is there twice"]),
        (f"{HEAD}\na,logs/soft.mat,1e-3,n\nA,logs/mean.mat,1e-3,n", ["`A` and `a` are the same"]),
        (f"{HEAD}\na,logs/soft.mat,1e-3,n\nb,logs/soft.mat,1e-3,n", ["robots.csv:3: row b says the same as row a"]),
        (f"{HEAD}\n../a,logs/soft.mat,1e-3,n", ["`../a` is no name of a folder"]),
        (
            f"{HEAD}\na,../bench.mat,1e-3,n",
            ["row a, column `log`", "`../bench.mat` lies outside the manifest's folder"],
        ),
        (f"{HEAD}\na,/etc/bench.mat,1e-3,n", ["`/etc/bench.mat` lies outside"]),
        (f"{HEAD}\na,logs/link/soft.mat,1e-3,n", ["logs/link/soft.mat` lies outside", "through a link"]),
        (f"{HEAD}\na,,1e-3,n", ["file: `log` is empty in this row"]),
        (f"{HEAD}\na,logs/soft.mat,fast,n", ["robots.csv:2: row a, column `step_s`", "fleet.yaml:14", "found 'fast'"]),
        (f"{HEAD}\na,logs/soft.mat,1e-3,n\nb,logs/x.mat,-1,n", ["robots.csv:3: row b, column `step_s`", "(found -1)"]),
        (f"{HEAD}\na,logs/soft.mat,1e-3", ["robots.csv:2: has 3 values", "there are 4 columns"]),
        (f'{HEAD}\na,"logs/soft.mat,1e-3,n', ["S041"]),
        ("", ["robots.csv: S042"]),
        (HEAD, ["S036"]),
        ("id,log,log,step_s\n1,2,3,4", ["column `log` is there twice"]),
    ],
)
def test_a_bad_manifest_is_told_before_the_first_row(floor, manifest, texts):
    (floor.folder / "elsewhere").mkdir()
    (floor.folder / "floor/logs/link").symlink_to(floor.folder / "elsewhere")
    (floor.folder / MANIFEST).write_text(manifest)
    floor.shop.refuse(2, *texts, command=COMMAND)
    assert not (floor.folder / "runs").exists()


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("file: ${row.log}", "file: ${rows.log}", "nothing fills `${rows.log}`"),
        ("file: ${row.log}", "file: ${log}", "nothing fills `${log}`"),
        ("name: benches", "name: ${row.hall}", "is the name of the run folder of all rows"),
        ("fits:", "nofits:", "all rows: "),
    ],
)
def test_a_file_that_no_manifest_completes_is_told_before_the_first_row(floor, old, new, text):
    floor.shop.change(old, new, "fleet.yaml")
    floor.shop.refuse(2, text, command=COMMAND)


@pytest.mark.parametrize("command", ["run", "status", "fit", "study"])
def test_other_commands_name_the_one_that_fills_placeholders(floor, command):
    texts = ("fleet.yaml:12: S329 campaigns.log.source.acquire.file: `${row.log}` (and 1 more)", "robid reprocess")
    floor.shop.refuse(2, *texts, command=(command, "fleet.yaml"))


def test_the_lock_names_the_process_that_holds_it(floor):
    with locked(floor.folder / "runs/benches/.lock", "robid reprocess a.csv b.yaml"):
        floor.shop.refuse(3, "A005", "robid reprocess a.csv b.yaml", command=COMMAND)


def test_files_of_somebody_else_are_not_replaced(floor):
    floor.table.parent.mkdir(parents=True)
    floor.table.write_text("mine")
    floor.shop.refuse(3, "A028", command=COMMAND)
    floor.table.unlink()
    (floor.table.parent / "report.html").write_text("<html>mine</html>")
    floor.shop.refuse(3, "no report of robid", command=COMMAND)
    (floor.table.parent / "report.html").unlink()
    (floor.rows / "soft").mkdir(parents=True)
    floor.shop.refuse(3, "A026", command=COMMAND)


def test_without_the_extra_one_message_says_what_to_install(floor, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr("robid.errors.find_spec", lambda _: None)
    floor.shop.refuse(2, "needs the package pyarrow", "robid[fleet]", command=COMMAND)


def test_a_full_disk_stops_the_batch_and_fails_no_row(floor, monkeypatch):
    """It is full once the first row begins."""
    free = [1e12]
    usage = shutil.disk_usage(floor.folder)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=free.pop() if free else 1e3))
    answer = floor.robid()
    assert answer.code == 3
    assert "A036 The disk has 0 MB left" in answer.err
    assert list(floor.rows.iterdir()) == []
    assert {row["status"] for row in floor.results()} == {"pending"}


def test_a_row_that_kills_its_worker_fails_alone(floor, monkeypatch):
    """The map of a backend raises when a worker dies, whichever row it was at."""
    opened = []

    @contextmanager
    def make_map(_, workers, **__):
        opened.append(workers)

        def run(function, tasks, on_done=None):
            results = []
            for index, task in enumerate(tasks):
                if task.row.id == "mean":
                    begin(task.anew().work)
                    raise WorkerError("A worker process ended before its task was done.")
                results.append(function(task))
                if on_done is not None:
                    on_done(index, results[-1])
            return results

        yield run

    monkeypatch.setattr("robid.commands.reprocess.make_map", make_map)
    answer = floor.json("--workers", "3", code=5)
    assert [error["id"] for error in answer["failed"]] == ["mean"]
    assert "its worker process ended" in answer["failed"][0]["message"]
    assert {row["id"]: row["status"] for row in floor.results()} == {"soft": "done", "mean": "failed", "hard": "done"}
    assert opened == [3, 1, 3, 3]  # the last for pages
    assert floor.json(code=5)["made"] == 0


def test_an_interrupt_that_comes_out_as_another_error_fails_no_row(floor, monkeypatch):
    def swallowed(*_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            message = "incompatible function arguments"
            raise TypeError(message) from None

    with monkeypatch.context() as broken:
        broken.setattr("robid.fleet.row.results_of", swallowed)
        floor.json(code=130)
    assert not list(floor.rows.glob("*/row.json"))
    assert floor.json()["made"] == 3


def test_a_fit_that_has_not_converged_and_a_defect_fail_their_rows(floor, monkeypatch):
    floor.shop.change("starts: 1", 'starts: 1, max_iterations: "${row.limit}"', "fleet.yaml")
    (floor.folder / MANIFEST).write_text("id;log;step_s;limit\nsoft;logs/soft.mat;1e-3;1\nhard;logs/hard.mat;1e-3;99\n")

    def broken(*_):
        raise KeyError("estimate")

    monkeypatch.setattr("robid.fleet.row.results_of", broken)
    failed = {error["id"]: error for error in floor.json(code=5)["failed"]}
    assert failed["soft"]["kind"] == "fit"
    assert "has not converged (iteration_limit)" in failed["soft"]["message"]
    assert (floor.rows / "soft/fits/two_mass/model.h5").exists()
    assert failed["hard"]["kind"] == "defect"
    assert "a defect of ours: KeyError" in failed["hard"]["message"]
