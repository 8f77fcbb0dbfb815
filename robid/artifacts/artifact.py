"""What an artifact is: datasets with units and axes, attributes, the hash of its content, and provenance."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.arrays import Meaning
from robid.versions import package_versions as package_versions

Scalar: TypeAlias = bool | int | float | str
Attribute: TypeAlias = Scalar | list[bool] | list[int] | list[float] | list[str]
ROW_AXIS = ("configuration",)


@dataclass(frozen=True)
class Kind:
    """A kind of artifact, its schema version and the command that makes it, for remedies.

    A reader refuses another major version; a minor one only adds fields.
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
    """One array of an artifact."""

    values: NDArray[Any]  # Numbers, booleans or strings, of any shape
    units: str  # Unit of the values, `1` for none
    axes: tuple[str, ...]  # Name of each axis
    description: str = ""  # What it holds
    # Store float32 of `values / scale`, the scale of each row a power of two not below its `max|values|`. The rounding
    # is 6e-8 of the largest value, and doing it again changes nothing.
    compact: bool = False

    def __post_init__(self) -> None:
        if len(self.axes) != self.values.ndim:
            raise ValueError(f"Axes {self.axes} do not name the {self.values.ndim} axes of shape {self.values.shape}.")
        if self.values.dtype.kind not in "biufcU":
            raise ValueError(f"An artifact cannot hold values of type {self.values.dtype}.")


@dataclass(frozen=True)
class Provenance:
    """How an artifact came about; never part of its content hash."""

    stage: Annotated[str, Meaning("Command that made it.")]
    settings: Annotated[dict[str, Any], Meaning("Resolved settings that it read; no absolute paths.")] = field(
        default_factory=dict
    )
    # See `robid.artifacts.artifact.canonical_hash`.
    settings_hash: Annotated[str, Meaning("Their hash.")] = ""
    inputs: Annotated[dict[str, str], Meaning("Content hash of each input artifact or file, by name.")] = field(
        default_factory=dict
    )
    seed: Annotated[int | None, Meaning("Seed of what is random.")] = None
    versions: Annotated[dict[str, str], Meaning("Version of each package that matters.")] = field(default_factory=dict)
    git_commit: Annotated[str, Meaning("Commit of the source tree; empty outside of one.")] = ""
    started_utc: Annotated[str, Meaning("When it was begun, UTC.")] = ""
    finished_utc: Annotated[str, Meaning("When it was finished, UTC.")] = ""
    named: Annotated[list[str], Meaning("Inputs that the command line named in place of the run folder's.")] = field(
        default_factory=list
    )


def read_provenance(text: str) -> Provenance:
    """Reads what `json.dumps(asdict(provenance))` wrote, of a file that may be damaged.

    Raises:
        ValueError: If it is something else.
    """
    try:
        said = json.loads(text)
        text.encode()
        json.dumps(said, ensure_ascii=False).encode()
        found = Provenance(**said)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"its provenance cannot be read ({error})") from error
    named = all(isinstance(one, dict) for one in (found.settings, found.inputs, found.versions))
    if not (named and isinstance(found.named, list) and isinstance(found.seed, int | None)):
        raise ValueError("its provenance has values of other kinds")
    texts = (found.stage, found.settings_hash, found.git_commit, found.started_utc, found.finished_utc)
    if not all(
        isinstance(one, str) for one in (*texts, *found.named, *found.inputs.values(), *found.versions.values())
    ):
        raise ValueError("its provenance has values of other kinds")
    return found


@dataclass(frozen=True, eq=False)
class Artifact:
    """An artifact in memory."""

    kind: Kind  # Its kind; after reading, with the version found in the file
    datasets: Mapping[str, Dataset]  # Arrays by path, as in `response` or `starts/cost`
    attributes: Mapping[str, Attribute]  # Scalars and short lists; the unit is part of the name
    provenance: Provenance


@dataclass(frozen=True)
class Label:
    """All that a file says about a dataset; the content hash is made of these.

    A dataset whose first axis is the configuration has a row per configuration, any other is one row: what is scaled,
    hashed, stored and read at once.
    """

    dtype: str  # Type of the stored values, `str` for text
    shape: tuple[int, ...]
    units: str
    axes: tuple[str, ...]
    description: str  # What it holds; not part of the hash
    scales: tuple[float, ...] | None  # Scale of each row where the values are compact, else None
    digests: tuple[str, ...]  # SHA-256 of each row's stored bytes, of text as JSON

    @property
    def by_row(self) -> bool:
        """Whether there is a row per configuration."""
        return self.axes[:1] == ROW_AXIS

    def row(self, index: int) -> Label:
        """Returns what is said about one configuration, or about the whole where it has no rows."""
        if not self.by_row:
            return self
        scales = None if self.scales is None else (self.scales[index],)
        return replace(self, shape=(1, *self.shape[1:]), scales=scales, digests=(self.digests[index],))


def encode(dataset: Dataset) -> tuple[Label, NDArray[Any]]:
    """Turns a dataset into its label and what is stored: little-endian, scaled where compact."""
    values = np.ascontiguousarray(dataset.values).reshape(dataset.values.shape)
    scales = None
    if dataset.compact:
        scales = tuple(_power_of_two(row) for row in _rows(values, dataset.axes))
        reduced = np.empty(values.shape, "<f4")
        values = np.divide(values, _spread(scales, values.ndim), out=reduced, casting="same_kind")
    elif values.dtype.kind != "U":
        values = values.astype(values.dtype.newbyteorder("<"), copy=False)
    dtype = "str" if values.dtype.kind == "U" else values.dtype.str
    digests = digest_rows(values, dataset.axes)
    return Label(dtype, values.shape, dataset.units, dataset.axes, dataset.description, scales, digests), values


def decode(label: Label, values: NDArray[Any]) -> Dataset:
    """The inverse of `encode`, up to its rounding."""
    if label.scales is not None:
        values = np.asarray(np.multiply(values, _spread(label.scales, values.ndim), dtype=np.float64))
    return Dataset(values, label.units, label.axes, label.description, compact=label.scales is not None)


def digest_rows(values: NDArray[Any], axes: tuple[str, ...]) -> tuple[str, ...]:
    """SHA-256 of each row of stored values."""

    def stored(row: NDArray[Any]) -> bytes | memoryview:
        if row.dtype.kind == "U":
            return _canonical(row.tolist())
        return np.ascontiguousarray(row).reshape(-1).view(np.uint8).data

    return tuple(hashlib.sha256(stored(np.asarray(row))).hexdigest() for row in _rows(values, axes))


def content_hash(kind: str, attributes: Mapping[str, Attribute], labels: Mapping[str, Label]) -> str:
    """SHA-256 over the kind, the attributes, and each dataset's path, type, shape, units, axes, scales and digests."""
    said = {
        path: [label.dtype, label.shape, label.units, label.axes, label.scales, label.digests]
        for path, label in labels.items()
    }
    return hashlib.sha256(_canonical([kind, dict(attributes), said])).hexdigest()


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


def _rows(values: NDArray[Any], axes: tuple[str, ...]) -> NDArray[Any]:
    return values if axes[:1] == ROW_AXIS else values[None]


def _spread(scales: tuple[float, ...], n_axis: int) -> NDArray[np.float64]:
    """Shapes the scales of all rows, or of the one, so that they go with the values."""
    return np.reshape(scales, (-1,) + (1,) * (n_axis - 1)) if n_axis else np.asarray(scales[0])


def _power_of_two(values: NDArray[Any]) -> float:
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    return math.ldexp(1.0, min(math.frexp(largest)[1], 1023)) if largest > 0 else 1.0


def _canonical(value: object) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def canonical_hash(value: object) -> str:
    """SHA-256 of a plain value (mappings, lists, scalars), whatever the order of its keys."""
    return hashlib.sha256(_canonical(value)).hexdigest()


def git_commit() -> str:
    """Commit of robid's source tree, with `+` where files differ from it; "" outside a checkout."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    commit = _git(root, "rev-parse", "HEAD")
    return commit + ("+" if commit and _git(root, "status", "--porcelain", "--untracked-files=no") else "")


def utc_now() -> str:
    """The time, as provenance records it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
