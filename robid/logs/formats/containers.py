"""Reads files of named channels: HDF5, Parquet, Arrow, TDMS and MDF; each library is imported by its reader alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.hdf5 import datasets_in
from robid.logs.formats.unpacking import room_for
from robid.logs.formats.variables import Found, Reason, Wanted, number_repeated

_UNITS = ("units", "unit", "Unit", "Units", "unit_string")
_FILLS = ("_FillValue", "missing_value")
_PACKED = (*_FILLS, "scale_factor", "add_offset")
_PARQUET_UNITS = (b"unit", b"units")
_COPIED = "Check that the log was copied completely."
_VALUE = 8  # bytes of a number
_AGAIN = "Write the log again from its source."
_CUT = Reason("D049 The log is cut short.", "Check that it was copied completely, or save it again.")


def read_hdf5(file: Path, wanted: Wanted) -> Found:
    """Reads the datasets of an HDF5 file by their path, of a matrix only the columns that were asked for."""
    import h5py

    found = Found(room=room_for(file))
    with h5py.File(file, "r") as root:
        for name, dataset in datasets_in(root):
            with found.guarded(name, remedy=_AGAIN):
                _take_dataset(name, dataset, wanted, found)
    return found


def _take_dataset(name: str, dataset: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    unit = next((one for key in _UNITS if key in dataset.attrs for one in np.ravel(dataset.attrs[key])[:1]), "")
    unit = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
    packed = {key: dataset.attrs[key] for key in _PACKED if key in dataset.attrs}
    for field in dataset.dtype.names or ("",):
        path = f"{name}.{field}" if field else name
        kind = dataset.dtype[field] if field else dataset.dtype
        if kind.kind not in "fiubc":
            found.unreadable[path] = Reason("D050 It contains no numbers.")
        elif field and path in wanted:
            found.reserve(path, kind.itemsize * dataset.size)
            found.add(path, dataset[field], unit)
        elif field:
            found.mention(path, int(np.prod(dataset.shape)), unit)
        else:
            found.take(path, dataset, wanted, unit)
            for name in [one for one in found.arrays if packed and one in (path, *_series(path, dataset, wanted))]:
                found.arrays[name] = _unpacked(found.arrays[name], packed)


def _series(path: str, dataset: Any, wanted: Wanted) -> list[str]:  # noqa: ANN401
    """Names of the columns and rows of a matrix that were asked for."""
    return [f"{path}{index}" for index in wanted.series(path) or []] if len(dataset.shape) > 1 else []


def _unpacked(values: NDArray[Any], packed: Mapping[str, Any]) -> NDArray[Any]:
    """Values as their attributes say: NaN where one is a fill value, then scaled, then offset.

    Source:
        CF conventions 1.11, sec. 2.5.1 and 8.1.
    """
    fills = [np.ravel(packed[key]) for key in _FILLS if key in packed]
    none = np.isin(values, np.concatenate(fills)) if fills else np.zeros(values.shape, bool)
    if not none.any() and not {"scale_factor", "add_offset"} & set(packed):
        return values  # nanoseconds since 1970 have more digits than a float holds
    made = np.where(none, np.nan, values.astype(float))
    scale, offset = (float(np.ravel(packed.get(key, one))[0]) for key, one in (("scale_factor", 1), ("add_offset", 0)))
    return np.asarray(scale * made + offset)


@dataclass(frozen=True)
class _Table:
    """A table of Parquet or Arrow."""

    schema: Any  # Its fields, as Arrow has them
    rows: int  # How many
    groups: Callable[[str, str], Iterator[Any]]  # The parts of a column by its name, which a top one's begins


def read_parquet(file: Path, wanted: Wanted) -> Found:
    """Reads columns of a Parquet file, row group by row group; fields of nested columns are `column.field`."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(file) as log:

        def groups(name: str, top: str) -> Iterator[Any]:
            return (log.read_row_group(group, columns=[name]).column(top) for group in range(log.num_row_groups))

        return _read_columns(
            _Table(log.schema_arrow, log.metadata.num_rows, groups), wanted, Found(room=room_for(file))
        )


def read_arrow(file: Path, wanted: Wanted) -> Found:
    """Reads columns of an Arrow or Feather file, batch by batch; names are as of Parquet."""
    import pyarrow as pa

    def batches(column: int) -> Iterator[Any]:
        options = pa.ipc.IpcReadOptions(included_fields=[column], use_threads=False)
        with pa.memory_map(str(file)) as source, pa.ipc.open_file(source, options=options) as log:
            yield from (log.get_batch(number) for number in range(log.num_record_batches))

    with pa.memory_map(str(file)) as source, pa.ipc.open_file(source) as log:
        schema = log.schema

    def groups(_: str, top: str) -> Iterator[Any]:
        return (batch.column(top) for batch in batches(schema.get_field_index(top)))

    rows = sum(batch.num_rows for batch in batches(0)) if len(schema) else 0
    return _read_columns(_Table(schema, rows, groups), wanted, Found(room=room_for(file)))


def _read_columns(table: _Table, wanted: Wanted, found: Found) -> Found:
    for field in table.schema:
        for name, leaf in _leaves(field.name, field):
            _take_column(name, field.name, leaf, table, wanted, found)
    return found


def _leaves(name: str, field: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Names every column inside nested ones."""
    from pyarrow import types

    if types.is_struct(field.type):
        for inner in field.type:
            yield from _leaves(f"{name}.{inner.name}", inner)
    else:
        yield name, field


def _is_list(kind: Any) -> bool:  # noqa: ANN401
    from pyarrow import types

    return bool(types.is_list(kind) or types.is_fixed_size_list(kind))


def _take_column(name: str, top: str, leaf: Any, table: _Table, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds one column; a list of one length in all rows is a matrix."""
    from pyarrow import types

    told = leaf.metadata or {}
    unit = next((told[key].decode() for key in _PARQUET_UNITS if key in told), "")
    kind = leaf.type.value_type if _is_list(leaf.type) else leaf.type
    is_time = types.is_timestamp(kind)
    if not (types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind) or is_time):
        found.unreadable[name] = Reason(f"D051 It contains {kind}, not numbers.")
        return
    unit = "s" if is_time else unit
    if name not in wanted:
        found.mention(name, table.rows, unit)
        return
    found.reserve(name, _VALUE * table.rows)
    with found.guarded(name, "It cannot be decoded", _AGAIN):
        parts = [_numbers(one, name, top, is_time=is_time) for one in table.groups(name, top)]
        values: NDArray[Any] = np.concatenate(parts) if parts else np.zeros(0)
        if is_time:
            values = _since_first(name, values, found)
        found.add(name, values, unit)


def _since_first(name: str, moments: NDArray[Any], found: Found) -> NDArray[np.float64]:
    """Seconds since the first moment (n_row,) that there is, NaN where there is none; notes when that was."""
    known = moments[~np.isnat(moments)].astype("datetime64[ns]")
    if not len(known):
        return np.full(len(moments), np.nan)
    found.origins[name] = "1970", int(known[0].astype(np.int64))
    return np.asarray((moments - known[0]) / np.timedelta64(1, "s"))


def _numbers(column: Any, name: str, top: str, *, is_time: bool) -> NDArray[Any]:  # noqa: ANN401
    """The numbers of one row group, NaN where there is none; or its moments."""
    from pyarrow import ChunkedArray

    array = column.combine_chunks() if isinstance(column, ChunkedArray) else column
    for inner in name.removeprefix(top).split(".")[1:]:
        array = array.field(inner)
    if _is_list(array.type):
        lengths = np.unique(np.asarray(array.value_lengths()))
        if len(lengths) != 1 or array.null_count:
            raise ValueError("its lists have several lengths")
        return np.asarray(array.flatten().to_numpy(zero_copy_only=False)).reshape(len(array), int(lengths[0]))
    values: NDArray[Any] = array.to_numpy(zero_copy_only=False)
    if is_time:
        return values.astype("datetime64[ns]")
    return values.astype(float) if values.dtype == object else values


def read_tdms(file: Path, wanted: Wanted) -> Found:
    """Reads channels of a TDMS file, scaled as it says: `group/channel`, by the rate that it states their time."""
    from nptdms import TdmsFile

    found = Found()
    with TdmsFile.open(file) as log:
        if log.file_status.incomplete_final_segment or not log.groups():
            found.damage = _CUT
        statuses = log.file_status.channel_statuses or {}
        channels = [channel for group in log.groups() for channel in group.channels()]
        starts = [channel.properties.get("wf_start_time") for channel in channels]
        begun = min((start for start in starts if start is not None), default=None)
        for channel in channels:
            name = f"{channel.group_name}/{channel.name}"
            cut = statuses.get(channel.path)
            if cut is not None and cut.read_length != cut.expected_length:
                what = f"D052 The log ends inside it: {cut.read_length} of {cut.expected_length} values are there."
                found.unreadable[name] = Reason(what, _CUT.remedy)
                continue
            unit = str(channel.properties.get("unit_string", ""))
            if name in wanted:
                with found.guarded(name, remedy=_COPIED):
                    found.add(name, channel[:], unit)
            elif channel.dtype is not None and channel.dtype.kind in "fiubc":
                found.mention(name, len(channel), unit)
            step = channel.properties.get("wf_increment")
            if step and f"{name}.time" in wanted:
                first = _first_s(channel.properties, begun)
                found.add(f"{name}.time", first + float(step) * np.arange(len(channel)), "s")
                if begun is not None:
                    found.origins[f"{name}.time"] = "1970", int(begun.astype("datetime64[ns]").astype(np.int64))
            elif step:
                found.mention(f"{name}.time", len(channel), "s")
    return found


def _first_s(properties: Mapping[str, Any], begun: Any) -> float:  # noqa: ANN401
    """When the first sample of a channel was taken, since the first channel began [s]."""
    start = properties.get("wf_start_time")
    late = 0.0 if start is None or begun is None else float((start - begun) / np.timedelta64(1, "s"))
    return late + float(properties.get("wf_start_offset") or 0.0)


def read_mdf(file: Path, wanted: Wanted) -> Found:
    """Reads channels of an MDF file, version 4 mostly, converted as it says; the time of each is `channel.time`."""
    from asammdf import MDF

    found = Found()
    log: Any
    with MDF(file) as log:
        places = [
            (channel.name, group, index)
            for group, content in enumerate(log.groups)
            for index, channel in enumerate(content.channels)
            if index != log.masters_db.get(group)
        ]
        names, twice = number_repeated([name for name, _, _ in places])
        found.unreadable.update(twice)
        for name, (plain, group, index) in zip(names, places, strict=True):
            if name in wanted or plain in wanted or f"{name}.time" in wanted:
                with found.guarded(name, "It cannot be decoded", _COPIED):
                    signal = log.get(group=group, index=index)
                    found.add(name, signal.samples, signal.unit or "")
                    if f"{name}.time" in wanted:
                        found.add(f"{name}.time", signal.timestamps, "s")
                        found.origins[f"{name}.time"] = "1970", round(log.header.start_time.timestamp() * 1e6) * 1000
            else:
                size = int(log.groups[group].channel_group.cycles_nr)
                found.mention(name, size, str(log.groups[group].channels[index].unit or ""))
                found.mention(f"{name}.time", size, "s")
    return found
