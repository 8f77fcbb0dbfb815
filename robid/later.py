"""What is imported when it is used: a list of references costs nothing until one is."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class later:  # noqa: N801  stands where a function would
    """A function or value that is imported when it is called or asked for, as in `run=later("robid.pipeline.fit:run")`.

    Attributes:
        where: Module and name; a test finds each that is written in the package.
    """

    where: str

    @property
    def value(self) -> Any:  # noqa: ANN401
        """What it stands for."""
        module, _, name = self.where.partition(":")
        return getattr(import_module(module), name)

    def __call__(self, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
        """Calls the function that it stands for."""
        return self.value(*arguments, **named)
