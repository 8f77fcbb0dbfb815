"""JSON logs: records in lines or in a list, lists by name, what lacks values, and what is no JSON."""

import json

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable, tell_format

T = np.arange(400) * 0.004
Q = np.sin(9 * T)
TAU = np.cos(31 * T)


def load(folder, text, name="log.json"):
    path = folder / name
    path.write_text(text)
    return load_variables(path)


def records(extra=lambda _: {}):
    return [
        {"t": t, "drive": {"q": q, "tau": [u, -u]}, **extra(i)}
        for i, (t, q, u) in enumerate(zip(T, Q, TAU, strict=True))
    ]


@pytest.mark.parametrize("dump", [json.dumps, lambda rows: "\n".join(map(json.dumps, rows))], ids=["list", "lines"])
@pytest.mark.parametrize("name", ["log.json", "log.jsonl", "log.log", "log"])
def test_records_have_columns_and_matrices(tmp_path, dump, name):
    variables = load(tmp_path, dump(records()), name)
    np.testing.assert_array_equal(find_variable(variables, "t"), T)
    np.testing.assert_array_equal(find_variable(variables, "drive.q"), Q)
    np.testing.assert_array_equal(find_variable(variables, "drive.tau(:,2)"), -TAU)


def test_lists_by_name_rows_below_columns_and_lists_of_rows(tmp_path):
    table = np.stack([T, Q], axis=1)
    for text, names in (
        (json.dumps({"a": {"t": T.tolist(), "q": Q.tolist()}, "robot": "arm"}), ("a.t", "a.q")),
        (json.dumps({"index": list(range(400)), "columns": ["t", "q"], "data": table.tolist()}), ("t", "q")),
        (json.dumps({"samples": [{"t": t, "q": q} for t, q in table.tolist()]}), ("samples.t", "samples.q")),
        (json.dumps(table.tolist()), ("1(:,1)", "1(:,2)")),
    ):
        variables = load(tmp_path, text)
        np.testing.assert_array_equal(find_variable(variables, names[0]), T)
        np.testing.assert_array_equal(find_variable(variables, names[1]), Q)


def test_what_a_record_lacks_is_missing(tmp_path):
    rows = records(lambda i: {"late": float(i), "pair": [i, i]} if i >= 100 and i % 2 else {"none": None})
    variables = load(tmp_path, "\n".join(map(json.dumps, rows)))
    late = find_variable(variables, "late")
    assert len(late) == len(T)
    np.testing.assert_array_equal(np.flatnonzero(np.isfinite(late)), np.arange(101, 400, 2))
    np.testing.assert_array_equal(late[101::2], np.arange(101, 400, 2))
    np.testing.assert_array_equal(find_variable(variables, "pair(:,2)")[101::2], np.arange(101, 400, 2))
    assert np.isnan(find_variable(variables, "none")).all()


def test_nanoseconds_keep_their_digits_and_numbers_in_quotes_are_numbers(tmp_path):
    stamps = 1_767_225_600_123_456_789 + 4_000_000 * np.arange(400)
    variables = load(tmp_path, json.dumps({"t": stamps.tolist(), "q": [repr(one) for one in Q.tolist()]}))
    np.testing.assert_array_equal(find_variable(variables, "t"), stamps)
    np.testing.assert_array_equal(find_variable(variables, "q"), Q)


def test_moments_are_times_since_the_first_with_their_origin(tmp_path):
    stamps = [f"2026-01-01T23:59:59.{i:03d}Z" for i in range(0, 800, 2)]
    variables = load(tmp_path, json.dumps({"t": stamps, "q": Q.tolist()}))
    np.testing.assert_allclose(find_variable(variables, "t"), 0.002 * np.arange(400), atol=1e-9)
    assert variables.origin("t") == ("1970", 1_767_311_999 * 10**9)
    assert variables.units["t"] == "s"


def test_a_mark_of_lines_within_a_text_is_no_new_record(tmp_path):
    rows = (json.dumps(one, ensure_ascii=False) for one in records(lambda i: {"note": f"a\u2028{i}"}))
    variables = load(tmp_path, "\r\n".join(rows), "log.jsonl")
    np.testing.assert_array_equal(find_variable(variables, "drive.q"), Q)


def test_texts_and_lists_of_several_lengths_are_told_apart_from_numbers(tmp_path):
    variables = load(tmp_path, json.dumps(records(lambda i: {"mode": "run" * i, "odd": [0.0] * (1 + i % 2)})))
    for name in ("mode", "odd"):
        with pytest.raises(DataError):
            find_variable(variables, name)
    np.testing.assert_array_equal(find_variable(variables, "t"), T)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n".join([*map(json.dumps, records()[:7]), '{"t": 1,', *map(json.dumps, records())]), "line 8"),
        ("\n".join(map(json.dumps, records()))[:-20], "line 400"),
        (json.dumps(records())[:-30], "no JSON"),
        (json.dumps({"t": T.tolist()}, indent=1)[:-30], "no JSON"),
        ("[" * 100_000, "no JSON"),
    ],
    ids=["a line", "the last line", "a list", "lists", "deep"],
)
def test_what_is_no_json_is_refused(tmp_path, text, said):
    with pytest.raises(DataError, match=said):
        load(tmp_path, text)


def test_a_table_that_begins_with_a_brace_in_a_name_is_a_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("{t},q\n" + "\n".join(f"{t},{q}" for t, q in zip(T, Q, strict=True)))
    assert tell_format(path) == "csv"
