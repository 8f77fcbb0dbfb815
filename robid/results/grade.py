"""How far to trust a fitted model: three grades, what keeps it from a better one, and the likely causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, FloatArray, Quantity
from robid.results.doubt import CAUSES, Doubt
from robid.results.scale import Scale

TRUST, PREDICTS, DO_NOT_USE = 2, 1, 0
WORDS = {TRUST: "trust", PREDICTS: "predicts, but single parameters may be off", DO_NOT_USE: "do not use"}


@dataclass(frozen=True)
class Grade:
    """How far to trust a fitted model.

    Attributes:
        value: 2 to trust, 1 predicts but single parameters may be off, 0 not to be used.
        reasons: What keeps it from a better grade, clauses without a full stop, the worst first.
        causes: Likely cause of each doubt, of `robid.results.doubt.CAUSES`, the first to blame first.
        sentence: The grade, why it is no better, and the likeliest cause.
        scales: Which wrong scales explain each doubt; empty where none do so for any.
    """

    value: int
    reasons: Annotated[tuple[str, ...], Quantity("1", "reason", "What keeps it from a better grade")]
    causes: Annotated[tuple[str, ...], Quantity("1", "doubt", "Likely causes, the first to blame first")]
    messages: Annotated[tuple[str, ...], Quantity("1", "doubt", "What was seen of each")]
    decisive: Annotated[
        BoolArray, Quantity("1", "doubt", "Whether nothing that follows from the data may be used while it stands")
    ]
    strength: Annotated[FloatArray, Quantity("1", "doubt", "How far each is beyond what is normal")]
    sentence: str
    scales: tuple[tuple[Scale, ...], ...] = ()

    def fails(self, *, strict: bool) -> bool:
        """Whether a command that gives this grade exits with 5."""
        return self.value < (TRUST if strict else PREDICTS)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """The doubts, the first to blame first."""
        scales = self.scales or ((),) * len(self.causes)
        rows = zip(self.causes, self.messages, self.decisive.tolist(), self.strength.tolist(), scales, strict=True)
        return tuple(Doubt(*row) for row in rows)


def grade_alone(unusable: Sequence[str], doubtful: Sequence[str], doubts: Sequence[Doubt]) -> Grade:
    """Grades a fit that was held against nothing but its own data: it predicts at best.

    Args:
        unusable: Why it must not be used, a clause each.
        doubtful: Why single parameters may be off by more than their intervals say, a clause each.
        doubts: Doubts about its data, its parameters and its residual, the first to blame first.
    """
    if unusable:
        return _made(DO_NOT_USE, unusable, doubts)
    return _made(PREDICTS, ("it was not held against data that the fit never saw", *doubtful), doubts)


def grade_held(unusable: Sequence[str], doubtful: Sequence[str], doubts: Sequence[Doubt]) -> Grade:
    """Grades a fit that was held against data that it never saw; arguments as of `grade_alone`."""
    if unusable:
        return _made(DO_NOT_USE, unusable, doubts)
    return _made(PREDICTS if doubtful else TRUST, doubtful, doubts)


def forbidding(doubts: Sequence[Doubt], status: str) -> tuple[str, ...]:
    """Returns why a fit that ended so must not be used by itself, a clause each."""
    found = [doubt.message for doubt in doubts if doubt.decisive]
    return (*found, *(() if status == "converged" else ("the fit has not converged",)))


def weakening(doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """Returns why single parameters of a fit may be off, a clause each."""
    return tuple(doubt.message for doubt in doubts if not doubt.decisive and doubt.strength > 1)


def ordered(doubts: Sequence[Doubt]) -> tuple[Doubt, ...]:
    """Leaves out what repeats a cause; a decisive doubt takes the place of one that is not."""
    found: dict[str, Doubt] = {}
    for doubt in doubts:
        before = found.setdefault(doubt.cause, doubt)
        if doubt.decisive and not before.decisive:
            found[doubt.cause] = doubt
    return tuple(found.values())


def _made(value: int, reasons: Sequence[str], doubts: Sequence[Doubt]) -> Grade:
    return Grade(
        value=value,
        reasons=tuple(dict.fromkeys(reasons)),
        causes=tuple(doubt.cause for doubt in doubts),
        messages=tuple(doubt.message for doubt in doubts),
        decisive=np.array([doubt.decisive for doubt in doubts], bool),
        strength=np.array([doubt.strength for doubt in doubts], float),
        sentence=_sentence(value, tuple(dict.fromkeys(reasons)), doubts),
        scales=tuple(doubt.scales for doubt in doubts),
    )


def _sentence(value: int, reasons: Sequence[str], doubts: Sequence[Doubt]) -> str:
    words = WORDS[value]
    told = f"{words[0].upper()}{words[1:]}{': ' if reasons else ''}{'; '.join(reasons)}."
    if value == TRUST or not doubts:
        return told
    first = doubts[0]
    return f"{told} Look first for {CAUSES[first.cause]}{'' if first.message in reasons else f': {first.message}'}."
