"""Tables in which a number could be lost or changed without a word: it is read as meant, or the log is refused."""

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable
from robid.logs.inspection.findings import inspect_log
from robid.logs.inspection.text import write_experiment
from robid.signals.log_options import Dialect

ROWS = 200


def load(path, lines, **dialect):
    path = path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    return load_variables(path, None, None, Dialect(**dialect))


def rows(first=0, count=ROWS, end=""):
    return [f"{index},{0.5 * index + 0.25}{end}" for index in range(first, first + count)]


@pytest.mark.parametrize("at", [0, 3, ROWS - 1])
def test_a_quote_that_is_not_closed_takes_no_rows_with_it(tmp_path, at):
    lines = rows(end=",ok")
    lines[at] = lines[at].replace("ok", '"start')
    values = find_variable(load(tmp_path, ["t,q,comment", *lines]), "q")
    np.testing.assert_array_equal(values, 0.5 * np.arange(ROWS) + 0.25)


@pytest.mark.parametrize("stated", [None, 1])
@pytest.mark.parametrize("count", [1, 8, 150])
@pytest.mark.parametrize("cell", ["wait", "(0.5)", "0.5 # start"])
def test_a_column_that_begins_with_words_is_no_number_and_takes_no_rows_with_it(tmp_path, stated, count, cell):
    lines = [f"{line},{cell if index < count else 1.5}" for index, line in enumerate(rows())]
    variables = load(tmp_path, ["t,q,temperature", *lines], header_line=stated)
    assert len(find_variable(variables, "q")) == ROWS
    with pytest.raises(DataError) as refused:
        find_variable(variables, "temperature")
    assert "line 2" in str(refused.value)


def test_a_table_that_begins_with_missing_values_keeps_them(tmp_path):
    variables = load(tmp_path, ["a,b", *["nan,nan"] * 3, *rows()])
    assert np.isnan(find_variable(variables, "a")[:3]).all()
    assert len(find_variable(variables, "b")) == ROWS + 3


def test_rows_of_another_table_above_are_refused_until_one_is_chosen(tmp_path):
    lines = ["t,q", *rows(), "t,q,u", *rows(end=",1")]
    with pytest.raises(DataError) as refused:
        load(tmp_path, lines)
    assert "line 2" in str(refused.value)
    header = ROWS + 2
    assert f"header_line: {header}" in refused.value.remedy
    assert len(find_variable(load(tmp_path, lines, header_line=header), "q")) == ROWS


@pytest.mark.parametrize("preface", [["1 0 0", "0 1 0", "0 0 1"], ["1,0", "0,1", "2,2"], ["gain,0.5,2", "zero,1,1"]])
def test_few_numbers_above_a_header_are_no_rows(tmp_path, preface):
    assert len(find_variable(load(tmp_path, [*preface, "t,q,u", *rows(end=",1")]), "q")) == ROWS


@pytest.mark.parametrize(("thousands", "separator"), [(".", ";"), (",", ";"), (".", ",")])
def test_a_mark_that_stands_twice_in_a_number_marks_thousands_in_all_of_its_column(tmp_path, thousands, separator):
    true = 487306 + 25000 * np.arange(ROWS)
    cells = [f"{value:,}".replace(",", thousands) for value in true]
    variables = load(tmp_path, [f"t{separator}count", *(f"{i}{separator}{cell}" for i, cell in enumerate(cells))])
    np.testing.assert_array_equal(find_variable(variables, "count"), true)


def test_such_a_number_far_behind_the_first_ones_is_asked_about(tmp_path):
    count = 60_000
    lines = [f"{index};487.306" for index in range(count)]
    lines[-1] = f"{count};1.234.567"
    variables = load(tmp_path, ["t;count", *lines])
    with pytest.raises(DataError) as refused:
        find_variable(variables, "count")
    assert f"line {count + 1}" in str(refused.value)
    stated = load(tmp_path, ["t;count", *lines], decimal=",")
    assert set(find_variable(stated, "count").tolist()) == {487306, 1234567}


def test_decimal_commas_are_seen_where_the_end_has_none(tmp_path):
    lines = [f'{index},"{0.5 * index + 0.25}"'.replace(".", ",") for index in range(ROWS)]
    values = find_variable(load(tmp_path, ["t,q", *lines, *(f'{ROWS + i},"0"' for i in range(40))]), "q")
    np.testing.assert_array_equal(values, [*(0.5 * np.arange(ROWS) + 0.25), *np.zeros(40)])


@pytest.mark.parametrize("mark", ["\n", "\r", "\x85", "\u2028", "\x1b[2J"])
def test_names_of_variables_do_not_end_the_line_of_a_proposal(tmp_path, mark):
    h5py = pytest.importorskip("h5py")
    file, count = tmp_path / "log.h5", 4000
    name = f"torque{mark}          - {{name: other, variable: angle, unit: rad}} #"
    period = np.random.default_rng(1).normal(size=500)
    torque = np.tile(period - period.mean(), count // 500)
    with h5py.File(file, "w") as log:
        log["time"] = 1e-3 * np.arange(count)
        log[name] = torque
        log[name].attrs["unit"] = "N m"
        log["angle"] = np.cumsum(np.cumsum(torque)) * 1e-6
        log["angle"].attrs["unit"] = "rad"
    read = YAML(typ="safe", pure=True).load(write_experiment(inspect_log([file]), "log"))
    source = read["campaigns"]["log"]["source"]["acquire"]
    assert [one["variable"] for one in source["inputs"]] == [name]
    assert [one["variable"] for one in source["outputs"]] == ["angle"]


def test_packed_values_are_what_their_attributes_say(tmp_path):
    h5py = pytest.importorskip("h5py")
    raw = np.array([[100, 1], [-250, 2], [-9999, 3]], np.int16)
    with h5py.File(tmp_path / "log.h5", "w") as log:
        for name, values in (("torque", raw[:, 0]), ("both", raw)):
            log[name] = values
            log[name].attrs.update({"scale_factor": 0.01, "add_offset": 1.0, "_FillValue": np.int16(-9999)})
            log[name].attrs["units"] = np.array([b"N m"])
        log["plain"] = raw[:, 1]
    variables = load_variables(tmp_path / "log.h5")
    np.testing.assert_allclose(find_variable(variables, "torque"), [2.0, -1.5, np.nan])
    assert find_variable(variables, "plain").tolist() == [1, 2, 3]
    assert variables.units["torque"] == "N m"
    column = load_variables(tmp_path / "log.h5", None, ["both(:,1)"])
    np.testing.assert_allclose(find_variable(column, "both(:,1)"), [2.0, -1.5, np.nan])


def test_times_with_a_fill_value_keep_their_last_digit(tmp_path):
    h5py = pytest.importorskip("h5py")
    stamps = 1_700_000_000_000_000_123 + 1_000_000 * np.arange(5)
    with h5py.File(tmp_path / "log.h5", "w") as log:
        log["time"] = stamps
        log["time"].attrs["_FillValue"] = np.int64(-1)
        log["time"].attrs["units"] = np.zeros(0)
    np.testing.assert_array_equal(load_variables(tmp_path / "log.h5")["time"], stamps)
