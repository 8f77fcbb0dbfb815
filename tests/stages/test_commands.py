import json
import re
from dataclasses import replace

import numpy as np
import pytest

from page_words import said
from robid.artifacts.kinds import (
    DESIGN,
    EXCITATION,
    design_from_artifact,
    design_to_artifact,
    excitation_from_artifact,
    excitation_to_artifact,
)
from robid.artifacts.results import MODEL, VALIDATION, grade_from_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.models.elastic.files import (
    model_of,
    new_resonances_from_artifact,
    resonances_from_artifact,
    solution_from_artifact,
    validation_from_artifact,
    validation_of,
)
from robid.models.known import load_experiment
from robid.pipeline import graph as pipeline

CHAIN = (
    ("design-configs",),
    ("design-excitation", "--campaign", "estimation"),
    ("design-excitation", "--campaign", "validation"),
    ("simulate-or-acquire", "--campaign", "estimation"),
    ("simulate-or-acquire", "--campaign", "validation"),
    ("estimate-frf", "--campaign", "estimation"),
    ("estimate-frf", "--campaign", "validation"),
    ("fit",),
    ("validate",),
    ("report",),
)


def test_the_stages_one_by_one_give_what_run_gives_and_the_page_tells_what_they_told(done):
    told = []
    for name, *options in CHAIN:
        answer = done.robid(name, "small.yaml", *options, "--run-dir", "single", "--json")
        assert answer.code == 0, answer.err
        assert answer.json["outcome"] == "made"
        told.append(answer.json["text"].rpartition(" (")[0].partition(" in all")[0])
    page = said((done.folder / "single" / "report.html").read_text())
    for text in told[:-1]:
        assert text in page
    assert done.contents(done.folder / "single") == done.contents()
    assert (done.folder / "single" / "summary.json").read_text() == (done.runs / "summary.json").read_text()


@pytest.mark.parametrize("command", CHAIN)
def test_a_fresh_output_is_left_alone(done, command):
    before = done.files()
    name, *options = command
    answer = done.robid(name, "small.yaml", *options)
    assert answer.code == 0
    # Of a validation that is fresh its warning is said again.
    assert all(line.startswith("warning: Predicts") for line in answer.err.splitlines())
    assert "fresh: nothing to do" in answer.out
    assert done.files() == before


def test_the_plan_is_shown_before_anything_is_measured(done):
    answer = done.robid("design-excitation", "small.yaml", "--campaign", "validation", "--force")
    assert answer.code == 0
    rows = [line for line in answer.out.splitlines() if line.strip().startswith(("turn", "lift", "plan"))]
    assert len(rows) == 3, answer.out
    assert "the campaign takes 8.0 s" in answer.out


def test_force_makes_it_again(done):
    answer = done.robid("fit", "small.yaml", "--force", "--json")
    assert (answer.code, answer.json["outcome"]) == (0, "made")
    assert set(done.states().values()) == {("fresh", "")}


def test_an_output_that_differs_needs_force(done):
    done.change("starts: 2", "starts: 3")
    before = done.files()
    answer = done.robid("fit", "small.yaml")
    assert answer.code == 3
    assert "settings changed: fits.elastic.starts" in answer.flat
    assert "--force" in answer.flat
    assert done.files() == before
    assert done.robid("fit", "small.yaml", "--force").code == 0


@pytest.mark.parametrize(
    ("command", "missing", "maker"),
    [
        (("design-excitation", "--campaign", "estimation"), "designs/best.h5", "robid design-configs small.yaml"),
        (("simulate-or-acquire", "--campaign", "validation"), "validation/excitation.h5", "--campaign validation"),
        (("estimate-frf", "--campaign", "estimation"), "estimation/record.h5", "robid simulate-or-acquire small.yaml"),
        (("fit",), "estimation/frf.h5", "robid estimate-frf small.yaml --campaign estimation"),
        (("validate",), "fits/elastic/model.h5", "robid fit small.yaml --fit elastic"),
        (("report",), "designs/best.h5", "robid design-configs small.yaml --design best"),
    ],
)
def test_a_missing_input_names_the_command_that_makes_it(shop, command, missing, maker):
    name, *options = command
    answer = shop.robid(name, "small.yaml", *options)
    assert answer.code == 3
    assert missing in answer.flat
    assert maker in answer.flat


def test_the_first_command_of_a_remedy_works_where_nothing_is_there_yet(shop):
    told = shop.robid("export", "small.yaml", "--format", "json").flat
    command = re.search(r"`robid ([^`]+)`", told.partition("remedy:")[2])[1].split()
    assert shop.robid(*command).code == 0
    assert shop.robid("export", "small.yaml", "--format", "json").code == 0


def test_status_says_where_the_run_folder_is(shop):
    told = shop.robid("status", "small.yaml").out
    assert "runs/small" in told
    elsewhere = shop.robid("status", "small.yaml", "--run-dir", "other").out
    assert "other" in elsewhere


def test_a_stale_input_stops_the_stage(done):
    done.change("compensation: nominal", "compensation: none")
    answer = done.robid("fit", "small.yaml", "--force")
    assert answer.code == 3
    assert "settings changed: campaigns.estimation.estimate.compensation" in answer.flat


def test_inputs_and_output_by_name(done):
    frf = done.runs / "validation" / "frf.h5"
    answer = done.robid("fit", "small.yaml", "--input", str(frf), "--output", "elsewhere.h5", "--json")
    assert answer.code == 0, answer.err
    shape = done.robid("inspect", "elsewhere.h5", "--json").json["datasets"]["elastic/responses/configurations"][
        "shape"
    ]
    assert shape == [1, 2]
    assert done.robid("fit", "small.yaml", "--input", str(frf), "--output", "elsewhere.h5").out.endswith("to do\n")
    wrong = done.robid("fit", "small.yaml", "--input", str(done.runs / "validation" / "record.h5"))
    assert wrong.code == 2
    assert "`fit` reads no record" in wrong.flat


def test_the_owner_may_be_left_out_only_when_there_is_one(done):
    answer = done.robid("estimate-frf", "small.yaml")
    assert answer.code == 2
    assert "`estimation`, `validation`" in answer.flat
    unknown = done.robid("fit", "small.yaml", "--fit", "elastik")
    assert unknown.code == 2
    assert "there are: `elastic`" in unknown.flat


def test_inspect_describes_an_artifact(done):
    path = str(done.runs / "estimation" / "frf.h5")
    answer = done.robid("inspect", path)
    assert answer.code == 0
    for text in (
        "made by estimate-frf",
        "frequency_hz",
        "rad/s^2/(N m)",
        "input_channels: motor torque of turn [N m], motor torque of lift [N m]",
    ):
        assert text in answer.out
    found = done.robid("inspect", path, "--json").json
    assert found["provenance"]["settings"]["campaigns.estimation.estimate"]["compensation"] == "nominal"
    assert str(done.folder) not in json.dumps(found)


def test_schema_version_and_status_print_to_stdout(shop):
    assert "campaigns" in shop.robid("schema").json["properties"]
    assert "springs" in shop.robid("schema", "--robot").json["properties"]
    assert shop.robid("--version").out.startswith("robid ")
    status = shop.robid("status", "small.yaml")
    assert (status.code, status.err) == (0, "")
    assert status.out.count("missing") == len(CHAIN)


@pytest.mark.parametrize(
    "arguments",
    [("fitt", "small.yaml"), ("fit",), ("run", "small.yaml", "--worker", "2"), ("run", "x", "--workers", "0")],
)
def test_a_usage_error_exits_2_with_one_message(shop, arguments):
    answer = shop.robid(*arguments)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.count("robid: ") == 1
    assert "S377" in answer.err


def test_an_error_is_one_json_object_too(shop):
    answer = shop.robid("fit", "small.yaml", "--json")
    assert answer.json["exit_code"] == answer.code == 3
    assert "frf.h5" in answer.json["error"]


def test_a_defect_says_so_and_debug_shows_where(shop, monkeypatch):
    def fail(*_):
        raise KeyError("lost")

    monkeypatch.setattr("robid.commands.status.asked_for", fail)
    answer = shop.robid("status", "small.yaml")
    assert answer.code == 1
    assert "a defect of ours: KeyError" in answer.err
    assert "--debug" in answer.err
    assert "Traceback" not in answer.err
    assert "Traceback" in shop.robid("status", "small.yaml", "--debug").err


def test_a_full_disk_is_refused_before_anything_runs(shop, monkeypatch):
    monkeypatch.setattr(pipeline, "_SMALL_BYTES", 1e18)
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 3
    assert "MB left" in answer.flat
    assert shop.contents() == {}


def test_the_room_of_records_is_counted(shop):
    loaded = load_experiment(shop.folder / "small.yaml")
    nodes = {node.output: node.plan.needed_bytes for node in pipeline.graph(loaded)}
    # 2 configurations, 2 realizations, 2 experiments, 2 periods of 500 samples, 2 motors, torque and angle, 4 bytes.
    assert nodes["estimation/record.h5"] == 2 * (2 * 2 * 2 * 2 * 500 * 2 * 2 * 4)


def graded_model_from(artifact):
    return solution_from_artifact(artifact), grade_from_artifact(artifact), resonances_from_artifact(artifact)


def whole_validation_from(artifact):
    return validation_from_artifact(artifact), new_resonances_from_artifact(artifact)


def with_provenance(write):
    def write_with(content, provenance):
        parts = content if isinstance(content, tuple) else (content,)
        return replace(write(*parts), provenance=provenance)

    return write_with


@pytest.mark.parametrize(
    ("path", "kind", "read", "write"),
    [
        ("designs/best.h5", DESIGN, design_from_artifact, design_to_artifact),
        ("estimation/excitation.h5", EXCITATION, excitation_from_artifact, excitation_to_artifact),
        ("fits/elastic/model.h5", MODEL, graded_model_from, with_provenance(model_of)),
        ("fits/elastic/validation.h5", VALIDATION, whole_validation_from, with_provenance(validation_of)),
    ],
)
def test_what_is_read_and_written_again_is_the_same(done, path, kind, read, write):
    artifact = read_artifact(done.runs / path, kind)
    again = write(read(artifact), artifact.provenance)
    assert write_artifact(done.folder / "again.h5", again) == done.contents()[path]


def test_the_page_shows_the_resonances_of_the_model_file(done):
    """Numbers that no model has show that the page computes none of its own."""
    path = done.runs / "fits/elastic/model.h5"
    artifact = read_artifact(path, MODEL)
    solution, grade, resonances = graded_model_from(artifact)
    assert 'id="fit-1-resonances"' in (done.runs / "report.html").read_text()
    other = replace(resonances, measured_hz=np.full_like(resonances.measured_hz, 77.31))
    write_artifact(path, replace(model_of(solution, grade, other), provenance=artifact.provenance))
    assert done.robid("run", "small.yaml").code == 0
    assert (done.runs / "report.html").read_text().count(">77.31<") == len(resonances.channel)


def test_an_experiment_without_fits_and_a_fit_of_some_configurations(done):
    done.change("validate_on: validation, ", "validate_on: validation, configurations: [2], ")
    answer = done.robid("run", "small.yaml", "--json")
    assert answer.code in (0, 5), answer.err
    datasets = done.robid("inspect", str(done.runs / "fits/elastic/model.h5"), "--json").json["datasets"]
    assert datasets["elastic/responses/configurations"]["shape"] == [1, 2]
    text = (done.folder / "small.yaml").read_text()
    (done.folder / "small.yaml").write_text(text[: text.index("fits:")] + text[text.index("execution:") :])
    answer = done.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    assert "No fit was asked for; the responses of 2 campaigns are measured and known: estimation to" in answer.out
    assert set(done.states().values()) == {("fresh", "")}
