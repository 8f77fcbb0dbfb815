"""Settings as plain values, as stages hash them and artifacts keep them."""

from __future__ import annotations

from typing import Any


def plain_settings(settings: object) -> Any:  # noqa: ANN401
    """Returns a settings model, an options dataclass or a container of them as values that JSON knows."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(settings, by_alias=True)
