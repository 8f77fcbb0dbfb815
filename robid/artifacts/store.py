"""The store: writes artifacts at once, and refuses to read what is missing, damaged or unknown.

Layout of a file: datasets with the attributes `units`, `axes`, `sha256` of each row, and, where given, `description`
and `scale` of each row (stored values times scale are the values). A dataset whose first axis is the configuration has
a row per configuration, any other is one row; rows that are all the same may be stored once. The artifact's own
attributes lie on the group `attributes`; root attributes are `format`, `kind`, `schema_version`, `content_sha256` and
`provenance` (JSON). The content hash is made of the rows' hashes: one configuration can be read and checked alone.

Format history:
    1: one scale per dataset, and one hash over all content; without the attribute `format`.
    2: scale and hash of each row.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from robid.arrays import Meaning
from robid.artifacts.artifact import (
    Artifact,
    Attribute,
    Dataset,
    Kind,
    Label,
    Provenance,
    content_hash,
    decode,
    encode,
    normalise_attribute,
    read_provenance,
)
from robid.artifacts.atomic import replacing
from robid.artifacts.layout import (
    DAMAGE,
    create_file,
    find_datasets,
    get_attributes,
    has_large_rows,
    matches,
    read_label,
    read_values,
    set_attributes,
    write_dataset,
)
from robid.errors import ArtifactError
from robid.files import check_regular, open_regular
from robid.hdf5 import check_link

_FORMAT = "2"
_HEADER = ("kind", "schema_version", "content_sha256", "provenance")
_ATTRIBUTES = "attributes"
_FEW_TEXTS = 64
_MISMATCH = "its content does not match its hash"
_KEPT_OUTLINES = 64
_KEPT_BYTES = 2**20

Result = TypeVar("Result")
# Small outlines by what the system and the header say of a file: a run asks for each artifact several times, and for
# each of its configurations.
_outlines: dict[tuple[object, ...], Outline] = {}


@dataclass(frozen=True)
class DatasetDescription:
    """A dataset of an artifact, without its values."""

    shape: Annotated[tuple[int, ...], Meaning("Its length along each axis.")]
    dtype: Annotated[str, Meaning("Type of its values, `str` for text.")]
    stored_bytes: Annotated[int, Meaning("Room that it takes in the file [bytes].")]
    units: Annotated[str, Meaning("Unit of its values, `1` for none.")]
    axes: Annotated[tuple[str, ...], Meaning("Name of each axis.")]
    description: Annotated[str, Meaning("What it is.")]
    values: Annotated[list[Any] | None, Meaning("Its values, of short lists of text alone.")]


@dataclass(frozen=True)
class ArtifactDescription:
    """An artifact, without its arrays."""

    kind: Annotated[str, Meaning("Its kind, as `record`.")]
    schema_version: Annotated[str, Meaning("Version of the format of its kind.")]
    content_sha256: Annotated[str, Meaning("Hash of its content.")]
    attributes: Annotated[dict[str, Any], Meaning("Single values and short lists, by name; the unit is in the name.")]
    datasets: Annotated[dict[str, DatasetDescription], Meaning("Its arrays, by path.")]
    provenance: Annotated[Provenance, Meaning("How it came about.")]


@dataclass(frozen=True)
class Header:
    """What tells whether an artifact is fresh, read without its arrays."""

    kind: str
    version: str
    content_sha256: str
    provenance: Provenance


@dataclass(frozen=True)
class Outline:
    """What is in an artifact beside the rows of its configurations, checked against the content hash."""

    attributes: dict[str, Attribute]  # The artifact's own attributes
    labels: dict[str, Label]  # What is said about each dataset
    shared: dict[str, NDArray[Any]]  # Stored values of the datasets without rows

    @property
    def n_rows(self) -> int:
        """Number of configurations, 0 where nothing has rows."""
        return max((label.shape[0] for label in self.labels.values() if label.by_row), default=0)


def write_artifact(path: Path, artifact: Artifact, *, alone: bool = True) -> str:
    """Writes an artifact at once: a kill leaves the old file.

    Args:
        path: The file.
        artifact: What is in it.
        alone: Whether nobody else writes it now: a task that was given up may still be at work on another machine.

    Returns:
        Its content hash.

    Raises:
        ArtifactError: If the file cannot be written.
        ValueError: If an attribute is neither a scalar nor a list, or a dataset has a reserved name.
    """
    if _ATTRIBUTES in artifact.datasets:
        raise ValueError(f"No dataset may be named `{_ATTRIBUTES}`.")
    attributes = {name: normalise_attribute(name, value) for name, value in artifact.attributes.items()}
    encoded = {name: encode(dataset) for name, dataset in artifact.datasets.items()}
    digest = content_hash(artifact.kind.name, attributes, {name: label for name, (label, _) in encoded.items()})
    header = Header(artifact.kind.name, artifact.kind.version, digest, artifact.provenance)
    with replacing(path, alone=alone) as unfinished, create_file(unfinished) as file:
        write_header(file, header, attributes)
        for name in sorted(encoded):
            write_dataset(file, name, *encoded[name])
    return digest


def write_header(file: h5py.File, header: Header, attributes: Mapping[str, Attribute]) -> None:
    """Writes everything but the datasets."""
    provenance = json.dumps(asdict(header.provenance), sort_keys=True)
    values = (header.kind, header.version, header.content_sha256, provenance)
    set_attributes(file, {"format": _FORMAT, **dict(zip(_HEADER, values, strict=True))})
    set_attributes(file.create_group(_ATTRIBUTES), attributes)


def read_artifact(path: Path, kind: Kind, *, row: int | None = None, leave_out: Collection[str] = ()) -> Artifact:
    """Reads an artifact of a known kind.

    Args:
        path: The file.
        kind: The kind it must be of.
        row: Read this configuration alone, its axis kept; memory and time do not depend on how many there are.
        leave_out: Datasets not to read.

    Raises:
        ArtifactError: If the file is missing, damaged, of another kind or of an unknown version.
    """
    header, (attributes, datasets) = _read(path, kind, partial(_content, row=row, leave_out=leave_out))
    return Artifact(replace(kind, version=header.version), datasets, attributes, header.provenance)


def read_header(path: Path, kind: Kind | None = None) -> Header:
    """Reads what tells whether an artifact is fresh; see `read_artifact` for `kind` and errors."""
    return _read_header(path, kind, _identity(path))


def read_attributes(path: Path, kind: Kind) -> dict[str, Any]:
    """Reads an artifact's own attributes, their content unchecked; see `read_artifact` for errors."""
    return visit(path, kind, _own_attributes)


def kind_of(path: Path) -> str:
    """Returns the kind that a file says to be, of whatever version and however damaged; empty for another file."""
    try:
        check_regular(path)
        with h5py.File(path, "r") as file:
            return _plain_text(get_attributes(file).get("kind", ""))
    except DAMAGE:
        return ""


def read_outline(path: Path, kind: Kind) -> Outline:
    """Reads all that does not grow with the number of configurations; see `read_artifact` for errors."""
    return _read(path, kind, _outline)[1]


def check_artifact(path: Path, kind: Kind) -> None:
    """Reads an artifact one configuration at a time and compares it with its hash; see `read_artifact` for errors."""

    def check(file: h5py.File, header: Header) -> None:
        for name, label in _outline(file, header).labels.items():
            if not has_large_rows(label, file[name].dtype):
                _values(file, name, label)
                continue
            for row in range(file[name].shape[0]):
                _values(file, name, label, row)

    _read(path, kind, check)


def visit(path: Path, kind: Kind, read: Callable[[h5py.File], Result]) -> Result:
    """Applies a function to the file of an artifact, its content unchecked; see `read_artifact` for errors."""
    return _read(path, kind, lambda file, _: read(file))[1]


def read_group(path: Path, kind: Kind, group: str) -> Artifact:
    """Reads attributes and the datasets of one group, their content unchecked; see `read_artifact` for errors."""

    def read(file: h5py.File, _: Header) -> tuple[dict[str, Attribute], dict[str, Dataset]]:
        found = {f"{group}/{name}": (item, read_label(item)) for name, item in find_datasets(file[group]).items()}
        datasets = {name: decode(label, read_values(item, label, None)) for name, (item, label) in found.items()}
        return _own_attributes(file), datasets

    header, (attributes, datasets) = _read(path, kind, read)
    return Artifact(replace(kind, version=header.version), datasets, attributes, header.provenance)


def inspect_artifact(path: Path) -> ArtifactDescription:
    """Describes any artifact in plain values; of its arrays, short lists of texts. See `read_artifact` for errors."""
    header, (attributes, datasets) = _read(path, None, _description)
    return ArtifactDescription(
        header.kind, header.version, header.content_sha256, attributes, datasets, header.provenance
    )


def _read(path: Path, kind: Kind | None, read: Callable[[h5py.File, Header], Result]) -> tuple[Header, Result]:
    """Opens a file, checks its header, and applies `read` to it."""
    where = str(path)
    if not path.exists():
        raise missing(path, kind)
    if kind is None and not (path.is_file() and h5py.is_hdf5(path)):
        remedy = "name an .h5 file of a run folder"
        raise ArtifactError("A009 The file is not an artifact of robid.", where=where, remedy=remedy)
    try:
        check_regular(path)
        with h5py.File(path, "r") as file:
            said = get_attributes(file)
            name, version, digest, provenance = (_plain_text(said[key]) for key in _HEADER)
            header = Header(name, version, digest, read_provenance(provenance))
            found = str(said.get("format", "1"))
            if found != _FORMAT:
                what = f"A010 The artifact has file format {found}; this robid reads format {_FORMAT}."
                remedy = f"use the robid that wrote it, or delete it and make it again with {_command(kind)}"
                raise ArtifactError(what, where=where, remedy=remedy)
            if kind is not None:
                check_kind(path, kind, Kind(header.kind, header.version, ""))
            return header, read(file, header)
    except DAMAGE as error:
        raise damaged(path, kind, error) from error


def _command(kind: Kind | None) -> str:
    return f"`{kind.made_by if kind else 'robid run'} EXPERIMENT.yaml`"


def missing(path: Path, kind: Kind | None) -> ArtifactError:
    """What is said of an artifact that is not there."""
    return ArtifactError("A008 The artifact is missing.", where=str(path), remedy=f"{_command(kind)} makes it")


def damaged(path: Path, kind: Kind | None, error: Exception) -> ArtifactError:
    """What is said of an artifact that cannot be read."""
    remedy = f"delete it and make it again with {_command(kind)}"
    return ArtifactError(f"A013 The artifact is damaged: {error}.", where=str(path), remedy=remedy)


def _plain_text(value: object) -> str:
    """The text of a header, which a terminal can show."""
    text = str(value)
    if not text.isprintable():
        raise ValueError("its header contains bytes that are no text")
    return text


def _own_attributes(file: h5py.File) -> dict[str, Attribute]:
    check_link(_ATTRIBUTES, file, _ATTRIBUTES)
    return get_attributes(file[_ATTRIBUTES])


@lru_cache(maxsize=256)
def _read_header(path: Path, kind: Kind | None, _: tuple[object, ...]) -> Header:
    return _read(path, kind, lambda *_: None)[0]


def _identity(path: Path) -> tuple[object, ...]:
    """What the system says of a file; it differs when the file was written again."""
    try:
        # Opened, since a network's file system looks again when a file is opened, not when it is asked for.
        with open_regular(path) as file:
            status = os.fstat(file.fileno())
    except OSError:
        return ()
    return str(path), status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def check_kind(path: Path, kind: Kind, found: Kind) -> None:
    """Refuses a file of another kind or major version; see `read_artifact`."""
    if found.name != kind.name:
        what = f"A011 The file contains an artifact of kind `{found.name}`, but `{kind.name}` is needed."
        remedy = f"name another file; where it lies in the way of one that `{kind.made_by}` makes, move it away"
        raise ArtifactError(what, where=str(path), remedy=remedy)
    if found.major != kind.major:
        raise ArtifactError(
            f"A012 The artifact has schema version {found.version}; this robid reads {kind.major}.x of kind "
            f"`{kind.name}`.",
            where=str(path),
            remedy=f"use the robid that wrote it, or make it again with `{kind.made_by} EXPERIMENT.yaml --force`",
        )


def _outline(file: h5py.File, header: Header) -> Outline:
    key = (*_identity(Path(file.filename)), header.content_sha256)
    outline = _outlines.get(key) or _read_outline(file, header)
    if sum(values.nbytes for values in outline.shared.values()) <= _KEPT_BYTES:
        if len(_outlines) >= _KEPT_OUTLINES:
            _outlines.clear()
        _outlines[key] = outline
    return outline


def _read_outline(file: h5py.File, header: Header) -> Outline:
    labels = {name: read_label(dataset) for name, dataset in find_datasets(file).items()}
    attributes = _own_attributes(file)
    if content_hash(header.kind, attributes, labels) != header.content_sha256:
        raise ValueError(_MISMATCH)
    alone = {name: label for name, label in labels.items() if not label.by_row}
    return Outline(attributes, labels, {name: _values(file, name, label) for name, label in alone.items()})


def _values(file: h5py.File, name: str, label: Label, row: int | None = None) -> NDArray[Any]:
    values = read_values(file[name], label, row)
    if not matches(label if row is None else label.row(row), values):
        raise ValueError(_MISMATCH)
    return values


def _content(
    file: h5py.File, header: Header, *, row: int | None, leave_out: Collection[str]
) -> tuple[dict[str, Attribute], dict[str, Dataset]]:
    outline = _outline(file, header)
    if row is not None and not 0 <= row < outline.n_rows:
        raise IndexError(f"There is no row {row} of {outline.n_rows}.")
    datasets = {}
    for name, label in outline.labels.items():
        if name in leave_out:
            continue
        values = _values(file, name, label, row) if label.by_row else outline.shared[name].copy()
        datasets[name] = decode(label if row is None else label.row(row), values)
    return dict(outline.attributes), datasets


def _description(file: h5py.File, _: Header) -> tuple[dict[str, Attribute], dict[str, DatasetDescription]]:
    rows = {}
    for name, dataset in find_datasets(file).items():
        label = read_label(dataset)
        dtype = "str" if label.dtype == "str" else str(np.dtype(label.dtype))
        few = dtype == "str" and dataset.size <= _FEW_TEXTS
        rows[name] = DatasetDescription(
            shape=label.shape,
            dtype=dtype,
            stored_bytes=dataset.id.get_storage_size(),
            units=label.units,
            axes=label.axes,
            description=label.description,
            values=read_values(dataset, label, None).tolist() if few else None,
        )
    return _own_attributes(file), rows
