"""Functions that are imported when they are called, so that naming them costs no command its start."""

from __future__ import annotations

import builtins
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from types import SimpleNamespace
from typing import Any, TypeVar

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Later:
    """A function or value of a module that is imported when it is called or asked for."""

    module: str
    name: str

    @property
    def value(self) -> Any:  # noqa: ANN401
        """What the name stands for."""
        return getattr(import_module(self.module), self.name)

    def __call__(self, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
        """Calls it."""
        return self.value(*arguments, **named)


def imported(reference: _Value) -> _Value:
    """Returns what a name of a `with later` block stands for, importing its module; anything else as it is."""
    return reference.value if isinstance(reference, Later) else reference


@contextmanager
def later(importer: str) -> Iterator[None]:
    """Makes every `from module import function` of a `with` block one that imports with the first call.

    What Python 3.15 writes as `lazy from module import function`: types and layers are checked as of any other import,
    and a test calls for every name.

    Args:
        importer: `__name__` of the module that the block is in; imports of other modules and threads are as ever.
    """
    usual = builtins.__import__

    def deferred(
        name: str,
        globals: Mapping[str, object] | None = None,  # noqa: A002
        locals: Mapping[str, object] | None = None,  # noqa: A002
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> Any:  # noqa: ANN401
        if globals is None or globals.get("__name__") != importer or not fromlist:
            return usual(name, globals, locals, fromlist or (), level)
        return SimpleNamespace(**{one: Later(name, one) for one in fromlist})

    builtins.__import__ = deferred
    try:
        yield
    finally:
        builtins.__import__ = usual
