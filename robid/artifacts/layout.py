"""How datasets, attributes and text lie in an HDF5 file.

Text is of fixed length and the file format 1.10: HDF5 then checks headers and text by checksums, where damaged strings
of variable length can make it loop for ever.
"""

from __future__ import annotations

import math
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from robid.artifacts.artifact import Attribute, Label, digest_rows, normalise_attribute
from robid.hdf5 import datasets_in

# What h5py raises on damaged files, seen by flipping bytes.
DAMAGE = (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, OverflowError, MemoryError)

COMPRESSION_LEVEL = 1
_LARGE_BYTES = 1 << 14
_CHUNK_BYTES = 1 << 18
_DENSE = 8  # Bytes of a floating-point value from which it is noise to its last digit: deflate leaves 93 % of it


class _File:
    """A file that never fails towards HDF5, which reports a full disk late and in destructors; it keeps the error."""

    def __init__(self, path: Path) -> None:
        self._raw = path.open("w+b", buffering=0)
        self.error: OSError | None = None

    def write(self, data: bytes | memoryview) -> int:
        left = memoryview(data)
        while self.error is None and left:
            try:
                left = left[self._raw.write(left) :]
            except OSError as error:
                self.error = error
        return len(data)

    def truncate(self, size: int) -> None:
        try:
            self._raw.truncate(size)
        except OSError as error:
            self.error = self.error or error

    def read(self, size: int = -1) -> bytes:
        return self._raw.read(size) or b""

    def readinto(self, buffer: memoryview) -> int:
        return self._raw.readinto(buffer) or 0

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Nothing is buffered."""

    def check(self) -> None:
        if self.error is not None:
            raise self.error

    def close(self) -> None:
        self._raw.close()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Holds an interrupt back to the end: raised within HDF5, it would come out as an error of HDF5."""
    before, held = signal.getsignal(signal.SIGINT), []
    if before is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def create_file(path: Path) -> Iterator[h5py.File]:
    """Yields a new HDF5 file to write to; an interrupt waits until it is closed.

    Raises:
        OSError: If it cannot be written, the first error that the system gave.
    """
    stream = _File(path)
    try:
        with _uninterrupted(), h5py.File(stream, "w", libver=("v110", "v110")) as file:
            yield file
        stream.check()
    except DAMAGE:
        stream.check()
        raise
    finally:
        stream.close()


def set_attributes(item: h5py.Group | h5py.Dataset, values: Mapping[str, Attribute]) -> None:
    """Writes attributes."""
    for name, value in values.items():
        item.attrs[name] = text_in(np.asarray(value))


def get_attributes(item: h5py.Group | h5py.Dataset) -> dict[str, Attribute]:
    """Reads attributes."""
    return {name: normalise_attribute(name, text_out(np.asarray(value)).tolist()) for name, value in item.attrs.items()}


def has_large_rows(label: Label, dtype: np.dtype[Any]) -> bool:
    """Whether the rows of a dataset are stored one by one."""
    return label.by_row and dtype.itemsize * math.prod(label.shape[1:]) > _LARGE_BYTES


def chunk_shape(label: Label, dtype: np.dtype[Any]) -> tuple[int, ...] | None:
    """Chunks in which a dataset is compressed, of which none belongs to two large rows; None where it is not."""
    dense = dtype.kind in "fc" and dtype.itemsize >= _DENSE
    if dense or dtype.itemsize * math.prod(label.shape) <= _LARGE_BYTES:
        return None
    chunks = _chunks(label.shape, dtype.itemsize)
    return (1, *chunks[1:]) if has_large_rows(label, dtype) else chunks


def create_dataset(file: h5py.File, name: str, label: Label, dtype: np.dtype[Any]) -> h5py.Dataset:
    """Creates a dataset to be filled; see `chunk_shape`. Large rows that are all the same are stored once."""
    alike = has_large_rows(label, dtype) and len(set(label.digests)) == 1
    shape, chunks, options = (1, *label.shape[1:]) if alike else label.shape, chunk_shape(label, dtype), {}
    if chunks is not None:
        options = {"chunks": chunks, "compression": "gzip", "compression_opts": COMPRESSION_LEVEL, "shuffle": True}
    dataset = file.create_dataset(name, shape, dtype, **options)
    said: dict[str, Attribute] = {"units": label.units, "axes": list(label.axes), "sha256": list(label.digests)}
    if label.description:
        said["description"] = label.description
    if label.scales is not None:
        said["scale"] = list(label.scales)
    set_attributes(dataset, said)
    return dataset


def write_dataset(file: h5py.File, name: str, label: Label, values: NDArray[Any]) -> None:
    """Creates a dataset and writes its values."""
    stored = text_in(values)
    dataset = create_dataset(file, name, label, stored.dtype)
    if stored.size:
        dataset[...] = stored[: dataset.shape[0]] if label.by_row else stored


def read_label(dataset: h5py.Dataset) -> Label:
    """Reads what is said about a dataset.

    Raises:
        ValueError: If it contradicts itself.
    """
    said: dict[str, Any] = get_attributes(dataset)
    digests, scales = tuple(said["sha256"]), said.get("scale")
    dtype = "str" if dataset.dtype.kind == "S" else dataset.dtype.str
    label = Label(
        dtype=dtype,
        shape=dataset.shape,
        units=said["units"],
        axes=tuple(said["axes"]),
        description=said.get("description", ""),
        scales=None if scales is None else tuple(scales),
        digests=digests,
    )
    if len(label.axes) != len(dataset.shape):
        raise ValueError(f"`{dataset.name}` has {len(dataset.shape)} axes, but {len(label.axes)} names of them")
    if not label.by_row:
        return label
    if dataset.shape[0] != len(digests) and (dataset.shape[0] != 1 or len(set(digests)) != 1):
        raise ValueError(f"`{dataset.name}` has {dataset.shape[0]} rows, but {len(digests)} hashes")
    return Label(**{**vars(label), "shape": (len(digests), *dataset.shape[1:])})


def read_values(dataset: h5py.Dataset, label: Label, row: int | None) -> NDArray[Any]:
    """Reads stored values: all, or those of one configuration, its axis kept."""
    if row is None or not label.by_row:
        values = text_out(np.asarray(dataset[()]))
        return values if values.shape == label.shape else np.repeat(values, label.shape[0], axis=0)
    at = row if dataset.shape[0] == label.shape[0] else 0
    return text_out(np.asarray(dataset[at : at + 1]))


def matches(label: Label, values: NDArray[Any]) -> bool:
    """Whether stored values are those that were hashed."""
    return digest_rows(values, label.axes) == label.digests


def find_datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    """Returns all datasets by path.

    Raises:
        ValueError: If one lies in another file, or there is no end of them.
    """
    return dict(datasets_in(file))


def _chunks(shape: Sequence[int], itemsize: int) -> tuple[int, ...]:
    """As many of the last axes as fit into a chunk, and as much of the next."""
    room, chunks = max(1, _CHUNK_BYTES // itemsize), []
    for size in reversed(shape):
        chunks.append(max(1, min(size, room)))
        room = max(1, room // chunks[-1])
    return tuple(reversed(chunks))


def text_in(values: NDArray[Any]) -> NDArray[Any]:
    """Values as they are stored: text of fixed length in UTF-8."""
    if values.dtype.kind != "U":
        return values
    encoded = np.char.encode(values, "utf-8")
    return encoded.astype(h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize)))


def text_out(values: NDArray[Any]) -> NDArray[Any]:
    """The inverse of `text_in`."""
    return np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values
