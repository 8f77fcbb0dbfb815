"""The file of one part: a header in JSON, the stored bytes of its datasets, and a hash of both.

Most of the time of a small HDF5 file goes into the labels of its datasets, and a part is read by one merge alone. Large
rows are filtered as HDF5 filters a chunk (bytes shuffled, then deflate), so that the merge copies them as they are.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.artifacts.artifact import Artifact, Attribute, Kind, Label, Provenance, decode, encode, normalise_attribute
from robid.artifacts.atomic import replacing
from robid.artifacts.layout import COMPRESSION_LEVEL, DAMAGE, chunk_shape, text_in, text_out
from robid.artifacts.store import check_kind, damaged, missing
from robid.files import open_regular

_MAGIC = b"robid part 1\n"
_LENGTH_BYTES, _HASH_BYTES = 8, 32


@dataclass(frozen=True)
class Part:
    """What is in a part's file, or of its datasets those without rows."""

    kind: Kind  # As it was when the part was written
    attributes: dict[str, Attribute]  # The artifact's own attributes
    labels: dict[str, Label]  # What is said about each dataset
    stored: dict[str, NDArray[Any]]  # Stored values of each dataset that is not in chunks
    chunks: dict[str, list[bytes]]  # Filtered chunks of each dataset that is, the last axis fastest

    def starts(self, name: str) -> Iterator[tuple[int, ...]]:
        """First index of each chunk of a dataset."""
        label = self.labels[name]
        return _starts(label.shape, _chunks(label))

    def values(self, name: str) -> NDArray[Any]:
        """Stored values of a dataset."""
        if name not in self.chunks:
            return self.stored[name]
        label, dtype = self.labels[name], np.dtype(self.labels[name].dtype)
        values = np.empty(label.shape, dtype)
        for start, content in zip(self.starts(name), self.chunks[name], strict=True):
            shuffled = np.frombuffer(zlib.decompress(content), np.uint8).reshape(dtype.itemsize, -1)
            chunk = np.ascontiguousarray(shuffled.T).view(dtype).reshape(_chunks(label))
            place = values[_box(start, _chunks(label))]
            place[...] = chunk[tuple(slice(size) for size in place.shape)]
        return values

    def to_artifact(self) -> Artifact:
        """The part as an artifact; it has no provenance."""
        datasets = {name: decode(label, self.values(name)) for name, label in self.labels.items()}
        return Artifact(self.kind, datasets, self.attributes, Provenance(stage=self.kind.made_by))


def write_part(path: Path, artifact: Artifact) -> None:
    """Writes a part at once; see `robid.artifacts.store.write_artifact` for errors."""
    attributes = {name: normalise_attribute(name, value) for name, value in artifact.attributes.items()}
    encoded = {name: encode(dataset) for name, dataset in artifact.datasets.items()}
    # Those without rows come first: a merge begins with them.
    names = sorted(encoded, key=lambda name: (encoded[name][0].by_row, name))
    contents = {name: _contents(*encoded[name]) for name in names}
    said = {
        "kind": asdict(artifact.kind),
        "attributes": attributes,
        "datasets": {
            name: {
                "label": asdict(encoded[name][0]),
                "dtype": text_in(encoded[name][1]).dtype.str,
                "bytes": [len(content) for content in contents[name]],
            }
            for name in names
        },
    }
    header = json.dumps(said).encode()
    body = b"".join(
        [_MAGIC, len(header).to_bytes(_LENGTH_BYTES, "little"), header, *itertools.chain(*contents.values())]
    )
    # A task that was given up may still be at work on another machine.
    with replacing(path, alone=False, lasting=False) as unfinished:
        unfinished.write_bytes(body + hashlib.sha256(body).digest())


def read_part(path: Path, kind: Kind) -> Part:
    """Reads and checks a part; see `robid.artifacts.store.read_artifact` for errors."""
    if not path.exists():
        raise missing(path, kind)
    try:
        with open_regular(path) as file:
            content = file.read()
        body = content[:-_HASH_BYTES]
        if hashlib.sha256(body).digest() != content[-_HASH_BYTES:]:
            raise ValueError("its content does not match its hash")
        part = _part(memoryview(body), rows=True)
    except DAMAGE as error:
        raise damaged(path, kind, error) from error
    check_kind(path, kind, part.kind)
    return part


def read_start(path: Path, kind: Kind) -> Part:
    """Reads what a part says and its datasets without rows, their content unchecked; see `read_part` for errors."""
    if not path.exists():
        raise missing(path, kind)
    try:
        with open_regular(path) as file:
            begun = file.read(len(_MAGIC) + _LENGTH_BYTES)
            header = file.read(int.from_bytes(begun[len(_MAGIC) :], "little"))
            shared = [each for each in json.loads(header)["datasets"].values() if not _label(each).by_row]
            part = _part(memoryview(begun + header + file.read(sum(sum(each["bytes"]) for each in shared))), rows=False)
    except DAMAGE as error:
        raise damaged(path, kind, error) from error
    check_kind(path, kind, part.kind)
    return part


def _part(body: memoryview, *, rows: bool) -> Part:
    """A part from its file's content, its datasets with rows left out where these are not there."""
    at = len(_MAGIC) + _LENGTH_BYTES
    if body[: len(_MAGIC)] != _MAGIC:
        raise ValueError("it is not a part")
    end = at + int.from_bytes(body[len(_MAGIC) : at], "little")
    said = json.loads(bytes(body[at:end]))
    labels = {name: _label(each) for name, each in said["datasets"].items()}
    part = Part(Kind(**said["kind"]), said["attributes"], labels, {}, {})
    for name, each in said["datasets"].items():
        if labels[name].by_row and not rows:
            break
        ends = [end, *(end + size for size in itertools.accumulate(each["bytes"]))]
        contents = [body[first:last] for first, last in itertools.pairwise(ends)]
        end = ends[-1]
        if _chunks(labels[name]):
            part.chunks[name] = [bytes(one) for one in contents]
        else:
            values = np.frombuffer(contents[0], np.dtype(each["dtype"])).reshape(labels[name].shape)
            part.stored[name] = text_out(values)
    return part


def _label(said: dict[str, Any]) -> Label:
    """A label as its JSON says it."""
    values: dict[str, Any] = said["label"]
    lists = ("shape", "axes", "scales", "digests")
    kept: dict[str, Any] = {
        key: tuple(value) if key in lists and value is not None else value for key, value in values.items()
    }
    return Label(**kept)


def _contents(label: Label, values: NDArray[Any]) -> list[bytes]:
    """Bytes of a dataset: all of it, or each filtered chunk."""
    stored, chunks = text_in(values), _chunks(label)
    return (
        [_filtered(stored, start, chunks) for start in _starts(label.shape, chunks)] if chunks else [stored.tobytes()]
    )


def _chunks(label: Label) -> tuple[int, ...]:
    """Chunks in which a merge stores the rows of a dataset; none where it stores their values."""
    return (chunk_shape(label, np.dtype(label.dtype)) or ()) if label.by_row and label.dtype != "str" else ()


def _filtered(values: NDArray[Any], start: Sequence[int], chunks: tuple[int, ...]) -> bytes:
    """A chunk as HDF5 stores it: filled up at the edges, its bytes shuffled, then deflated."""
    within = values[_box(start, chunks)]
    whole = np.zeros(chunks, values.dtype)
    whole[tuple(slice(size) for size in within.shape)] = within
    return zlib.compress(whole.view(np.uint8).reshape(-1, whole.itemsize).T.tobytes(), COMPRESSION_LEVEL)


def _starts(shape: Sequence[int], chunks: Sequence[int]) -> Iterator[tuple[int, ...]]:
    return itertools.product(*(range(0, size, step) for size, step in zip(shape, chunks, strict=True)))


def _box(start: Sequence[int], chunks: Sequence[int]) -> tuple[slice, ...]:
    return tuple(slice(first, first + size) for first, size in zip(start, chunks, strict=True))
