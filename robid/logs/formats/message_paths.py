"""Every number of a message by its path: `position[0]`, or `effort[elbow]` where the message names its numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

_LABELS = ("name", "names", "joint_names", "interface_names")
_LONGEST = 64
"""Lists of numbers that are longer, as of images and scans, have no columns."""


def field_of(value: Any, name: str) -> Any:  # noqa: ANN401
    """Returns a field of a message, None where there is none."""
    return value.get(name) if isinstance(value, Mapping) else getattr(value, name, None)


def labels_of(message: Any) -> Sequence[str]:  # noqa: ANN401
    """Returns the names, as of joints, that a message gives its lists of numbers."""
    return next((found for key in _LABELS if _is_text(found := field_of(message, key))), ())


def named_numbers(
    message: Any,  # noqa: ANN401
    keep: Callable[[str], bool],
    path: str = "",
    labels: Sequence[str] = (),
) -> Iterator[tuple[str, float]]:
    """Yields the path of every number in a message, and the number.

    Args:
        message: A message, or a part of one.
        keep: Whether something at or below a path is of interest.
        path: Path of the part.
        labels: Names of the numbers in a list of the same length.
    """
    fields = _fields(message)
    if fields is not None:
        labels = labels_of(message) or labels
        for name, inner in fields.items():
            below = f"{path}.{name}" if path else name
            if keep(below):
                yield from named_numbers(inner, keep, below, labels)
    elif isinstance(message, bool | int | float | np.number):
        yield path, float(message)
    elif isinstance(message, list | tuple | np.ndarray) and len(message) <= _LONGEST and not _is_text(message):
        items = message.tolist() if isinstance(message, np.ndarray) else message
        marks = [range(len(items)), labels] if len(labels) == len(items) else [range(len(items))]
        for mark, inner in ((mark, inner) for row in marks for mark, inner in zip(row, items, strict=True)):
            if keep(below := f"{path}[{mark}]"):
                yield from named_numbers(inner, keep, below)


def _fields(value: Any) -> dict[str, Any] | None:  # noqa: ANN401
    """The fields of a message, or None where it is none."""
    if isinstance(value, Mapping):
        return {str(key): one for key, one in value.items()}
    names = getattr(value, "__dataclass_fields__", None)
    return None if names is None else {name: getattr(value, name) for name in names if name != "__msgtype__"}


def _is_text(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, str) for one in value)
