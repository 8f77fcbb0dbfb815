"""The mapping between a frozen dataclass of plain values and the datasets and attributes of an artifact.

Arrays and tuples become datasets, whose units and axes stand in a table; scalars become attributes, whose unit is part
of their name; a tuple of dataclasses becomes one dataset for each of their fields; None is left out. A field that a
file of an older minor version lacks gets its default.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.errors import ArtifactError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Instance = TypeVar("Instance", bound="DataclassInstance")


@dataclass(frozen=True)
class Column:
    """What the table says about one field; `compact` as in `robid.artifacts.artifact.Dataset`."""

    units: str
    axes: tuple[str, ...]
    description: str = ""
    compact: bool = False


def position_units(joint_units: tuple[str, ...] | None) -> str:
    """Unit of a dataset of joint positions."""
    return "rad" if joint_units is None else "rad; m"


def to_datasets(
    value: DataclassInstance, table: Mapping[str, Column], prefix: str = "", without: Collection[str] = ()
) -> tuple[dict[str, Dataset], dict[str, Attribute]]:
    """Takes a dataclass apart.

    Args:
        value: The dataclass; its fields are arrays, flat tuples, scalars, None, dataclasses of these, or tuples of
            dataclasses of scalars.
        table: Units and axes of each field that is an array or a tuple; `field/inner` in a nested dataclass. Of a tuple
            of dataclasses one entry serves all fields.
        prefix: What it lies below, such as `grade/`; the table's names begin with it.
        without: Fields that lie elsewhere.

    Raises:
        ValueError: If the table lacks a field or names one that is not there.
        TypeError: If a field is of another type.
    """
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {}
    absent: set[str] = set()
    for name, content in _flat(value, prefix, without):
        if isinstance(content, _Rows):
            datasets |= {f"{name}/{key}": _dataset(key, part, table[name]) for key, part in content.columns.items()}
        elif isinstance(content, np.ndarray | tuple):
            if name not in table:
                raise ValueError(f"The table lacks units and axes of `{type(value).__name__}.{name}`.")
            datasets[name] = _dataset(name, content, table[name])
        elif isinstance(content, bool | int | float | str | np.generic):
            attributes[name] = content.item() if isinstance(content, np.generic) else content
        elif content is None:
            absent.add(name)
        else:
            raise TypeError(f"`{type(value).__name__}.{name}` is a {type(content).__name__}, which has no place here.")
    written = {*datasets, *(name.rpartition("/")[0] for name in datasets)}
    unknown = [name for name in table if name not in written and absent.isdisjoint(_paths(name))]
    if unknown:
        raise ValueError(f"The table names {unknown}, which are no arrays of {type(value).__name__}.")
    return datasets, attributes


def from_datasets(
    cls: type[Instance], artifact: Artifact, prefix: str = "", given: Mapping[str, object] | None = None
) -> Instance:
    """Puts a dataclass together again, from what lies below a prefix such as `grade/`.

    Args:
        cls: The dataclass.
        artifact: Where it lies.
        prefix: What it lies below.
        given: Values of the fields that lie elsewhere.

    Raises:
        ArtifactError: If the artifact lacks a field that has no default and may not be None.
    """
    missing: list[str] = []
    instance = _build(cls, artifact, prefix, missing, given)
    if instance is None or missing:
        raise ArtifactError(
            f"The {artifact.kind.name} lacks {', '.join(missing)}.",
            remedy=f"make it again with `{artifact.kind.made_by} EXPERIMENT.yaml --force`",
        )
    return instance


@dataclass(frozen=True)
class _Rows:
    """A tuple of dataclasses, one column for each of their fields."""

    columns: dict[str, tuple[Any, ...]]


def _row_type(hint: object) -> type[DataclassInstance] | None:
    """The dataclass of which a field holds a tuple, if it does."""
    inner = get_args(hint)[0] if get_origin(hint) is tuple and get_args(hint) else None
    return inner if isinstance(inner, type) and dataclasses.is_dataclass(inner) else None


def _paths(name: str) -> list[str]:
    """A name and everything that it lies in: `a/b/c`, `a/b`, `a`."""
    parts = name.split("/")
    return ["/".join(parts[:count]) for count in range(1, len(parts) + 1)]


def _flat(value: DataclassInstance, prefix: str, without: Collection[str] = ()) -> Iterator[tuple[str, object]]:
    hints = get_type_hints(type(value))
    for field in dataclasses.fields(value):
        if field.name in without:
            continue
        content = getattr(value, field.name)
        row = _row_type(hints[field.name])
        if row is not None:
            names = [inner.name for inner in dataclasses.fields(row)]
            yield prefix + field.name, _Rows({name: tuple(getattr(one, name) for one in content) for name in names})
        elif dataclasses.is_dataclass(content) and not isinstance(content, type):
            yield from _flat(content, f"{prefix}{field.name}/")
        else:
            yield prefix + field.name, content


def _build(
    cls: type[Instance],
    artifact: Artifact,
    prefix: str,
    missing: list[str],
    given: Mapping[str, object] | None = None,
) -> Instance | None:
    hints = get_type_hints(cls)
    content: dict[str, Any] = dict(given or {})
    lacking = []
    for field in dataclasses.fields(cls):
        if field.name in content:
            continue
        path = prefix + field.name
        hint, optional = _without_none(hints[field.name])
        found = _find(hint, artifact, path, missing)
        if found is not None or optional:
            content[field.name] = found
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            lacking.append(path)
    missing += lacking
    return None if lacking else cls(**content)


def _find(hint: Any, artifact: Artifact, path: str, missing: list[str]) -> object:  # noqa: ANN401
    if path in artifact.datasets:
        values = artifact.datasets[path].values
        return tuple(values.tolist()) if get_origin(hint) is tuple else values
    if path in artifact.attributes:
        attribute = artifact.attributes[path]
        return float(attribute) if hint is float and isinstance(attribute, int) else attribute
    row = _row_type(hint)
    if row is not None:
        fields = dataclasses.fields(row)
        names = [field.name for field in fields if f"{path}/{field.name}" in artifact.datasets]
        if not names or any(field.name not in names and field.default is dataclasses.MISSING for field in fields):
            return None
        columns = (artifact.datasets[f"{path}/{name}"].values.tolist() for name in names)
        return tuple(row(**dict(zip(names, values, strict=True))) for values in zip(*columns, strict=True))
    if not (isinstance(hint, type) and dataclasses.is_dataclass(hint)):
        return None
    inside = any(name.startswith(f"{path}/") for name in (*artifact.datasets, *artifact.attributes))
    return _build(hint, artifact, f"{path}/", missing) if inside else None


def _dataset(name: str, content: np.ndarray[Any, Any] | tuple[Any, ...], column: Column) -> Dataset:
    values = np.asarray(content, dtype=str if isinstance(content, tuple) and not content else None)
    if isinstance(content, tuple) and (values.ndim != 1 or values.dtype.kind not in "biufU"):
        raise TypeError(f"`{name}` must be a flat tuple of strings or numbers.")
    return Dataset(values, column.units, column.axes, column.description, column.compact)


def _without_none(hint: object) -> tuple[object, bool]:
    if get_origin(hint) not in (Union, types.UnionType):
        return hint, False
    members = [member for member in get_args(hint) if member is not types.NoneType]
    return (members[0] if len(members) == 1 else hint), len(members) < len(get_args(hint))
