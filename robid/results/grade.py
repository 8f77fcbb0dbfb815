"""How far to trust a fitted model: three grades, what keeps it from a better one, and the likely causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from robid.arrays import BoolArray, FloatArray, Quantity
from robid.results.finding import CAUSES, Finding
from robid.results.scale import Scale
from robid.robot.parameters import FRICTION_KIND, INTEGRATOR_KIND

if TYPE_CHECKING:
    from robid.results.estimate import Estimate

_MOST = 4
TRUST, PREDICTS, DO_NOT_USE = 2, 1, 0
WORDS = {TRUST: "trust", PREDICTS: "predicts, but single parameters may be off", DO_NOT_USE: "do not use"}


@dataclass(frozen=True)
class Grade:
    """How far to trust a fitted model."""

    value: int  # 2 to trust, 1 predicts but single parameters may be off, 0 not to be used
    # What keeps it from a better grade, clauses without a full stop, the worst first
    reasons: Annotated[tuple[str, ...], Quantity("1", "reason", "What keeps it from a better grade")]
    # Likely cause of each finding, of `robid.results.finding.CAUSES`, the first to blame first
    causes: Annotated[tuple[str, ...], Quantity("1", "doubt", "Likely causes, the first to blame first")]
    messages: Annotated[tuple[str, ...], Quantity("1", "doubt", "What was seen of each")]
    decisive: Annotated[
        BoolArray, Quantity("1", "doubt", "Whether nothing that follows from the data may be used while it stands")
    ]
    strength: Annotated[FloatArray, Quantity("1", "doubt", "How far each is beyond what is normal")]
    sentence: str  # The grade, why it is no better, and the likeliest cause
    # Which wrong scales explain each finding; empty where none do so for any
    scales: tuple[tuple[Scale, ...], ...] = ()

    def fails(self, *, strict: bool) -> bool:
        """Whether a command that gives this grade exits with 5."""
        return self.value < (TRUST if strict else PREDICTS)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings, the first to blame first."""
        scales = self.scales or ((),) * len(self.causes)
        rows = zip(self.causes, self.messages, self.decisive.tolist(), self.strength.tolist(), scales, strict=True)
        return tuple(Finding(*row) for row in rows)


def grade_alone(unusable: Sequence[str], doubtful: Sequence[str], findings: Sequence[Finding]) -> Grade:
    """Grades a fit that was held against nothing but its own data: it predicts at best.

    Args:
        unusable: Why it must not be used, a clause each.
        doubtful: Why single parameters may be off by more than their intervals say, a clause each.
        findings: Findings about its data, its parameters and its residual, the first to blame first.
    """
    if unusable:
        return _made(DO_NOT_USE, unusable, findings)
    return _made(PREDICTS, ("it was not validated on data that the fit never saw", *doubtful), findings)


def grade_held(
    unusable: Sequence[str], doubtful: Sequence[str], findings: Sequence[Finding], left_out: Sequence[str] = ()
) -> Grade:
    """Grades a fit that was held against data that it never saw.

    Arguments are as of `grade_alone`; the parameters `left_out` of a trusted fit, by name, are none to trust.
    """
    if unusable:
        return _made(DO_NOT_USE, unusable, findings)
    grade = _made(PREDICTS if doubtful else TRUST, doubtful, findings)
    if grade.value < TRUST or not left_out:
        return grade
    named = ", ".join(left_out[:_MOST])
    more = f" and {len(left_out) - _MOST} more" if len(left_out) > _MOST else ""
    return replace(grade, sentence=f"{_upper(WORDS[TRUST])}, but for {named}{more}, which the data do not determine.")


def undetermined_names(estimate: Estimate) -> list[str]:
    """Names the parameters that the data do not determine and that nobody knew well enough beforehand."""
    relied = estimate.identified | estimate.known_beforehand
    rows = zip(estimate.names, estimate.kinds, relied.tolist(), strict=True)
    return [name for name, kind, known in rows if not known and kind not in (FRICTION_KIND, INTEGRATOR_KIND)]


def forbidding(findings: Sequence[Finding], status: str) -> tuple[str, ...]:
    """Returns why a fit that ended so must not be used by itself, a clause each."""
    found = [finding.message for finding in findings if finding.decisive]
    return (*found, *(() if status == "converged" else ("the fit has not converged",)))


def weakening(findings: Sequence[Finding]) -> tuple[str, ...]:
    """Returns why single parameters of a fit may be off, a clause each."""
    return tuple(finding.message for finding in findings if not finding.decisive and finding.strength > 1)


def ordered(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Leaves out what repeats a cause; a decisive finding takes the place of one that is not."""
    found: dict[str, Finding] = {}
    for finding in findings:
        before = found.setdefault(finding.cause, finding)
        if finding.decisive and not before.decisive:
            found[finding.cause] = finding
    return tuple(found.values())


def _made(value: int, reasons: Sequence[str], findings: Sequence[Finding]) -> Grade:
    return Grade(
        value=value,
        reasons=tuple(dict.fromkeys(reasons)),
        causes=tuple(finding.cause for finding in findings),
        messages=tuple(finding.message for finding in findings),
        decisive=np.array([finding.decisive for finding in findings], bool),
        strength=np.array([finding.strength for finding in findings], float),
        sentence=_sentence(value, tuple(dict.fromkeys(reasons)), findings),
        scales=tuple(finding.scales for finding in findings),
    )


def _upper(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}"


def _sentence(value: int, reasons: Sequence[str], findings: Sequence[Finding]) -> str:
    words = WORDS[value]
    told = f"{_upper(words)}{': ' if reasons else ''}{'; '.join(reasons)}."
    if value == TRUST or not findings:
        return told
    first = findings[0]
    return f"{told} Look first for {CAUSES[first.cause]}{'' if first.message in reasons else f': {first.message}'}."
