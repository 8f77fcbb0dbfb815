"""The store: writes artifacts at once, and refuses to read what is missing, damaged or unknown.

Layout of a file: datasets with the attributes `units`, `axes`, and, where given, `description` and `scale` (stored
values times scale are the values); the artifact's own attributes on the group `attributes`; root attributes `kind`,
`schema_version`, `content_sha256` and `provenance` (JSON). Text is of fixed length and the file format 1.10: HDF5 then
checks headers and text by checksums, where damaged strings of variable length can make it loop for ever.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from robid.artifacts.artifact import (
    Artifact,
    Attribute,
    Kind,
    Provenance,
    Stored,
    content_hash,
    decode,
    encode,
    normalise_attribute,
)
from robid.artifacts.atomic import replacing
from robid.errors import ArtifactError

_HEADER = ("kind", "schema_version", "content_sha256", "provenance")
_ATTRIBUTES = "attributes"
_CHUNK_BYTES = 1 << 16
# What h5py raises on damaged files, seen by flipping bytes.
_DAMAGE = (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, OverflowError, MemoryError)

Result = TypeVar("Result")


@dataclass(frozen=True)
class Header:
    """What tells whether an artifact is fresh, read without its arrays."""

    kind: str
    version: str
    content_sha256: str
    provenance: Provenance


def write_artifact(path: Path, artifact: Artifact) -> str:
    """Writes an artifact at once: a kill leaves the old file.

    Returns:
        Its content hash.

    Raises:
        ArtifactError: If the file cannot be written.
        ValueError: If an attribute is neither a scalar nor a list, or a dataset has a reserved name.
    """
    if _ATTRIBUTES in artifact.datasets:
        raise ValueError(f"No dataset may be named `{_ATTRIBUTES}`.")
    attributes = {name: normalise_attribute(name, value) for name, value in artifact.attributes.items()}
    datasets = {name: encode(dataset) for name, dataset in artifact.datasets.items()}
    digest = content_hash(artifact.kind.name, attributes, datasets)
    # Built in memory: HDF5 reports a full disk late, and not as one error.
    with h5py.File(path.name, "w", driver="core", backing_store=False, libver=("v110", "v110")) as file:
        for name in sorted(datasets):
            _write_dataset(file, name, datasets[name])
        _set(file.create_group(_ATTRIBUTES), attributes)
        provenance = json.dumps(asdict(artifact.provenance), sort_keys=True)
        header = (artifact.kind.name, artifact.kind.version, digest, provenance)
        _set(file, dict(zip(_HEADER, header, strict=True)))
        file.flush()
        image = file.id.get_file_image()
    with replacing(path) as partial:
        partial.write_bytes(image)
    return digest


def read_artifact(path: Path, kind: Kind, *, verify: bool = True) -> Artifact:
    """Reads an artifact of a known kind.

    Args:
        path: The file.
        kind: The kind it must be of.
        verify: Compare the content with its hash.

    Raises:
        ArtifactError: If the file is missing, damaged, of another kind or of an unknown major version.
    """
    header, (attributes, stored) = _read(path, kind, _content)
    if verify and content_hash(header.kind, attributes, stored) != header.content_sha256:
        raise _damaged(path, kind, "its content does not match its hash")
    datasets = {name: decode(dataset) for name, dataset in stored.items()}
    return Artifact(replace(kind, version=header.version), datasets, attributes, header.provenance)


def read_header(path: Path, kind: Kind | None = None) -> Header:
    """Reads what tells whether an artifact is fresh; see `read_artifact` for `kind` and errors."""
    return _read(path, kind, lambda _: None)[0]


def inspect_artifact(path: Path) -> dict[str, Any]:
    """Describes any artifact in plain values, without loading its arrays; see `read_artifact` for errors."""
    header, (attributes, datasets) = _read(path, None, _description)
    return {
        "kind": header.kind,
        "schema_version": header.version,
        "content_sha256": header.content_sha256,
        "attributes": attributes,
        "datasets": datasets,
        "provenance": asdict(header.provenance),
    }


def _write_dataset(file: h5py.File, name: str, stored: Stored) -> None:
    values = stored.values
    options: dict[str, Any] = {}
    if values.nbytes > _CHUNK_BYTES:
        rows = min(values.shape[0], 1 + _CHUNK_BYTES * values.shape[0] // (values.nbytes + 1))
        options = {"chunks": (rows, *values.shape[1:]), "compression": "gzip", "compression_opts": 1, "shuffle": True}
    dataset = file.create_dataset(name, data=_text_in(values), **options)
    _set(dataset, {"units": stored.units, "axes": list(stored.axes)})
    if stored.description:
        _set(dataset, {"description": stored.description})
    if stored.scale is not None:
        _set(dataset, {"scale": stored.scale})


def _set(item: h5py.Group | h5py.Dataset, values: Mapping[str, Attribute]) -> None:
    for name, value in values.items():
        item.attrs[name] = _text_in(np.asarray(value))


def _get(item: h5py.Group | h5py.Dataset) -> dict[str, Attribute]:
    return {
        name: normalise_attribute(name, _text_out(np.asarray(value)).tolist()) for name, value in item.attrs.items()
    }


def _text_in(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind != "U":
        return values
    encoded = np.char.encode(values, "utf-8")
    return encoded.astype(h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize)))


def _text_out(values: NDArray[Any]) -> NDArray[Any]:
    return np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values


def _read(path: Path, kind: Kind | None, read: Callable[[h5py.File], Result]) -> tuple[Header, Result]:
    """Opens a file, checks its header, and applies `read` to it."""
    if not path.exists():
        command = kind.made_by if kind else "robid run"
        raise ArtifactError("The artifact is missing.", where=str(path), remedy=f"`{command} EXPERIMENT.yaml` makes it")
    if kind is None and not h5py.is_hdf5(path):
        raise ArtifactError(
            "The file is not an artifact of robid.", where=str(path), remedy="name an .h5 file of a run folder"
        )
    try:
        with h5py.File(path, "r") as file:
            header = _header(file)
            if kind is not None:
                _check_kind(path, kind, header)
            return header, read(file)
    except _DAMAGE as error:
        raise _damaged(path, kind, str(error)) from error


def _header(file: h5py.File) -> Header:
    attributes = _get(file)
    kind, version, digest, provenance = (str(attributes[name]) for name in _HEADER)
    return Header(kind, version, digest, Provenance(**json.loads(provenance)))


def _check_kind(path: Path, kind: Kind, header: Header) -> None:
    if header.kind != kind.name:
        raise ArtifactError(
            f"The file holds an artifact of kind `{header.kind}`, but `{kind.name}` is needed.",
            where=str(path),
            remedy=f"name another file, or make this one with `{kind.made_by} EXPERIMENT.yaml --force`",
        )
    major = header.version.partition(".")[0]
    if major != kind.major:
        raise ArtifactError(
            f"The artifact has schema version {header.version}; this robid reads {kind.major}.x of kind `{kind.name}`.",
            where=str(path),
            remedy=f"use the robid that wrote it, or make it again with `{kind.made_by} EXPERIMENT.yaml --force`",
        )


def _content(file: h5py.File) -> tuple[dict[str, Attribute], dict[str, Stored]]:
    return _get(file[_ATTRIBUTES]), {name: _read_dataset(dataset) for name, dataset in _datasets(file).items()}


def _read_dataset(dataset: h5py.Dataset) -> Stored:
    said: dict[str, Any] = _get(dataset)
    values = _text_out(np.asarray(dataset[()]))
    return Stored(values, said["units"], tuple(said["axes"]), said.get("description", ""), said.get("scale"))


def _description(file: h5py.File) -> tuple[dict[str, Attribute], dict[str, dict[str, Any]]]:
    rows = {}
    for name, dataset in _datasets(file).items():
        dtype = "str" if dataset.dtype.kind == "S" else str(dataset.dtype)
        rows[name] = {"shape": list(dataset.shape), "dtype": dtype, "stored_bytes": dataset.id.get_storage_size()}
        rows[name] |= _get(dataset)
    return _get(file[_ATTRIBUTES]), rows


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    found: dict[str, h5py.Dataset] = {}

    def collect(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item

    file.visititems(collect)
    return found


def _damaged(path: Path, kind: Kind | None, why: str) -> ArtifactError:
    command = kind.made_by if kind else "robid run"
    return ArtifactError(
        f"The artifact is damaged: {why}.",
        where=str(path),
        remedy=f"delete it and make it again with `{command} EXPERIMENT.yaml`",
    )
