"""Parts of an artifact, one per configuration, so that a killed stage resumes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from robid.artifacts.artifact import Artifact, Dataset, Kind, Label, Provenance, content_hash, encode
from robid.artifacts.atomic import check_folders, parts_of, remove_parts, replacing
from robid.artifacts.layout import create_dataset, create_file, has_large_rows, write_dataset
from robid.artifacts.part_file import Part, read_part, read_start, write_part
from robid.artifacts.store import Header, check_artifact, write_header
from robid.errors import ArtifactError

_NOTES = "notes"

Value = TypeVar("Value")


class Parts:
    """The folder `<artifact>.parts/`.

    Args:
        artifact: The artifact that the parts will be merged into.
        kind: Kind of the parts.
        key: Hash of everything that decides a part's content: settings and input hashes, see
            `robid.artifacts.artifact.canonical_hash`. Parts with another key are discarded.
    """

    def __init__(self, artifact: Path, kind: Kind, key: str) -> None:
        self._artifact = artifact
        self.folder = parts_of(artifact)
        self._kind = kind
        check_folders(artifact.parent, [self.folder / "part"])
        self._suffix = f".{key[:16]}.part"
        remove_parts(self.folder, keep=self._suffix)

    def has(self, index: int) -> bool:
        """Tells whether a part is there and sound; a damaged one is discarded."""
        path = self._path(index)
        if not path.exists():
            return False
        try:
            read_part(path, self._kind)
        except ArtifactError:
            path.unlink()
            return False
        return True

    def write(self, index: int, part: Artifact) -> None:
        """Writes one part at once."""
        write_part(self._path(index), part)

    def read(self, index: int) -> Artifact:
        """Reads one part; see `robid.artifacts.store.read_artifact` for errors."""
        return read_part(self._path(index), self._kind).to_artifact()

    def merge(self, count: int, provenance: Provenance) -> str:
        """Merges the parts 0 to `count - 1` into the artifact, one in memory at a time, and removes them.

        Compressed samples are copied as they are; all is read back before it takes the artifact's place.

        Returns:
            The artifact's content hash.

        Raises:
            ArtifactError: If a part is missing or damaged, or the artifact cannot be written.
            ValueError: If the parts differ in what does not depend on the configuration.
        """
        paths = [self._path(index) for index in range(count)]
        starts = [read_start(path, self._kind) for path in paths]
        attributes = _same("attributes", [start.attributes for start in starts])
        names = _same("datasets", [sorted(start.labels) for start in starts])
        labels = {name: _join(name, [start.labels[name] for start in starts]) for name in names}
        shared = dict(starts[0].stored)
        if _NOTES in shared:
            notes = dict.fromkeys(note for start in starts for note in start.stored[_NOTES].tolist())
            like, every = labels[_NOTES], np.array(list(notes), dtype=str)
            labels[_NOTES], shared[_NOTES] = encode(Dataset(every, like.units, like.axes, like.description))
        digest = content_hash(self._kind.name, attributes, labels)
        with replacing(self._artifact) as unfinished:
            with create_file(unfinished) as file:
                write_header(file, Header(self._kind.name, self._kind.version, digest, provenance), attributes)
                for name, values in shared.items():
                    write_dataset(file, name, labels[name], values)
                self._copy_rows(file, paths, {name: label for name, label in labels.items() if label.by_row})
            self._read_back(unfinished)
        remove_parts(self.folder)
        return digest

    def _copy_rows(self, file: h5py.File, paths: Sequence[Path], labels: Mapping[str, Label]) -> None:
        """Copies large rows as they come and those of small ones, which cost by the dataset, at the end."""
        # Kept open: closing a dataset empties its cache of chunks.
        large: dict[str, h5py.Dataset] = {}
        small: dict[str, list[NDArray[Any]]] = {}
        for index, path in enumerate(paths):
            part = self._sound(path)
            for name, label in labels.items():
                if label.dtype == "str" or not has_large_rows(label, np.dtype(label.dtype)):
                    small.setdefault(name, []).append(part.values(name))
                    continue
                if index == 0:
                    large[name] = create_dataset(file, name, label, np.dtype(label.dtype))
                if index < large[name].shape[0]:
                    _copy_row(part, name, large[name], index)
        for name, rows in small.items():
            write_dataset(file, name, labels[name], np.concatenate(rows))

    def _sound(self, path: Path) -> Part:
        try:
            return read_part(path, self._kind)
        except ArtifactError as error:
            raise self._not_sound() from error

    def _not_sound(self) -> ArtifactError:
        what = "A007 The parts did not merge into a sound artifact."
        return ArtifactError(what, where=str(self.folder), remedy="the same command makes damaged parts again")

    def _read_back(self, unfinished: Path) -> None:
        try:
            check_artifact(unfinished, self._kind)
        except ArtifactError as error:
            raise self._not_sound() from error

    def _path(self, index: int) -> Path:
        return self.folder / f"{index:05d}{self._suffix}"


def _copy_row(part: Part, name: str, target: h5py.Dataset, index: int) -> None:
    """Copies a large row, compressed as it is where it is in chunks."""
    if name not in part.chunks:
        target[index] = part.values(name)[0]
        return
    for start, content in zip(part.starts(name), part.chunks[name], strict=True):
        target.id.write_direct_chunk((index, *start[1:]), content)


def _join(name: str, labels: Sequence[Label]) -> Label:
    """The label of all rows together; of what has no rows the one that all have."""
    if not labels[0].by_row:
        return labels[0] if name == _NOTES else _same(f"`{name}`", labels)
    like = _same(f"`{name}`", [replace(label, scales=None, digests=()) for label in labels])
    scales = tuple(scale for label in labels for scale in label.scales or ())
    digests = tuple(digest for label in labels for digest in label.digests)
    return replace(like, shape=(len(digests), *like.shape[1:]), scales=scales or None, digests=digests)


def _same(what: str, values: Sequence[Value]) -> Value:
    if any(value != values[0] for value in values):
        raise ValueError(f"The {what} of the parts differ, but do not depend on the configuration.")
    return values[0]
