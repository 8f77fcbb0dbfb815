"""Whether an installation works: what is checked, and what becomes of a defect."""

import json
import os

import pytest

from answers import ask
from robid.commands import installation, trial
from robid.errors import SettingsError


def checks(answer):
    return {check["name"]: check for check in json.loads(answer.out)["checks"]}


@pytest.fixture
def quick(monkeypatch):
    """Leaves out what takes seconds."""
    monkeypatch.setattr(trial, "_backend", lambda backend, _: installation.Check(f"backend {backend}", "ok", ""))
    monkeypatch.setattr("robid.commands.doctor.identification", lambda: installation.Check("identification", "ok", ""))


def test_this_installation_works(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = ask("doctor", "--json")
    found = checks(answer)
    assert (answer.code, answer.json["ok"]) == (0, True), answer.out
    assert {"numpy", "examples", "backend serial", "backend processes", "identification"} <= set(found)
    assert {check["status"] for check in found.values()} <= {"ok", "absent"}
    assert answer.json["versions"]["numpy"] == found["numpy"]["text"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("quick")
def test_an_extra_that_is_missing_is_no_failure_and_names_what_brings_it(monkeypatch):
    monkeypatch.setattr(installation, "find_spec", lambda name: None if name == "pyuff" else object())
    answer = ask("doctor", "--json")
    found = checks(answer)["extra uff"]
    assert answer.code == 0
    assert found["status"] == "absent"
    assert "robid[uff]" in found["remedy"]


@pytest.mark.parametrize(("least", "code"), [("99.0", "S561"), ("1.0", "S560")])
def test_a_package_that_is_old_or_missing_stops_before_anything_is_computed(monkeypatch, least, code):
    name = "numpy" if code == "S561" else "no_such_package"
    monkeypatch.setattr(installation.metadata, "requires", lambda _: [f"{name}>={least}", "pyuff>=99; extra == 'uff'"])
    answer = ask("doctor", "--json")
    found = checks(answer)
    assert answer.code == 5
    assert found[name]["codes"] == [code]
    assert found[name]["remedy"]
    assert "identification" not in found


@pytest.mark.usefixtures("quick")
def test_examples_that_are_missing_are_a_failure(monkeypatch):
    def gone():
        raise SettingsError("S550 gone", remedy="install")

    monkeypatch.setattr(installation, "examples_folder", gone)
    answer = ask("doctor")
    assert answer.code == 5
    assert "S550" in answer.err
    assert "remedy: install" in answer.err


@pytest.mark.parametrize(
    ("found", "code"), [([(os.getpid(), 0.0)] * 2, "S563"), ([(0, 0.0)] * 2, "S564"), (RuntimeError("died"), "S562")]
)
def test_a_backend_that_does_something_else_is_a_failure(tmp_path, monkeypatch, found, code):
    from contextlib import contextmanager

    def answered(*_):
        if isinstance(found, Exception):
            raise found
        return found

    @contextmanager
    def broken(*_, **__):
        yield answered

    monkeypatch.setattr(trial, "make_map", broken)
    check = trial._backend("processes", tmp_path)
    assert check.status == "failed"
    assert check.text.startswith(code)


def test_a_drive_that_is_not_found_is_a_failure(monkeypatch):
    monkeypatch.setattr(trial, "_CLOSE", 1e-9)
    check = trial.identification()
    assert (check.status, check.text[:4]) == ("failed", "S565")


def test_the_identified_drive_is_a_small_one():
    assert "list_deg: [[0], [150]]" in trial._small()["doctor.yaml"]
