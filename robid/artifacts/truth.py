"""The true robot of a simulated campaign, a JSON file for which the record's attribute `truth_sha256` vouches."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import types
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from robid.artifacts.atomic import json_text, read_json, replacing
from robid.artifacts.kinds import RECORD
from robid.artifacts.store import read_outline
from robid.errors import ArtifactError
from robid.files import read_regular, read_regular_text
from robid.later import imported, later

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

with later(__name__):
    from robid.simulate.truth import TrueRobot


Instance = TypeVar("Instance", bound="DataclassInstance")


def to_plain(value: object) -> Any:  # noqa: ANN401
    """Turns a dataclass, arrays and containers of them included, into values that JSON knows."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        physical = (field.name for field in dataclasses.fields(value) if field.metadata.get("physical", True))
        return {name: to_plain(getattr(value, name)) for name in physical}
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def from_plain(cls: type[Instance], content: Mapping[str, Any]) -> Instance:
    """Puts a dataclass together from what `to_plain` made of it.

    Raises:
        KeyError: If a field without a default is missing.
        TypeError: If a value is of another type than its field.
    """
    hints = get_type_hints(cls)
    given = {}
    for field in dataclasses.fields(cls):
        if field.name in content:
            given[field.name] = _value(hints[field.name], content[field.name])
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise KeyError(field.name)
    return cls(**given)


def _value(hint: Any, content: Any) -> Any:  # noqa: ANN401
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        if content is None:
            return None
        return _value(_member([each for each in get_args(hint) if each is not types.NoneType], content), content)
    if origin is np.ndarray:
        return np.array(content, dtype=float)
    if origin is tuple:
        return tuple(_value(get_args(hint)[0], item) for item in content)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return from_plain(hint, content)
    return float(content) if hint is float else content


def _member(hints: list[Any], content: Any) -> Any:  # noqa: ANN401
    """The member of a union that the content is one of: of several dataclasses the one with all of its fields."""
    return next(
        (
            each
            for each in hints
            if dataclasses.is_dataclass(each) and {*content} <= {field.name for field in dataclasses.fields(each)}
        ),
        hints[0],
    )


_MAKER = "robid simulate-or-acquire EXPERIMENT.yaml"


def truth_sha256(truth: TrueRobot) -> str:
    """Returns the SHA-256 of the file that `write_truth` writes."""
    return hashlib.sha256(_text(truth)).hexdigest()


def write_truth(path: Path, truth: TrueRobot) -> None:
    """Writes a truth at once."""
    with replacing(path) as partial:
        partial.write_bytes(_text(truth))


def read_truth(path: Path, record: Path) -> TrueRobot:
    """Reads a truth that a record vouches for.

    Raises:
        ArtifactError: If it is missing, damaged, or not the one that the record was simulated with.
    """
    if not check_vouched(path, record):
        what = "A014 The record does not say which truth it was simulated with."
        remedy = f"`{_MAKER} --force` makes it again"
        raise ArtifactError(what, where=str(record), remedy=remedy)
    try:
        return from_plain(imported(TrueRobot), read_json(path, made_by=_MAKER))
    except (KeyError, TypeError, ValueError) as error:
        what = f"A015 The truth is not one of this version ({error})."
        remedy = f"`{_MAKER} --force` makes it again"
        raise ArtifactError(what, where=str(path), remedy=remedy) from error


def _text(truth: TrueRobot) -> bytes:
    return json_text(to_plain(truth)).encode()


def check_vouched(path: Path, record: Path) -> bool:
    """Refuses a truth that a record does not vouch for; tells whether the record says anything of its truth.

    Raises:
        ArtifactError: If it is missing, a folder, or not the one that the record was simulated with.
    """
    try:
        found = hashlib.sha256(read_regular(path)).hexdigest()
    except OSError as error:
        raise ArtifactError(
            f"A016 The truth cannot be read: {error.strerror or error}.", where=str(path), remedy=f"`{_MAKER}` makes it"
        ) from error
    stated = read_outline(record, RECORD).attributes.get("truth_sha256", "")
    if not stated:
        return False
    if found != stated:
        raise ArtifactError(
            f"A017 The truth is not the one that {record} was simulated with: it was edited, or belongs to another "
            "record.",
            where=str(path),
            remedy=f"delete it, then `robid run EXPERIMENT.yaml` (or `{_MAKER} --force`) makes it again",
        )
    return True


def is_truth(path: Path) -> bool:
    """Tells whether a file is the truth of some record."""
    try:
        found = json.loads(read_regular_text(path))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and {"robot", "truth", "imperfections", "seed"} <= found.keys()
