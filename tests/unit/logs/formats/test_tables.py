"""Tables of text: every dialect is told from the table or stated, what is broken is located, memory stays bounded."""

import gzip
import lzma
import tracemalloc

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.tables import CHUNK
from robid.logs.formats.variables import find_variable
from robid.signals.log_options import Dialect

COLUMN = [0.001, -2]
NAMES = ["t", "speed [rad/s]"]


def load(path, text, names=None, encoding="utf-8", **dialect):
    path = path / "log.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return load_variables(path, None, names, Dialect(**dialect))


@pytest.mark.parametrize(
    "text",
    [
        "# a comment\n t , speed [rad/s]\n0,1e-3\n1,-2\n",
        '"t";"speed [rad/s]"\n0;0,001\n\n1;-2,0\n',
        '"t","speed [rad/s]"\n"0","0.001"\n"1","-2"\n',
        "t\tspeed [rad/s]\r\n0\t0.001\r\n1\t-2\r\n",
        "t\tspeed [rad/s]\n0\t0,001\n1\t-2,0\n",
        "t|speed [rad/s]\n0|0.001\n1|-2\n",
        "\ufefft,speed [rad/s]\n0,0.001\n1,-2",
        "t;speed [rad/s];\n0;0,001;\n1;-2;\n",
        "t;speed [rad/s]\n0;0,001;\n1;-2;\n",
        "Recorder 7.1\nDate;2020-01-01;x\n\nt;speed [rad/s]\n0;0,001\n1;-2\n",
        "# made by hand\n# t, speed [rad/s]\n0, 0.001\n1, -2\n",
        "# t;speed [rad/s];\n0;0,001;\n1;-2;\n",
        "# t;speed [rad/s]\n0;0,001;\n1;-2;\n",
        "t,speed [rad/s]\n% in the middle\n0,0.001\n% in the middle\n1,-2\n",
    ],
)
def test_dialects_are_told(tmp_path, text):
    variables = load(tmp_path, text)
    assert list(variables) == NAMES
    assert variables.units == {"speed [rad/s]": "rad/s"}
    np.testing.assert_array_equal(find_variable(variables, "speed [rad/s]"), COLUMN)
    np.testing.assert_array_equal(find_variable(variables, "t"), [0, 1])


def test_separators_within_quotes_are_text(tmp_path):
    variables = load(tmp_path, '"t, s","speed, motor"\n0,0.001\n1,-2\n')
    np.testing.assert_array_equal(find_variable(variables, "speed, motor"), COLUMN)
    quoted = load(tmp_path, 't,speed\n"0,0","0,001"\n"1,0","-2,0"\n', decimal=",")
    np.testing.assert_array_equal(find_variable(quoted, "speed"), COLUMN)
    assert find_variable(quoted, "t").tolist() == [0, 1]


@pytest.mark.parametrize(
    "beside",
    ["03.05.2024 23:59:56,101000", "a valve, no. 3", "1.234,5"],
    ids=["a date with points", "a text", "thousands"],
)
def test_decimal_commas_between_commas_are_told_by_numbers_alone(tmp_path, beside):
    variables = load(tmp_path, f'"speed","other"\n"0,001","{beside}"\n"-2,0","{beside}"\n', names=["speed"])
    np.testing.assert_array_equal(find_variable(variables, "speed"), COLUMN)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "utf-8", "cp1252"])
def test_the_encoding_is_told(tmp_path, encoding):
    variables = load(tmp_path, "t;Drehzahl °\n0;1\n1;2\n", encoding=encoding)
    np.testing.assert_array_equal(find_variable(variables, "Drehzahl °"), [1, 2])


def test_another_encoding_is_stated(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes("時間,速度\n0,1\n1,2\n".encode("shift_jis"))
    assert list(load_variables(path, None, None, Dialect(encoding="shift_jis"))) == ["時間", "速度"]
    for wrong in ("utf-8", "no_such"):
        with pytest.raises(DataError, match="cannot be read as text") as caught:
            load_variables(path, None, None, Dialect(encoding=wrong))
        assert "dialect: {encoding: ...}" in caught.value.remedy


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("0 0.001\n  1\t-2\n", {}),
        ("0,0 0,001\n1,0   -2,0\n", {}),
        ("0,0.001\n1,-2\n", {}),
        ("lost\n\n0;0,001\n1;-2\n", {}),
        ("t;speed\nq;r;s\n0;0,001\n1;-2\n", {"header_line": 0}),
        ("0 0,001\n1 -2\n", {"delimiter": "whitespace", "decimal": ","}),
    ],
)
def test_columns_without_names_are_numbered(tmp_path, text, dialect):
    variables = load(tmp_path, text, **dialect)
    assert list(variables) == ["1", "2"]
    np.testing.assert_array_equal(find_variable(variables, "2"), COLUMN)


@pytest.mark.parametrize("units", ["s;rad/s", "[s];[rad/s]", "s ; rad/s"])
def test_a_line_of_units_is_none_of_numbers(tmp_path, units):
    variables = load(tmp_path, f"t;speed\n{units}\n0;0,001\n1;-2\n")
    assert variables.units == {"t": "s", "speed": "rad/s"}
    np.testing.assert_array_equal(find_variable(variables, "speed"), COLUMN)


def test_names_that_are_numbers_have_their_line_stated(tmp_path):
    text = "made by\n10,20\n0,0.001\n1,-2\n"
    np.testing.assert_array_equal(find_variable(load(tmp_path, text, header_line=2), "20"), COLUMN)


def test_names_stand_where_it_is_stated(tmp_path):
    text = "a;b\nt;speed\nx;y\n0;0,001\n1;-2\n"
    assert list(load(tmp_path, text)) == ["x", "y"]
    assert list(load(tmp_path, text, header_line=2)) == ["t", "speed"]


def test_moments_become_seconds_from_the_first(tmp_path):
    text = "when,q\n2024-03-31 01:59:59.998,0\n2024-03-31 01:59:59.999,\n2024-03-31 02:00:00.001,2\n"
    variables = load(tmp_path, text)
    np.testing.assert_allclose(variables["when"], [0, 0.001, 0.003], atol=1e-12)
    assert variables.units["when"] == "s"
    np.testing.assert_array_equal(variables["q"], [0, np.nan, 2])


@pytest.mark.parametrize(
    "cells",
    [
        '"0,001","-2"\n"1,23","0,5"',
        '"0,001","-2,0"\n"1,230","0,500"',
        "0.001,-2\n1.23,.5",
        '0.001;-2\n1,23;"0,5"',
        "1.0D-03 -2\n1.23D0 0.5",
        "0.001,\u22122\n1.23,0.5",
    ],
)
def test_marks_of_decimals_are_told(tmp_path, cells):
    table = load(tmp_path, f"{cells}\n")
    np.testing.assert_array_equal(np.stack([table["1"], table["2"]], 1), [[0.001, -2], [1.23, 0.5]])


def test_groups_of_thousands_are_not_taken_for_decimals(tmp_path):
    variables = load(tmp_path, 't,q\n0,"1,234"\n1,"12,345"\n')
    with pytest.raises(DataError, match="text"):
        find_variable(variables, "q")
    assert find_variable(load(tmp_path, 't,q\n0,"1,234"\n1,"2,5"\n'), "q").tolist() == [1.234, 2.5]


@pytest.mark.parametrize(
    ("cells", "numbers"),
    [
        ("0,5;999 1,5;1.000 2,5;-12.345", [999, 1000, -12345]),
        ("0.5;999 1.5;1,000 2.5;-12,345", [999, 1000, -12345]),
        ("0,5;999,5 1,5;1.000 2,5;1.234,25", [999.5, 1000, 1234.25]),
        ("0.5;999.5 1.5;1,000 2.5;1,234.25", [999.5, 1000, 1234.25]),
        ("0,001;0.999 0,5;1.000 1,5;1.234", [0.999, 1, 1.234]),
        ("0;1.234.567 1;1.234.568,5 2;3,5", [1234567, 1234568.5, 3.5]),
    ],
)
def test_marks_of_thousands_are_told_by_what_marks_decimals(tmp_path, cells, numbers):
    found = load(tmp_path, "t;q\n" + cells.replace(" ", "\n") + "\n")
    np.testing.assert_allclose(find_variable(found, "q"), numbers)


def test_a_comma_that_may_be_either_is_asked_for(tmp_path):
    text = "t;q\n0;999\n1;1,000\n"
    with pytest.raises(DataError, match=r"1000 or 1\.000") as caught:
        find_variable(load(tmp_path, text), "q")
    for decimal, value in ((".", 1000), (",", 1)):
        assert f'decimal: "{decimal}"' in caught.value.remedy
        assert find_variable(load(tmp_path, text, decimal=decimal), "q")[1] == value


@pytest.mark.parametrize(
    "gap",
    [
        *("#N/A", "-1.#IND", "1.#QNAN", "-1.#IND00", "1,#QNAN", "n/a", "NULL", "-nan(ind)", "nan(snan)", "NaN"),
        *("<NA>", "None", "#NV", "#DIV/0!", "--", "", "n.a."),
    ],
)
def test_words_for_what_is_missing_are_gaps(tmp_path, gap):
    variables = load(tmp_path, f"t;q;when\n0;1;10:00:00\n1;{gap};10:00:01\n2;{gap};{gap}\n" + "3;4;10:00:03\n" * 5)
    np.testing.assert_array_equal(find_variable(variables, "q")[:4], [1, np.nan, np.nan, 4])
    np.testing.assert_array_equal(find_variable(variables, "when")[:4], [0, 1, np.nan, 3])


def test_what_is_infinite_stays_so(tmp_path):
    found = load(tmp_path, "t,q,w\n0,1.#INF,1\n1,-1.#INF,inf\n2,0,-Infinity\n")
    assert (found["q"].tolist(), found["w"].tolist()) == ([np.inf, -np.inf, 0], [1, np.inf, -np.inf])


def test_a_column_that_is_empty_at_the_end_is_told_by_what_is_above(tmp_path):
    found = load(tmp_path, "t,q,when\n0,5,10:00:00\n" + "1,,\n" * 50)
    assert (found["q"][0], np.isnan(found["q"][1:]).all(), found["when"][0]) == (5, True, 0)


@pytest.mark.parametrize("head", ["t;q\n", "made by x\nt;q\ns;rad\n", "a;b\nt;q\n"])
def test_a_head_that_stands_there_again_is_passed_over(tmp_path, head):
    rows = ["0;0,5\n1;1\n", "2;1,5\n3;2\n"]
    found = load(tmp_path, head.join(["", *rows]))
    np.testing.assert_array_equal(find_variable(found, "q"), [0.5, 1, 1.5, 2])
    joined = head + rows[0] + "\ufeff" + head.replace("\n", " \n") + rows[1]
    np.testing.assert_array_equal(find_variable(load(tmp_path, joined), "q"), [0.5, 1, 1.5, 2])
    with pytest.raises(DataError, match=f"line {head.count(chr(10)) + 3}"):
        find_variable(load(tmp_path, rows[0].join([head, "other;head\n"]) + rows[1]), "q")


@pytest.mark.parametrize(
    "foot",
    ["EOF\n", "EOF", "\n(4 rows affected)\n", "*** end ***\n\n", "End;of;file\n", "The;end\n", "The;end\nof;it\n"],
)
def test_words_below_the_table_are_passed_over(tmp_path, foot):
    np.testing.assert_array_equal(load(tmp_path, f"t;q\n0;1\n1;2\n{foot}")["q"], [1, 2])
    with pytest.raises(DataError, match=r"line [45]: "):
        load(tmp_path, f"t;q\n0;1\n1;2\n{foot.rstrip()}\n3;4\n")


@pytest.mark.parametrize("foot", ["*** end ***", "--- end ---", "+ + +"])
def test_words_below_a_table_of_spaces_may_be_as_many_as_its_columns(tmp_path, foot):
    np.testing.assert_array_equal(load(tmp_path, f"0 1 5\n1 2 6\n{foot}\n")["2"], [1, 2])
    rows = "0 1 5\n--- --- ---\nnan -- nan\n3 4 5\n"  # gaps, though no number is among them
    np.testing.assert_array_equal(load(tmp_path, rows)["2"], [1, np.nan, np.nan, 4])
    timed = f"10:00:00.5 1 5\n10:00:01.5 2 6\n{foot}\n"
    np.testing.assert_array_equal(load(tmp_path, timed)["2"], [1, 2])
    named = load(tmp_path, f"run 1 5\nrun nan nan\n{foot}\n")["2"]
    np.testing.assert_array_equal(named, [1, np.nan])


@pytest.mark.parametrize(
    "text",
    [
        "when,q\n2024-09-24 14:05:15,999,0.5\n2024-09-24 14:05:16,001,1\n",
        "q,when\n0.5,14:05:15,999\n1,14:05:16,001\n",
        "when q\n2024-09-24 14:05:15.999 0.5\n2024-09-24 14:05:16.001 1\n",
        "when\tq\n24.09.2024  14:05:15.999\t0.5\n24.09.2024 14:05:16.001\t1\n",
        "date,time,q\n2024-09-24,14:05:15.999,0.5\n2024-09-24,14:05:16.001,1\n",
    ],
)
def test_moments_that_the_separator_cuts_are_joined(tmp_path, text):
    variables = load(tmp_path, text)
    np.testing.assert_array_equal(variables["q"], [0.5, 1])
    np.testing.assert_allclose(variables["time" if "date" in text else "when"], [0, 0.002], atol=1e-12)


@pytest.mark.parametrize("names", [["t [s]", "q [rad]"], None])
@pytest.mark.parametrize(
    ("delimiter", "decimal", "end"), [(",", ".", ""), (";", ",", ";"), ("\t", ",", ""), (" ", ".", "")]
)
def test_a_table_may_lie_across(tmp_path, names, delimiter, decimal, end):
    values = np.stack([np.arange(600) / 1000, np.random.default_rng(1).normal(size=600)])
    values[1, 7] = np.nan
    rows = [delimiter.join(f"{x:.9f}".replace(".", decimal) for x in row) for row in values]
    if names and delimiter != " ":
        rows = [f"{name}{delimiter}{row}" for name, row in zip(names, rows, strict=True)]
    called = names if names and delimiter != " " else ["1", "2"]
    text = "# across\n" + "".join(f"{row}{end}\n" for row in rows)
    for asked in (None, [called[1]]):
        found = load(tmp_path, text, asked)
        assert list(found) == (asked or called)
        np.testing.assert_allclose(found[called[1]], values[1], atol=1e-9)
        assert found.sizes == dict.fromkeys(called, 600)
    assert found.units == ({"t [s]": "s", "q [rad]": "rad"} if called == names else {})


def test_a_wide_table_of_many_rows_does_not_lie_across(tmp_path):
    text = "".join(",".join(f"{0.5 + column:g}" for column in range(300)) + "\n" for _ in range(70))
    assert load(tmp_path, text, ["300"])["300"].tolist() == [299.5] * 70


def test_text_leaves_the_other_columns_readable(tmp_path):
    variables = load(tmp_path, "t,state,q,none\n0,OK,1,\n1,ERROR,2,\n2,OK,x,\n")
    np.testing.assert_array_equal(find_variable(variables, "t"), [0, 1, 2])
    for name, what in (("state", "text (`OK`)"), ("q", "In line 4 `x` is no number"), ("none", "empty")):
        with pytest.raises(DataError) as caught:
            find_variable(variables, name)
        assert what in caught.value.what
        assert caught.value.where == f"{tmp_path / 'log.csv'}: variable `{name}`"


def test_names_that_repeat_are_numbered(tmp_path):
    variables = load(tmp_path, "t,q,t,w\n0,5,9,1\n1,6,8,2\n")
    np.testing.assert_array_equal(find_variable(variables, "t(2)"), [9, 8])
    np.testing.assert_array_equal(find_variable(variables, "t(1)"), [0, 1])
    with pytest.raises(DataError, match="occurs 2 times"):
        find_variable(variables, "t")
    with pytest.raises(DataError, match="occurs 2 times"):
        find_variable(variables, "t(3)")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("\n\n", "no table"),
        ("t,q\n", "no table"),
        ("t,q\n0,1\n1\n", "line 3: D079 The table is broken: 1 values for 2 columns"),
        ("t,q\n0,1\n1,2,3\n4,5\n6,7\n", "line 3: D079 The table is broken: 3 values for 2 columns"),
        ("t,q\n0,1,2\n1,2,3\n", "line 2: D085 The table is broken: 3 values for 2 columns"),
        (b"\xff\xfe\x00\x01", "no table"),
        (b"\x80\x81\x82", "no table"),
        (b"t,q\n\x00,1\n", "cannot be read as text"),
    ],
)
def test_broken_tables_are_located(tmp_path, text, words):
    with pytest.raises(DataError) as caught:
        load(tmp_path, text)
    assert words in str(caught.value)
    assert "log.csv" in caught.value.where
    assert caught.value.remedy


def test_the_remedy_for_names_that_do_not_fit_works(tmp_path):
    text = "motor speed, load\n0,1,2\n1,2,3\n"
    with pytest.raises(DataError, match="3 values for 2 columns of line 1") as caught:
        load(tmp_path, text)
    assert "dialect: {header_line: 0}" in caught.value.remedy
    assert list(load(tmp_path, text, header_line=0)) == ["1", "2", "3"]


@pytest.mark.parametrize("pack", [gzip.compress, lzma.compress])
def test_packed_tables(tmp_path, pack):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(pack(b"t,q\n" + b"0,1\n" * 500))
    assert load_variables(path)["q"].sum() == 500
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(DataError, match="cannot be"):
        load_variables(path)


def test_of_a_wide_table_only_what_is_asked_for_is_kept(tmp_path):
    width, length = 400, 12000
    line = ",".join(f"{0.25 * column:g}" for column in range(width))
    path = tmp_path / "log.csv"
    with path.open("w") as file:
        file.write(",".join(f"c{column}" for column in range(width)) + "\n")
        file.writelines(f"{row}{line[1:]}\n" for row in range(length))
    assert path.stat().st_size > 20 * CHUNK
    tracemalloc.start()
    variables = load_variables(path, None, ["c0", "c7", "c399"])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert list(variables) == ["c0", "c7", "c399"]
    np.testing.assert_array_equal(variables["c0"], np.arange(length))
    np.testing.assert_array_equal(variables["c399"], np.full(length, 0.25 * 399))
    assert variables.sizes["c5"] == length
    assert peak < 8 * CHUNK


def test_chunks_join_seamlessly(tmp_path, monkeypatch):
    monkeypatch.setattr("robid.logs.formats.tables.CHUNK", 64)
    values = np.random.default_rng(5).normal(size=(300, 2))
    variables = load(tmp_path, "a,b\n" + "".join(f"{a!r},{b!r}\n" for a, b in values.tolist()))
    np.testing.assert_array_equal(np.stack([variables["a"], variables["b"]], axis=1), values)
