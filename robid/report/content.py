"""What a report is made of, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from rich.console import Group

from robid.report.parameters import ParameterRow
from robid.report.section import Section


@dataclass(frozen=True)
class Verdict:
    """The answer in one line.

    Attributes:
        text: One sentence.
        level: `ok` when the result can be used as it is, `warn` when the reader has to look closer, `bad` when it
            must not be used.
    """

    text: str
    level: Literal["ok", "warn", "bad"]


@dataclass(frozen=True)
class KeyNumber:
    """A number that a reader looks for first, with what it means.

    Attributes:
        label: What it is.
        value: The number, written out.
        detail: What stands behind it; may be empty.
    """

    label: str
    value: str
    detail: str = ""


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the page about one fit.

    Attributes:
        name: Name of the fit.
        numbers: The few numbers that decide whether it can be used.
        doubts: Everything that speaks against it with its likely cause, a clause each.
        status: How it ended.
        advice: What to do about it; empty when there is nothing to do.
    """

    name: str = ""
    numbers: tuple[KeyNumber, ...] = ()
    doubts: tuple[str, ...] = ()
    status: str = ""
    advice: str = ""


@dataclass(frozen=True)
class FitReport:
    """What one fit adds to page, terminal and summary; all that these know of its model.

    Attributes:
        headline: What stands at the top of the page.
        verdict: What the answer in one line says of it.
        grade: 2 to trust, 1 predicts but single parameters may be off, 0 not to be used; None where that is unknown.
        sections: Its sections; their anchors are unique among them.
        parameters: Its parameters.
        summary: Its numbers by dotted name.
        terminal: What the end of a run prints.
    """

    headline: Headline
    verdict: str
    grade: int | None
    sections: tuple[Section, ...]
    parameters: tuple[ParameterRow, ...] = ()
    summary: dict[str, float] = field(default_factory=dict)
    terminal: tuple[Group, ...] = ()


@dataclass(frozen=True)
class ReportContent:
    """All of a report.

    Attributes:
        title: Title of the page, usually the experiment's name.
        verdict: The answer in one line.
        robot: Name of the robot.
        headlines: What stands at the top about each fit, the most important first.
        warnings: What the reader must know before using a number.
        sections: Everything below.
    """

    title: str
    verdict: Verdict
    robot: str
    headlines: tuple[Headline, ...] = ()
    warnings: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()


def fit_sections(fits: tuple[FitReport, ...]) -> tuple[Section, ...]:
    """Puts the sections of all fits after each other, under their fit's name where there are several."""
    return tuple(
        Section(
            section.title,
            section.lead,
            section.parts,
            f"fit-{number}-{section.anchor}",
            fit.headline.name if len(fits) > 1 else "",
        )
        for number, fit in enumerate(fits, 1)
        for section in fit.sections
    )
