"""The table of results: a Parquet file with a row for each robot and parameter.

Schema history:
    1.2: `row.robot` and `row.group` are texts, and so is a column with a text that is no plain number.
    1.1: `away`, `outlier`, `outlier_row`.
    1.0: the first.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from robid.artifacts.artifact import canonical_hash
from robid.artifacts.atomic import replacing
from robid.errors import ArtifactError, require_module
from robid.files import check_regular
from robid.fleet.manifest import GROUP, ID, ROBOT
from robid.results.grade import WORDS
from robid.settings.placeholders import read_as_yaml
from robid.versions import __version__

if TYPE_CHECKING:
    from robid.fleet.comparison import Comparison
    from robid.fleet.ledger import Ledger
    from robid.fleet.rows import Fleet
    from robid.settings.placeholders import Value

TABLE_VERSION = "1.2"
ROW_COLUMNS = dict.fromkeys(("id", "status", "error_kind", "error", "remedy"), "string")
PARAMETER_COLUMNS = {
    **dict.fromkeys(("fit", "parameter", "kind", "joint", "unit", "tied_to"), "string"),
    **dict.fromkeys(("nominal", "estimate", "standard_deviation", "relative_standard_deviation"), "double"),
    "predicted_relative_standard_deviation": "double",
    **dict.fromkeys(("effective", "effective_low", "effective_high"), "double"),
    **dict.fromkeys(("physical", "physical_low", "physical_high", "confidence"), "double"),
    **{"identifiable": "bool", "identified": "bool", "away": "double", "outlier": "bool", "grade": "int8"},
    **dict.fromkeys(("grade_word", "verdict", "model_sha256"), "string"),
}
LAST_COLUMNS = {"outlier_row": "bool", "settings_sha256": "string", "seconds": "double"}
"""Names and types of the columns; those of the manifest, `row.<name>`, follow those of the row."""

_KEY = b"robid"
_MANIFEST = "row."
_ENTRIES = 10_000
_WHOLE = re.compile(r"0|-?[1-9][0-9]{0,18}")
_DECIMAL = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+(?:[eE][+-][0-9]+)?|[eE][+-][0-9]+)")
_INT64, _EXACT = 2**63, 2**53

Ledgers = Callable[[], Iterable["Ledger | None"]]
"""Reads the ledgers of all rows, in the order of the manifest; None for a row that has not been made."""


def require_table() -> None:
    """Refuses to start without what writes the table.

    Raises:
        SettingsError: If pyarrow is not installed.
    """
    require_module("pyarrow", "fleet", "The table of results")


def check_table(path: Path) -> None:
    """Refuses to start where another file is in the table's place.

    Raises:
        ArtifactError: If it is so.
    """
    if path.exists() and not _about(path):
        remedy = "move it away, or name another run folder with --run-dir"
        raise ArtifactError(
            "A028 There is a file that is no table of robid, or a damaged one.", where=str(path), remedy=remedy
        )


def write_table(
    path: Path, fleet: Fleet, ledgers: Ledgers, comparison: Comparison | None = None
) -> Literal["made", "fresh"]:
    """Writes the table, rows without a ledger as `pending`, unless the one that is there says the same."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    own = {f"{_MANIFEST}{name}": name for name in fleet.manifest.columns if name != ID}
    columns = {
        shown: column_of([planned.row.values[name] for planned in fleet.rows], name, typed=fleet.rows[0].row.typed)
        for shown, name in own.items()
    }
    types = ROW_COLUMNS | {shown: kind for shown, (kind, _) in columns.items()} | PARAMETER_COLUMNS | LAST_COLUMNS
    cells = {shown: column for shown, (_, column) in columns.items()}
    content = _content_sha256(types, _entries(fleet, ledgers(), cells, comparison))
    about = {
        "kind": "fleet",
        "schema_version": TABLE_VERSION,
        "robid_version": __version__,
        "experiment": fleet.experiment.name,
        "content_sha256": content,
    }
    schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in types.items()])
    if path.exists() and _about(path).get("content_sha256") == content and _is_whole(path, schema):
        return "fresh"
    schema = schema.with_metadata({_KEY: json.dumps(about).encode()})
    with replacing(path) as partial, pq.ParquetWriter(partial, schema, write_page_checksum=True) as writer:
        entries = _entries(fleet, ledgers(), cells, comparison)
        while some := list(islice(entries, _ENTRIES)):
            writer.write_table(pa.Table.from_pylist(some, schema=schema))
    return "made"


def _content_sha256(types: Mapping[str, str], entries: Iterator[dict[str, Any]]) -> str:
    digest = hashlib.sha256(canonical_hash([TABLE_VERSION, dict(types)]).encode())
    for entry in entries:
        digest.update(canonical_hash(entry).encode())
    return digest.hexdigest()


def _about(path: Path) -> dict[str, Any]:
    """What a table says of itself; nothing of a file that is none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        check_regular(path)
        found = json.loads((pq.read_schema(path).metadata or {})[_KEY])
    except (OSError, KeyError, ValueError, pa.ArrowException):
        return {}
    return found if isinstance(found, dict) else {}


def _is_whole(path: Path, schema: Any) -> bool:  # noqa: ANN401
    """Whether every page of a table has its checksum, and its columns are those of a schema."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            n_row = sum(len(batch) for batch in file.iter_batches())
            return bool(file.schema_arrow.equals(schema) and n_row == file.metadata.num_rows)
    except (OSError, ValueError, pa.ArrowException):
        return False


def _entries(
    fleet: Fleet, ledgers: Iterable[Ledger | None], values: Mapping[str, Sequence[Value]], comparison: Comparison | None
) -> Iterator[dict[str, Any]]:
    for index, (planned, ledger) in enumerate(zip(fleet.rows, ledgers, strict=True)):
        common: dict[str, Any] = {"id": planned.row.id, "status": "pending" if ledger is None else ledger.status}
        common |= {name: column[index] for name, column in values.items()}
        if ledger is None:
            yield common
            continue
        common |= {"settings_sha256": ledger.settings_hash, "seconds": ledger.seconds}
        if ledger.error is not None:
            error = ledger.error
            yield {**common, "error_kind": error.kind, "error": str(error), "remedy": error.remedy}
        elif comparison is not None:
            common["outlier_row"] = index in comparison.off
        for entry in ledger.results:
            off = {} if comparison is None else _off(comparison, index, entry)
            value, sentence = ledger.grades.get(entry["fit"], (None, ""))
            grade = {} if value is None else {"grade": value, "grade_word": WORDS[value], "verdict": sentence}
            yield {**common, **entry, **off, **grade}


def _off(comparison: Comparison, row: int, entry: Mapping[str, Any]) -> dict[str, Any]:
    """How far a parameter is off its population; nothing where that is not told."""
    key = entry["fit"], entry["parameter"]
    away = float(comparison.away[key][row]) if key in comparison.away else math.nan
    return {} if math.isnan(away) else {"away": away, "outlier": (row, *key) in comparison.accused}


def column_of(values: Sequence[Value], name: str, *, typed: bool) -> tuple[str, list[Value]]:
    """Returns type and cells of a column of the manifest: the narrowest type that changes nothing written in it."""
    read = list(values) if typed else [_read(value) for value in values]
    kind = "string" if name in (ROBOT, GROUP) else _narrowest([value for value in read if value is not None])
    if kind == "string":
        return kind, [None if value is None or value == "" else str(value) for value in values]
    return kind, read


def _narrowest(values: Sequence[Value]) -> str:
    kinds = {type(value) for value in values}
    if kinds == {bool}:
        return "bool"
    wholes = [value for value in values if type(value) is int]
    if kinds == {int} and all(-_INT64 <= whole < _INT64 for whole in wholes):
        return "int64"
    is_double = kinds and kinds <= {int, float} and all(abs(whole) <= _EXACT for whole in wholes)
    return "double" if is_double else "string"


def _read(value: Value) -> Value:
    """The number or truth value that a text is, if it would be written no other way; else the text."""
    if not isinstance(value, str):
        return value
    if _WHOLE.fullmatch(value):
        return int(value)
    if _DECIMAL.fullmatch(value) and math.isfinite(float(value)):
        return float(value)
    found = read_as_yaml(value)
    return found if found is None or isinstance(found, bool) else value
