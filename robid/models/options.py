"""Options of an algorithm, declared once: default, what it is, its limits; settings and schema follow from that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any, TypeVar

Value = TypeVar("Value")


def option(default: Value, description: str, **limits: float) -> Value:
    """Declares an option as a field of a frozen dataclass.

    Args:
        default: Its default.
        description: What it is, a sentence.
        **limits: What a setting may be: `gt`, `ge`, `lt`, `le`.
    """
    declared: Any = field(default=default, metadata={"description": description, **limits})
    return declared  # type: ignore[no-any-return]


def group(kind: Callable[[], Value], description: str) -> Value:
    """Declares a group of options, each with its default, as a field of a frozen dataclass."""
    declared: Any = field(default_factory=kind, metadata={"description": description})
    return declared  # type: ignore[no-any-return]
