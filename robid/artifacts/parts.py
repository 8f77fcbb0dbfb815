"""Parts of an artifact, one per configuration, so that a killed stage resumes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import h5py
import numpy as np

from robid.artifacts.artifact import Artifact, Dataset, Kind, Label, Provenance, content_hash, encode
from robid.artifacts.atomic import check_folders, parts_of, remove_parts, replacing
from robid.artifacts.layout import copy_row, create_dataset, create_file, write_dataset
from robid.artifacts.store import (
    Header,
    check_artifact,
    read_artifact,
    read_outline,
    visit,
    write_artifact,
    write_header,
)
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
        self._suffix = f".{key[:16]}.h5"
        remove_parts(self.folder, keep=self._suffix)

    def has(self, index: int) -> bool:
        """Tells whether a part is there and sound; a damaged one is discarded."""
        path = self._path(index)
        if not path.exists():
            return False
        try:
            check_artifact(path, self._kind)
        except ArtifactError:
            path.unlink()
            return False
        return True

    def write(self, index: int, part: Artifact) -> None:
        """Writes one part at once."""
        write_artifact(self._path(index), part, alone=False)

    def read(self, index: int) -> Artifact:
        """Reads one part; see `robid.artifacts.store.read_artifact` for errors."""
        return read_artifact(self._path(index), self._kind)

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
        outlines = [read_outline(path, self._kind) for path in paths]
        attributes = _same("attributes", [outline.attributes for outline in outlines])
        names = _same("datasets", [sorted(outline.labels) for outline in outlines])
        labels = {name: _join(name, [outline.labels[name] for outline in outlines]) for name in names}
        shared = dict(outlines[0].shared)
        if _NOTES in shared:
            notes = dict.fromkeys(note for outline in outlines for note in outline.shared[_NOTES].tolist())
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
        # Kept open: closing a dataset empties its cache of chunks.
        targets: dict[str, h5py.Dataset] = {}

        def copy(index: int, source: h5py.File) -> None:
            for name, label in labels.items():
                if index == 0:
                    targets[name] = create_dataset(file, name, label, source[name].dtype)
                if index < targets[name].shape[0]:
                    copy_row(source[name], targets[name], index)

        for index, path in enumerate(paths):
            visit(path, self._kind, partial(copy, index))

    def _read_back(self, unfinished: Path) -> None:
        try:
            check_artifact(unfinished, self._kind)
        except ArtifactError as error:
            what = "A007 The parts did not merge into a sound artifact."
            remedy = "the same command makes damaged parts again"
            raise ArtifactError(what, where=str(self.folder), remedy=remedy) from error

    def _path(self, index: int) -> Path:
        return self.folder / f"{index:05d}{self._suffix}"


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
