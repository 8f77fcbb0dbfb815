"""Every command is run with `--json`, and prints what its schema says; `ask` holds each answer against it."""

import json
import shutil
from pathlib import Path

import pytest
import typer
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError
from scipy.io import savemat

from fleet_floor import COMMAND, Floor
from json_answers import check_answer, closed
from robid.cli import app, run_command
from robid.commands import installation, trial
from robid.commands.answers import ANSWERS, schema_of
from two_mass_log import STIFFNESS, bench_log

_HERE = Path(__file__).parent
_SMALL = {
    "design-excitation": ("--campaign", "estimation"),
    "simulate-or-acquire": ("--campaign", "estimation"),
    "estimate-frf": ("--campaign", "estimation"),
    "design-configs": ("--design", "best"),
    "fit": (),
    "validate": (),
    "report": (),
}
CASES = {
    **{(name, "stage"): (name, "small.yaml", *options) for name, options in _SMALL.items()},
    ("fit", "fit-try"): ("fit", "small.yaml", "--try", "masses"),
    ("design-configs", "design-next"): ("design-configs", "small.yaml", "--next", "elastic"),
    ("run", "run"): ("run", "small.yaml"),
    ("run", "run-dry-run"): ("run", "small.yaml", "--dry-run"),
    ("study", "study"): ("study", "study.yaml"),
    ("export", "export"): ("export", "small.yaml", "--format", "json"),
    ("compare", "compare"): ("compare", "small.yaml:estimation", "runs/small/estimation/frf.h5"),
    ("compare", "compare-runs"): ("compare", "runs/small", "runs/small"),
    ("status", "status"): ("status", "small.yaml"),
    ("upgrade", "upgrade"): ("upgrade", "small.yaml"),
    ("inspect", "inspect-artifact"): ("inspect", "runs/small/estimation/record.h5"),
    ("inspect", "inspect-log"): ("inspect", "log.mat"),
    ("inspect", "inspect-response"): ("inspect", "frf.csv"),
    ("init", "init"): ("init", "new", "--example", "drive"),
    ("doctor", "doctor"): ("doctor",),
    ("explain", "explain"): ("explain", "S007", "D001"),
    ("explain", "explain-letters"): ("explain",),
    ("reprocess", "reprocess"): COMMAND,
    ("reprocess", "reprocess-dry-run"): (*COMMAND, "--dry-run"),
    ("reprocess", "reprocess-row"): (*COMMAND, "--stream"),
}


@pytest.fixture
def quick(monkeypatch):
    """Leaves out what takes the doctor seconds."""
    monkeypatch.setattr(trial, "_backend", lambda backend, _: installation.Check(f"backend {backend}", "ok", ""))
    monkeypatch.setattr("robid.commands.doctor.identification", lambda: installation.Check("identification", "ok", ""))


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("command", "kind"), CASES)
def test_a_command_prints_what_its_schema_says(done, command, kind):
    if command == "reprocess":
        Floor(done).start({"soft": 0.9})
    elif kind == "inspect-log":
        savemat(done.folder / "log.mat", bench_log(STIFFNESS, 0))
    elif kind == "inspect-response":
        (done.folder / "frf.csv").write_text("f,re,im\n1,2,3\n2,3,4\n")
    elif kind == "study":
        shutil.copy(_HERE / "study.yaml", done.folder)
    answer = done.robid(*CASES[command, kind], "--json")
    assert answer.code == 0, answer.err
    lines = answer.out.splitlines() if kind == "reprocess-row" else [answer.out]
    told = [json.loads(line) for line in lines]
    assert told[0]["type"] == kind
    assert [one["type"] for one in told[1:]] == (["reprocess"] if kind == "reprocess-row" else [])


def test_every_command_has_a_schema_and_every_kind_of_answer_a_case():
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        assert any("--json" in option.opts for option in command.params), name
    assert set(ANSWERS) == set(group.commands) - {"schema"}
    assert set(CASES) == {(name, one.type) for name, classes in ANSWERS.items() for one in classes}
    every = {one.type: one for classes in ANSWERS.values() for one in classes}
    assert len(every) == len(set(every.values())), "a type names one class"


@pytest.mark.parametrize(
    ("code", "arguments"),
    [
        (2, ("run", "nothing.yaml")),
        (2, ("status",)),
        (2, ("nothing",)),
        (3, ("fit", "small.yaml")),
        (3, ("inspect", "gone.h5")),
        (2, ("reprocess", "none.csv", "small.yaml", "--stream")),
    ],
)
def test_an_error_is_one_object_with_its_codes_and_exit_code(shop, code, arguments):
    answer = shop.robid(*arguments, "--json")
    assert (answer.code, answer.json["type"], answer.json["exit_code"]) == (code, "error", code)
    assert answer.json["error"] in answer.err
    assert answer.json["codes"]


@pytest.mark.parametrize("command", ANSWERS)
def test_a_schema_is_one_and_describes_every_key(command, capsys):
    assert run_command(["schema", "--of", command]) == 0
    schema = json.loads(capsys.readouterr().out)
    Draft202012Validator.check_schema(schema)
    for name, made in schema["$defs"].items():
        assert made["required"] == list(made["properties"])
        for key, value in made["properties"].items():
            assert value.get("description", "").endswith("."), f"{name}.{key}"


def test_what_a_schema_does_not_say_is_refused_here_and_allowed_to_newer_versions():
    told = {"type": "upgrade", "json_version": "1.0", "schema_version": 2, "changed": {"a.yaml": True}}
    check_answer(["upgrade"], json.dumps(told))
    Draft202012Validator(schema_of("upgrade")).validate({**told, "json_version": "1.4", "new": 1})
    wrong = ({"new": 1}, {"json_version": "2.0"}, {"schema_version": "2"}, {"changed": {"a.yaml": 1}})
    for change in wrong:
        with pytest.raises(ValidationError):
            check_answer(["upgrade"], json.dumps(told | change))
    del told["changed"]
    with pytest.raises(ValidationError):
        check_answer(["upgrade"], json.dumps(told))
    with pytest.raises(ValueError, match="NaN"):
        check_answer(["upgrade"], json.dumps(told | {"schema_version": float("nan")}))
    assert closed({"items": [{"properties": {}}]}) == {"items": [{"properties": {}, "additionalProperties": False}]}


def test_a_schema_of_no_command_and_two_schemas_at_once_are_refused(shop):
    shop.refuse(2, "S545", "`nothing`", command=("schema", "--of", "nothing"))
    shop.refuse(2, "S546", command=("schema", "--of", "run", "--robot"))
