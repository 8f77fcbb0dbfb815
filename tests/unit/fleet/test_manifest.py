"""Manifests: CSV as spreadsheets write it, and Parquet."""

import datetime
import decimal

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from robid.errors import SettingsError
from robid.fleet.manifest import read_manifest, wrong_rows


@pytest.fixture
def manifest(tmp_path):
    def write(content, name="fleet.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.mark.parametrize(
    "content",
    [
        "id,log,kg\na,x.mat,5\nb,y.mat,\n",
        "\ufeffid;log;kg\r\na;x.mat;5\r\nb;y.mat;\r\n",
        'id,log,kg\n"a","x.mat","5"\n\n"b",y.mat,""',
        "id;log;kg;;\na;x.mat;5;;\n;;;;\nb;y.mat;;;\n",
        " id , log , kg\n a, x.mat ,5\nb,y.mat,\n",
        "sep=;\nid;log;kg\na;x.mat;5\nb;y.mat;\n",
        "sep=,\r\nid,log,kg\r\na,x.mat,5\r\nb,y.mat,\r\n",
        "\n\nid;log;kg\na;x.mat;5\nb;y.mat;\n",
        "id\tlog\tkg\na\tx.mat\t5\nb\ty.mat\t\n",
    ],
)
def test_tables_of_text_are_read_as_spreadsheets_write_them(manifest, content):
    found = read_manifest(manifest(content))
    assert found.columns == ("id", "log", "kg")
    assert [dict(row.values) for row in found.rows] == [
        {"id": "a", "log": "x.mat", "kg": "5"},
        {"id": "b", "log": "y.mat", "kg": ""},
    ]
    assert [row.id for row in found.rows] == ["a", "b"]


def test_quotes_hold_separators_and_rows_know_their_line(manifest):
    path = manifest('id;note\na;"left; then\nright"\nb;"say ""stop"""\n')
    found = read_manifest(path)
    assert found.rows[0].values["note"] == "left; then\nright"
    assert found.rows[1].values["note"] == 'say "stop"'
    assert found.rows[1].place == f"{path}:4"
    assert found.rows[0].folder == path.parent


def test_a_line_that_names_the_separator_counts_as_a_line(manifest):
    path = manifest("sep=;\nid;log\na;x,y\n")
    [row] = read_manifest(path).rows
    assert (row.place, row.values["log"]) == (f"{path}:3", "x,y")


def test_rows_without_names_are_numbered(manifest):
    assert [row.id for row in read_manifest(manifest("log\nx\ny\n")).rows] == ["1", "2"]


def test_parquet_keeps_its_types(tmp_path):
    path = tmp_path / "fleet.parquet"
    columns = {"id": [7, 8], "kg": [4.5, float("nan")], "on": [datetime.date(2024, 1, 31), None], "ok": [True, False]}
    pq.write_table(pa.table(columns), path)
    found = read_manifest(path)
    assert [row.id for row in found.rows] == ["7", "8"]
    assert found.rows[0].values == {"id": 7, "kg": 4.5, "on": "2024-01-31", "ok": True}
    assert found.rows[1].values["kg"] is None
    assert found.rows[1].place == f"{path}:row 2"


def test_parquet_has_types_of_its_own(tmp_path):
    """Names that pandas made numbers with a point, decimals, and times finer than microseconds."""
    path = tmp_path / "fleet.parquet"
    columns = {
        "id": [1.0, 2.0], "robot": [7.0, None], "kg": [decimal.Decimal("4.5"), decimal.Decimal("5.0")],
        "serial": ["007", "1e5"], "time": pa.array([1_700_000_000_000_000_001, None], pa.timestamp("ns", "UTC")),
    }  # fmt: skip
    pq.write_table(pa.table(columns), path)
    first, second = read_manifest(path).rows
    assert (first.id, second.id) == ("1", "2")
    assert first.values == {"id": 1, "robot": 7, "kg": 4.5, "serial": "007", "time": "2023-11-14T22:13:20+00:00"}
    assert [row.alone("serial") for row in (first, second)] == ["007", "1e5"]
    assert type(first.values["id"]) is int


def test_a_time_that_no_date_holds_is_told_with_its_column(tmp_path):
    path = tmp_path / "fleet.parquet"
    pq.write_table(pa.table({"id": ["a"], "late": pa.array([253402300805], pa.timestamp("s"))}), path)
    with pytest.raises(SettingsError, match="column `late` cannot be read") as caught:
        read_manifest(path)
    assert "9999" in caught.value.remedy


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("fleet.parquet", b"id,log\n", "S044"),
        ("fleet.csv", "id,größe\n".encode("latin-1"), "not a UTF-8 text file"),
        ("fleet.csv", "id,,log\na,b,c\n", "column 2 has no name"),
        ("fleet.csv", "id,log\na,b,c\n", "fleet.csv:2: has 3 values"),
    ],
)
def test_what_is_no_table_is_refused(manifest, name, content, text):
    with pytest.raises(SettingsError, match=text) as caught:
        read_manifest(manifest(content, name))
    assert caught.value.remedy


def test_a_file_that_is_not_there_and_values_that_cannot_be_filled_in_are_refused(tmp_path):
    for name in ("no.csv", "no.parquet"):
        with pytest.raises(SettingsError, match=r"cannot be read"):
            read_manifest(tmp_path / name)
    pq.write_table(pa.table({"id": ["a"], "list": [[1, 2]]}), tmp_path / "list.parquet")
    with pytest.raises(SettingsError, match="type list cannot be filled in"):
        read_manifest(tmp_path / "list.parquet")


def test_rows_are_compared_without_names_that_nothing_asks_for(manifest):
    found = read_manifest(manifest("id,log\na,x\nb,x\n"))
    assert ["row b says the same as row a" in text for text in wrong_rows(found, {"log"})] == [True]
    assert list(wrong_rows(found, {"log", "id"})) == []
    assert list(wrong_rows(read_manifest(manifest("id\na\nb\n")), {"id"})) == []


@pytest.mark.parametrize("name", ["", ".", "..", ".a", "-a", "a/b", "a b", "ä", "x" * 65])
def test_names_that_make_no_folder_are_refused(manifest, name):
    [problem] = wrong_rows(read_manifest(manifest(f"id,log\n{name},x\n")), {"log"})
    assert "is no name of a folder" in problem


@pytest.mark.parametrize("name", ["a", "7", "KR300.R2_left-1", "x" * 64])
def test_names_that_make_a_folder_are_fine(manifest, name):
    assert list(wrong_rows(read_manifest(manifest(f"id,log\n{name},x\n")), {"log"})) == []
