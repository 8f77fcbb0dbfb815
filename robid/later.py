"""Functions that are imported when they are called: a list of them costs nothing until one is."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class later:  # noqa: N801  stands where a function would
    """A function that is imported at its first call, as in `run=later("robid.pipeline.fit:run")`.

    Attributes:
        where: Module and name; a test finds each that is written in the package.
    """

    where: str

    def __call__(self, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
        """Imports the function and calls it."""
        module, _, name = self.where.partition(":")
        return getattr(import_module(module), name)(*arguments, **named)
