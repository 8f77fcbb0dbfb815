"""Reads Parquet files row group by row group, and of them only the columns that were asked for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from robid.logs.formats.variables import Found, Reason, Wanted

_UNITS = (b"unit", b"units")


def read(file: Path, wanted: Wanted) -> Found:
    """Reads columns of a Parquet file; fields of nested columns are `column.field`."""
    found = Found()
    with pq.ParquetFile(file) as table:
        for field in table.schema_arrow:
            for name, leaf in _leaves(field.name, field):
                _take(name, field.name, leaf, table, wanted, found)
    return found


def _leaves(name: str, field: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Names every column inside nested ones."""
    if pa.types.is_struct(field.type):
        for inner in field.type:
            yield from _leaves(f"{name}.{inner.name}", inner)
    else:
        yield name, field


def _take(name: str, top: str, leaf: Any, table: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds one column; a list of one length in all rows is a matrix."""
    unit = next(((leaf.metadata or {})[key].decode() for key in _UNITS if key in (leaf.metadata or {})), "")
    is_list = pa.types.is_list(leaf.type) or pa.types.is_fixed_size_list(leaf.type)
    kind = leaf.type.value_type if is_list else leaf.type
    is_time = pa.types.is_timestamp(kind)
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind) or is_time):
        found.unreadable[name] = Reason(f"It holds {kind}, not numbers.")
        return
    unit = "s" if is_time else unit
    if name not in wanted:
        found.mention(name, table.metadata.num_rows, unit)
        return
    try:
        parts = [
            _numbers(
                table.read_row_group(group, columns=[name]).column(top).combine_chunks(), name, top, is_time=is_time
            )
            for group in range(table.num_row_groups)
        ]
        values: NDArray[Any] = np.concatenate(parts) if parts else np.zeros(0)
    except MemoryError:
        raise
    except Exception as e:  # noqa: BLE001 a damaged column leaves the others readable
        found.unreadable[name] = Reason(f"It cannot be decoded ({e}).", "Write the log again from its source.")
        return
    found.add(name, (values - values[:1]) / np.timedelta64(1, "s") if is_time else values, unit)


def _numbers(column: Any, name: str, top: str, *, is_time: bool) -> NDArray[Any]:  # noqa: ANN401
    """The numbers of one row group, NaN where there is none; or its moments."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    for inner in name.removeprefix(top).split(".")[1:]:
        array = array.field(inner)
    if pa.types.is_list(array.type) or pa.types.is_fixed_size_list(array.type):
        lengths = np.unique(np.asarray(array.value_lengths()))
        if len(lengths) != 1 or array.null_count:
            raise ValueError("its lists have several lengths")
        return np.asarray(array.flatten().to_numpy(zero_copy_only=False)).reshape(len(array), int(lengths[0]))
    values: NDArray[Any] = array.to_numpy(zero_copy_only=False)
    if is_time:
        return values.astype("datetime64[ns]")
    return values.astype(float) if values.dtype == object else values
