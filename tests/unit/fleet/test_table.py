"""The table of results: names and types as documented, and columns of the manifest by what they hold."""

import re
from pathlib import Path

import pytest

from robid.fleet.table import LAST_COLUMNS, PARAMETER_COLUMNS, ROW_COLUMNS, column_type

_PAGE = Path(__file__).parents[3] / "docs/reprocessing.md"


def test_the_documentation_lists_every_column_with_its_type():
    listed = re.findall(r"^\| `(\w+)` \| (\w+) \|", _PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == [*ROW_COLUMNS.items(), *PARAMETER_COLUMNS.items(), *LAST_COLUMNS.items()]


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        (["1", "2"], "int64"), (["1", "2.5"], "double"), (["1", ""], "int64"), (["a", "1"], "string"),
        (["true", "false"], "bool"), (["true", "1"], "string"), (["", None], "string"), ([1.5, None], "double"),
    ],
)  # fmt: skip
def test_a_column_of_the_manifest_has_the_narrowest_type_that_holds_it(column, kind):
    assert column_type(column) == kind
