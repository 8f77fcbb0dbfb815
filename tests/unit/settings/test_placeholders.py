"""Placeholders: what a row fills in, as which type, and where its files are."""

from dataclasses import replace

import pytest

from robid.errors import SettingsError
from robid.settings.placeholders import (
    Row,
    check_placeholders,
    fill,
    leads_outside,
    placeholders,
    read_as_yaml,
    refuse_placeholders,
)
from robid.settings.yaml import parse_yaml

TEXT = """\
name: arms
robot: ${row.robot}
campaigns:
  log:
    payload_kg: "${row.kg}"
    note: payload ${row.kg} kg of ${row.id}
    source:
      acquire:
        file: ${ROBID_DATA}/${row.id}.mat
        inputs: [{variable: "${row.kg}", file: "logs/${row.id}_{configuration}.mat"}]
"""


@pytest.fixture
def template(tmp_path):
    return parse_yaml(tmp_path / "arms.yaml", TEXT)


def row(folder, **values):
    return Row("r1", "fleet.csv:2", folder, {"id": "r1", "robot": "robots/a.yaml", "kg": "05.0", **values})


def test_a_row_fills_whole_values_by_type_and_texts_as_they_are(template, tmp_path):
    filled = fill(template, row(tmp_path / "floor"))
    log = filled.document.data["campaigns"]["log"]
    assert log["payload_kg"] == 5.0
    assert log["note"] == "payload 05.0 kg of r1"
    assert filled.problems == ()
    assert template.data["campaigns"]["log"]["payload_kg"] == "${row.kg}", "the file itself stays as it is"
    assert filled.document.line(("campaigns", "log", "note")) == 6


def test_files_that_a_row_names_start_at_the_manifest_or_the_data_folder(template, tmp_path):
    filled = fill(template, row(tmp_path / "fl{o}or"))
    acquire = filled.document.data["campaigns"]["log"]["source"]["acquire"]
    assert filled.document.data["robot"] == str(tmp_path / "fl{o}or/robots/a.yaml")
    assert acquire["file"] == "${ROBID_DATA}/r1.mat"
    assert acquire["inputs"][0]["file"] == str(tmp_path / "fl{{o}}or/logs/r1_{configuration}.mat")
    inside = ("campaigns", "log", "source", "acquire")
    assert dict(filled.written) == {
        ("robot",): "robots/a.yaml",
        (*inside, "inputs", 0, "file"): "logs/r1_{configuration}.mat",
    }


@pytest.mark.parametrize(
    ("values", "field", "text"),
    [
        ({"robot": "../a.yaml"}, "robot", "`../a.yaml` lies outside the manifest's folder"),
        ({"robot": "/a.yaml"}, "robot", "lies outside the manifest's folder"),
        ({"robot": "b/../../a.yaml"}, "robot", "lies outside"),
        ({"robot": ""}, "robot", "`robot` is empty in this row"),
        ({"robot": None}, "robot", "`robot` is empty in this row"),
        ({"id": "../x"}, "campaigns.log.source.acquire.file", "lies outside the data folder"),
        ({"robot": "a\0.yaml"}, "robot", "it has a NUL character"),
        ({"kg": None}, "campaigns.log.note", "`kg` is empty in this row"),
    ],
)
def test_what_cannot_be_filled_is_told_with_its_field(template, tmp_path, values, field, text):
    problems = fill(template, row(tmp_path, **values)).problems
    assert [(problem.field, text in problem.message) for problem in problems if problem.field == field] == [
        (field, True)
    ]


@pytest.mark.parametrize("name", ["robots/../robots/a.yaml", "./a.yaml", "..a.yaml"])
def test_a_name_that_stays_inside_is_fine(template, tmp_path, name):
    assert fill(template, row(tmp_path, robot=name)).problems == ()


def test_an_empty_value_that_stands_alone_says_nothing(template, tmp_path):
    problems = fill(template, row(tmp_path, kg="")).document.data["campaigns"]["log"]
    assert problems["payload_kg"] is None


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5", 5), ("-1e-3", -1e-3), ("1E6", 1e6), (".5", 0.5), ("true", True), ("", None), ("null", None), ("~", None),
        ("yes", "yes"), ("007", 7), ("12,5", "12,5"), ("2024-01-31", "2024-01-31"), ("a: b", "a: b"), ("#5", "#5"),
        ("-_", "-_"), ("0x_", "0x_"), ("0b_", "0b_"), ("._", "._"), ("9" * 5000, "9" * 5000),
        ("[1]", "[1]"), (" 5 ", 5), ("${row.kg}", "${row.kg}"), (5.5, 5.5), (None, None),
    ],
)  # fmt: skip
def test_values_are_read_as_yaml_reads_them(text, value):
    found = read_as_yaml(text)
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(("text", "value"), [("5", "5"), ("true", "true"), ("", None), (" ", None), (5, 5)])
def test_texts_of_a_row_that_has_types_stay_texts(template, tmp_path, text, value):
    typed = replace(row(tmp_path, kg=text), typed=True)
    assert fill(template, typed).document.data["campaigns"]["log"]["payload_kg"] == value


@pytest.mark.parametrize(
    ("text", "field"),
    [("name: ${row.id}\n", "name"), ("name: a\nexecution: {workers: '${row.id}'}\n", "execution.workers")],
)
def test_what_all_rows_share_is_no_matter_of_one(tmp_path, text, field):
    [problem] = check_placeholders(parse_yaml(tmp_path / "a.yaml", text), ("id",))
    assert (problem.field, "write it without a placeholder" in problem.message) == (field, True)


def test_what_a_row_says_is_not_filled_again(template, tmp_path):
    log = fill(template, row(tmp_path, kg="${row.id}")).document.data["campaigns"]["log"]
    assert log["payload_kg"] == "${row.id}"


def test_columns_that_are_asked_for_are_known_by_field(template):
    asked = placeholders(template)
    assert asked["robot",] == ("robot",)
    assert asked["campaigns", "log", "note"] == ("kg", "id")
    assert check_placeholders(template, ("id", "robot", "kg")) == []
    missing = check_placeholders(template, ("id", "robot"))
    assert {problem.line for problem in missing} == {5, 6, 10}


@pytest.mark.parametrize("wrong", ["${row.}", "${row.1a}", "${rows.a}", "${ROW.a}", "${row.a", "${}"])
def test_what_is_no_placeholder_is_filled_by_nothing(tmp_path, wrong):
    document = parse_yaml(tmp_path / "a.yaml", f"name: a\nnote: 'x {wrong}'\n")
    [problem] = check_placeholders(document, ("a",))
    assert (problem.line, problem.field, "nothing fills" in problem.message) == (2, "note", True)


def test_only_files_with_placeholders_are_refused(template, tmp_path):
    refuse_placeholders(parse_yaml(tmp_path / "a.yaml", "name: a\nfile: ${ROBID_DATA}/x\n"))
    with pytest.raises(SettingsError, match="robid reprocess") as caught:
        refuse_placeholders(template)
    assert caught.value.where.endswith("arms.yaml:2")


def test_a_link_is_followed_before_a_path_counts_as_inside(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "in/link").symlink_to(tmp_path / "out")
    (tmp_path / "in/same").symlink_to(tmp_path / "in")
    assert "through a link" in leads_outside(tmp_path / "in/link/a.mat", tmp_path / "in")
    assert leads_outside(tmp_path / "in/same/a.mat", tmp_path / "in") == ""


def test_a_link_that_leads_back_to_itself_is_told(tmp_path):
    (tmp_path / "loop.mat").symlink_to("loop.mat")
    assert "S360 `loop.mat`" in leads_outside(tmp_path / "loop.mat", tmp_path)
