"""What an artifact is: datasets with units and axes, attributes, provenance, and the hash of its content."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Scalar: TypeAlias = bool | int | float | str
Attribute: TypeAlias = Scalar | list[bool] | list[int] | list[float] | list[str]


@dataclass(frozen=True)
class Kind:
    """A kind of artifact.

    Attributes:
        name: `record`, `frf`, ...
        version: Schema version `major.minor`: a reader refuses another major; a minor only adds fields.
        made_by: The command that makes it, for remedies.
    """

    name: str
    version: str
    made_by: str

    @property
    def major(self) -> str:
        """The part of the version that readers insist on."""
        return self.version.partition(".")[0]


@dataclass(frozen=True, eq=False)
class Dataset:
    """One array of an artifact.

    Attributes:
        values: Numbers, booleans or strings, of any shape.
        units: Unit of the values, `1` for none.
        axes: Name of each axis.
        description: What it holds.
        compact: Store float32 of `values / scale`, the scale a power of two not below `max|values|`.
            The rounding is 6e-8 of the largest value, and doing it again changes nothing.
    """

    values: NDArray[Any]
    units: str
    axes: tuple[str, ...]
    description: str = ""
    compact: bool = False

    def __post_init__(self) -> None:
        if len(self.axes) != self.values.ndim:
            raise ValueError(f"Axes {self.axes} do not name the {self.values.ndim} axes of shape {self.values.shape}.")
        if self.values.dtype.kind not in "biufcU":
            raise ValueError(f"An artifact cannot hold values of type {self.values.dtype}.")


@dataclass(frozen=True)
class Provenance:
    """How an artifact came about; never part of its content hash.

    Attributes:
        stage: The stage that made it.
        settings: Resolved settings that the stage read; no absolute paths.
        settings_hash: Their hash, see `robid.artifacts.provenance.canonical_hash`.
        inputs: Content hash of each input artifact or file, by name.
        seed: Seed of the task, or None.
        versions: Version of each package that matters.
        git_commit: Commit of the source tree, or "".
        started_utc: ISO 8601 time.
        finished_utc: ISO 8601 time.
    """

    stage: str
    settings: dict[str, Any] = field(default_factory=dict)
    settings_hash: str = ""
    inputs: dict[str, str] = field(default_factory=dict)
    seed: int | None = None
    versions: dict[str, str] = field(default_factory=dict)
    git_commit: str = ""
    started_utc: str = ""
    finished_utc: str = ""


@dataclass(frozen=True, eq=False)
class Artifact:
    """An artifact in memory.

    Attributes:
        kind: Its kind; after reading, with the version found in the file.
        datasets: Arrays by path, as in `response` or `starts/cost`.
        attributes: Scalars and short lists; the unit is part of the name.
        provenance: How it came about.
    """

    kind: Kind
    datasets: Mapping[str, Dataset]
    attributes: Mapping[str, Attribute]
    provenance: Provenance


@dataclass(frozen=True, eq=False)
class Stored:
    """A dataset as it lies in the file; this, and not what it stands for, is what is hashed."""

    values: NDArray[Any]
    units: str
    axes: tuple[str, ...]
    description: str
    scale: float | None


def encode(dataset: Dataset) -> Stored:
    """Turns a dataset into what is stored: little-endian, scaled where compact."""
    values, scale = np.ascontiguousarray(dataset.values).reshape(dataset.values.shape), None
    if dataset.compact:
        scale = _power_of_two(values)
        reduced = np.empty(values.shape, "<f4")
        values = np.divide(values, scale, out=reduced, casting="same_kind")
    elif values.dtype.kind != "U":
        values = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return Stored(values, dataset.units, dataset.axes, dataset.description, scale)


def decode(stored: Stored) -> Dataset:
    """The inverse of `encode`, up to its rounding."""
    values = stored.values
    if stored.scale is not None:
        values = values.astype(np.float64) * stored.scale
    return Dataset(values, stored.units, stored.axes, stored.description, compact=stored.scale is not None)


def content_hash(kind: str, attributes: Mapping[str, Attribute], datasets: Mapping[str, Stored]) -> str:
    """SHA-256 over the kind, the attributes, and each dataset's path, type, shape, units, axes, scale and bytes."""
    digest = hashlib.sha256(_canonical([kind, dict(attributes)]))
    for path in sorted(datasets):
        stored = datasets[path]
        values = stored.values
        text = values.dtype.kind == "U"
        dtype = "str" if text else values.dtype.str
        digest.update(_canonical([path, dtype, values.shape, stored.units, stored.axes, stored.scale]))
        digest.update(
            _canonical(values.tolist()) if text else np.ascontiguousarray(values).reshape(-1).view(np.uint8).data
        )
    return digest.hexdigest()


def normalise_attribute(name: str, value: object) -> Attribute:
    """Brings an attribute to the form in which it is read back.

    Raises:
        ValueError: If the value is neither a scalar nor a list of scalars of one type.
    """
    array = np.asarray(value)
    mixed = array.dtype.kind == "U" and not all(isinstance(item, str) for item in np.ravel(np.asarray(value, object)))
    if array.ndim > 1 or array.dtype.kind not in "biufU" or mixed:
        raise ValueError(f"Attribute `{name}` must be a scalar or a list of one type, but is {value!r}.")
    return str(value) if isinstance(value, str) else array.tolist()


def _power_of_two(values: NDArray[Any]) -> float:
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    return math.ldexp(1.0, min(math.frexp(largest)[1], 1023)) if largest > 0 else 1.0


def _canonical(value: object) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()
