"""`robid reprocess` on a fleet with a softened robot and a broken log: who is named where, and what is made of it."""

import json
import shutil

import pytest

from fleet_floor import Floor
from page_words import said
from robid.errors import WorkerError
from two_mass_log import STIFFNESS

SPRING = "coupling.stiffness"
ROBOTS = {f"r{number}": 1 + 0.002 * (-1) ** number * (number % 5) / 4 for number in range(9)}
SOFT = {"soft": 0.7}


@pytest.fixture(scope="module")
def finished(tmp_path_factory, workshop):
    folder = tmp_path_factory.mktemp("floor")
    with pytest.MonkeyPatch.context() as monkeypatch:
        floor = Floor(workshop(folder, monkeypatch))
        floor.start(ROBOTS | SOFT)
        (folder / "answer.json").write_text(json.dumps(floor.json()))
    return folder


@pytest.fixture
def done(shop, finished):
    shutil.copytree(finished, shop.folder, dirs_exist_ok=True)
    return Floor(shop)


def pages(floor):
    return sorted(path.parent.name for path in floor.rows.glob("*/report.html"))


def test_the_softened_robot_is_named_everywhere(done):
    answer = json.loads((done.folder / "answer.json").read_text())
    assert [(each["id"], each["name"]) for each in answer["outliers"]] == [("soft", SPRING)]
    assert (answer["drifts"], answer["untold"]) == ([], [])
    told = json.loads((done.table.parent / "fleet.json").read_text())
    first = told["outliers"][0]
    assert (first["row"], first["fit"], first["name"]) == ("soft", "two_mass", SPRING)
    assert first["value"] == pytest.approx(0.7 * STIFFNESS, rel=0.02)
    assert first["centre"] == pytest.approx(STIFFNESS, rel=0.02)
    springs = {row["id"]: row for row in done.results() if row["parameter"] == SPRING}
    assert [name for name, row in springs.items() if row["outlier"]] == ["soft"]
    assert [name for name, row in springs.items() if row["outlier_row"]] == ["soft"]
    assert springs["soft"]["away"] == pytest.approx(first["away"])
    assert first["away"] < -5
    page = (done.table.parent / "report.html").read_text()
    assert "10 of 10 rows done; 1 off the fleet." in page
    assert '<a href="rows/soft/report.html">soft</a>' in page


def test_the_outlier_has_its_whole_page_and_the_others_on_request(done):
    assert pages(done) == ["soft"]
    page = (done.rows / "soft/report.html").read_text()
    assert "<title>benches, row soft" in page
    assert all(text in page for text in ("coupling", "Frequency response"))
    assert sorted(path.name for path in (done.rows / "soft").rglob("*") if path.is_file()) == [
        "model.h5",
        "report.html",
        "row.json",
    ]
    assert not list(done.rows.glob(".*"))
    (done.rows / "soft/report.html").unlink()
    done.write(["soft", "r1"])
    assert done.json("--pages", "none")["untold"] == ["all"]
    assert pages(done) == []
    done.json("--pages", "all")
    assert pages(done) == ["r1", "soft"]


def test_a_second_run_rewrites_nothing_and_says_the_same(done):
    before = {path: time for path, time in done.times().items() if path.is_file()}
    answer = done.robid()
    assert answer.code == 0, answer.err
    assert f"  off the fleet: soft ({SPRING})" in answer.out
    assert {path: time for path, time in done.times().items() if path.is_file()} == before
    assert done.robid("--strict").code == 5


def test_what_is_mended_is_off_no_more_and_what_breaks_gets_a_page(done):
    done.write_log("soft", 1.01)
    (done.folder / "floor/logs/r3.mat").write_bytes(b"MATLAB 5.0 MAT-file, cut")
    answer = done.json(code=5)
    assert (answer["made"], answer["outliers"]) == (2, [])
    assert [error["id"] for error in answer["failed"]] == ["r3"]
    assert pages(done) == ["r3"]
    page = (done.rows / "r3/report.html").read_text()
    assert answer["failed"][0]["message"].replace("`", "") in said(page)
    assert "logs/r3.mat" in page
    assert str(done.folder) not in page
    springs = {row["id"]: row for row in done.results() if row["status"] == "done" and row["parameter"] == SPRING}
    assert not any(row["outlier"] for row in springs.values())
    failures = json.loads((done.table.parent / "fleet.json").read_text())["failures"]
    assert [(group["count"], group["rows"]) for group in failures] == [(1, ["r3"])]


def test_a_robot_that_softened_between_two_logs_drifts(done):
    """The same rows as before, which stay as they are: only who was measured when is new."""
    names = [*ROBOTS, "soft"]
    text = ["id,log,step_s,hall,robot,time"]
    text += [
        f"{name},logs/{name}.mat,1e-3,north,arm{place // 2},2026-01-{1 + place % 2}1"
        for place, name in enumerate(names)
    ]
    (done.folder / "floor/robots.csv").write_text("\n".join(text))
    answer = done.json()
    assert (answer["made"], answer["untold"]) == (0, ["all"])
    assert [(each["robot"], each["name"]) for each in answer["drifts"]] == [("arm4", SPRING)]
    told = json.loads((done.table.parent / "fleet.json").read_text())
    assert told["time_unit"] == "day"
    [drift] = told["drifts"]
    assert (1 + drift["slope"]) ** 10 == pytest.approx(1 + drift["change"])
    assert drift["change"] == pytest.approx(0.7 / ROBOTS["r8"] - 1, abs=0.02)
    answer = done.robid("--strict")
    assert answer.code == 5
    assert f"  drifting: arm4 ({SPRING})" in answer.out
    assert "  outliers cannot be named: fewer than 8 robots" in answer.out


def test_a_page_that_cannot_be_made_is_told_and_stops_nothing(done, monkeypatch):
    (done.rows / "soft/report.html").unlink()

    def broken(*_):
        raise KeyError("estimate")

    monkeypatch.setattr("robid.fleet.report.run_all", broken)
    answer = done.robid()
    assert answer.code == 0
    assert "row soft has no page, by a defect of ours: KeyError" in answer.err
    assert not list(done.rows.glob(".*"))


def test_pages_that_end_their_worker_are_told_and_stop_nothing(done, monkeypatch):
    (done.rows / "soft/report.html").unlink()

    def broken(*_):
        raise WorkerError("A worker process ended before its task was done.")

    monkeypatch.setattr("robid.fleet.report.make_page", broken)
    answer = done.robid()
    assert answer.code == 0
    assert "not all pages of single rows were made: A worker process ended" in answer.err


def test_a_wrong_time_is_told_before_the_first_row(done):
    done.write(["r1", "r2"], head="id,log,step_s,time", line="{0},logs/{0}.mat,1e-3,in {0} days")
    text = "robots.csv:2: time: `in r1 days` is neither a date as 2026-01-31 nor a number"
    done.shop.refuse(2, text, command=("reprocess", "floor/robots.csv", "fleet.yaml"))


def test_a_file_of_somebody_else_in_the_place_of_the_summary_is_refused(done):
    (done.table.parent / "fleet.json").write_text("{}")
    done.shop.refuse(3, "A027", command=("reprocess", "floor/robots.csv", "fleet.yaml"))
