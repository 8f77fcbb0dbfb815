"""The table of results: names and types as documented, and columns of the manifest by what they hold."""

import re
from pathlib import Path

import pyarrow as pa
import pytest

from robid.fleet.table import LAST_COLUMNS, PARAMETER_COLUMNS, ROW_COLUMNS, column_of

_PAGE = Path(__file__).parents[3] / "docs/how-to/many-robots.md"


def test_the_documentation_lists_every_column_with_its_type():
    listed = re.findall(r"^\| `(\w+)` \| (\w+) \|", _PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == [*ROW_COLUMNS.items(), *PARAMETER_COLUMNS.items(), *LAST_COLUMNS.items()]


def written(column, name="kg", *, typed=False):
    """The type of a column, and what the file holds of it."""
    kind, cells = column_of(column, name, typed=typed)
    return kind, pa.array(cells, pa.type_for_alias(kind)).to_pylist()


@pytest.mark.parametrize(
    ("column", "kind", "cells"),
    [
        (["1", "-2", "0"], "int64", [1, -2, 0]), (["1", "2.5"], "double", [1.0, 2.5]), (["1", ""], "int64", [1, None]),
        (["a", "1"], "string", ["a", "1"]), (["true", "false"], "bool", [True, False]),
        (["true", "1"], "string", ["true", "1"]), (["", None], "string", [None, None]),
        (["1e-05", "1E+06"], "double", [1e-5, 1e6]),
        (["007", "7"], "string", ["007", "7"]), (["2024_01", "1"], "string", ["2024_01", "1"]),
        (["12e5"], "string", ["12e5"]), (["1e+400"], "string", ["1e+400"]), ([".5", "1"], "string", [".5", "1"]),
        (["0x10", "0o7"], "string", ["0x10", "0o7"]), (["-0"], "string", ["-0"]), ([".inf"], "string", [".inf"]),
        (["5.10", "left"], "string", ["5.10", "left"]),
    ],
)  # fmt: skip
def test_a_column_has_the_narrowest_type_that_changes_nothing_written_in_it(column, kind, cells):
    assert written(column) == (kind, cells)


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        ([str(2**63 - 1)], "int64"), ([str(2**63)], "string"), (["9" * 20], "string"), (["9" * 5000, "1"], "string"),
        ([str(2**53), "1.5"], "double"), ([str(2**53 + 1), "1.5"], "string"),
    ],
)  # fmt: skip
def test_numbers_that_no_type_holds_stay_texts(column, kind):
    found, cells = written(column)
    assert found == kind
    assert [str(cell) for cell in cells] == [str(float(text)) if kind == "double" else text for text in column]


def test_what_parquet_calls_a_text_is_one_and_what_it_calls_a_number_too():
    assert written(["5", "6"], typed=True) == ("string", ["5", "6"])
    assert written([1.5, None], typed=True) == ("double", [1.5, None])
    assert written([2**63 + 5, 1], typed=True) == ("string", ["9223372036854775813", "1"])


@pytest.mark.parametrize("name", ["robot", "group"])
def test_robots_and_groups_have_names(name):
    assert written(["7", "8"], name) == ("string", ["7", "8"])
    assert written([7, None], name, typed=True) == ("string", ["7", None])
