"""What every validation says, whatever the model's family."""

from __future__ import annotations

from dataclasses import dataclass

from robid.results.grade import Grade
from robid.results.recovery import Recovery


@dataclass(frozen=True)
class Outcome:
    """Whether a model held on data that its fit never saw.

    Attributes:
        ok: Whether the model may be used on data like these.
        verdict: The same in words, to follow "the model".
        grade: How far to trust the model.
        recovery: Its parameters against the true ones; empty for a real robot.
    """

    ok: bool
    verdict: str
    grade: Grade
    recovery: Recovery
