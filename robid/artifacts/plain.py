"""Frozen dataclasses of plain values as JSON, and back by their type hints; infinite numbers are text."""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Instance = TypeVar("Instance", bound="DataclassInstance")


def to_plain(value: object) -> Any:  # noqa: ANN401
    """Turns a dataclass, arrays and containers of them included, into values that JSON knows."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
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
        return _value(next(member for member in get_args(hint) if member is not types.NoneType), content)
    if origin is np.ndarray:
        return np.array(content, dtype=float)
    if origin is tuple:
        return tuple(_value(get_args(hint)[0], item) for item in content)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return from_plain(hint, content)
    return float(content) if hint is float else content
