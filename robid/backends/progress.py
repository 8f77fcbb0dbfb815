"""Where a long computation tells how far it is."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Where a stage tells how far it is."""

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Says how many tasks there are, and how many of them an earlier run did."""

    def advance(self) -> None:
        """Says that one more is done."""

    def warn(self, text: str) -> None:
        """Tells what the user should know before using the result."""
