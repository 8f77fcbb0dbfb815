"""What a study found."""

from __future__ import annotations

from dataclasses import dataclass

from robid.report.page import Verdict
from robid.report.section import Section


@dataclass(frozen=True)
class Conclusion:
    """What a study found.

    Attributes:
        verdict: The answer.
        summary: Figures by dotted name.
        sections: Tables and figures of the page.
        warnings: What the reader must know before using a number.
    """

    verdict: Verdict
    summary: dict[str, float]
    sections: tuple[Section, ...]
    warnings: tuple[str, ...] = ()
