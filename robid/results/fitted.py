"""A fit from values in memory, whatever its kind: what it found, and what its grade rests on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robid.results.estimate import Estimate
from robid.results.finding import Finding
from robid.results.grade import Grade

UNGRADED = "not graded: the fit was not validated on data that it never saw; give some as `validate_on`"
"""What is said of a fit that nothing validated."""


@dataclass(frozen=True)
class Fitted:
    """A model that was fitted to values in memory."""

    kind: str  # Kind of model, as `elastic`
    estimate: Estimate  # Its parameters
    solution: Any  # All that the fit found, as its kind has it
    alone: Grade  # What it is worth by its own data: `predicts` at best
    validation: Any = None  # How it holds on data that it never saw, as its kind has it; None without such data
    held: Grade | None = None  # Its grade with them; None without such data

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What speaks against it, the first to blame first."""
        return (self.held or self.alone).findings

    @property
    def sentence(self) -> str:
        """The grade, and why it is no better; without validation data, that there is none."""
        if self.held is not None:
            return self.held.sentence
        return UNGRADED if self.alone.value else f"{UNGRADED}; by its own data: {self.alone.sentence}"
