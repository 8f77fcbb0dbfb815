"""What a page is made of, its figures as data, and the one HTML file that needs nothing but a browser."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, is_dataclass, replace
from importlib import resources
from itertools import groupby
from typing import Annotated, Any, Literal

from markupsafe import Markup
from rich.console import Group

from robid.arrays import Meaning
from robid.report.charts import BodeMatrix, Heatmap, MovingArms, RatioChart, Skeletons, Waterfall, bode_data
from robid.report.numbers import rounded
from robid.report.parameters import ParameterRow
from robid.report.section import AnyFigure, Bars, Cell, Curve, Figure, Row, Section, Table
from robid.report.terms import Terms


@dataclass(frozen=True)
class Verdict:
    """The answer in one line."""

    text: Annotated[str, Meaning("One sentence.")]
    level: Annotated[
        Literal["ok", "warn", "bad"],
        Meaning(
            "`ok` when the result can be used as it is, `warn` when the reader has to look closer, `bad` when it must"
            " not be used."
        ),
    ]


@dataclass(frozen=True)
class KeyNumber:
    """A number that a reader looks for first, with what it means."""

    label: str  # what it is
    value: str  # the number, written out
    detail: str = ""  # what stands behind it; may be empty


@dataclass(frozen=True)
class Headline:
    """What stands at the top of the page about one fit."""

    name: str = ""  # name of the fit
    numbers: tuple[KeyNumber, ...] = ()  # the few numbers that decide whether it can be used
    findings: tuple[str, ...] = ()  # everything that speaks against it with its likely cause, a clause each
    status: str = ""  # how it ended
    advice: str = ""  # what to do about it; empty when there is nothing to do


@dataclass(frozen=True)
class Basis:
    """What a fit's grade rests on: its data, and its worst error on data that it never saw."""

    fitted: tuple[str, ...] = ()  # campaigns that it was fitted to
    validated: str = ""  # campaign that it was validated on; empty where none was
    error: str = ""  # its worst error there, with where; empty where that is unknown
    limit: str = ""  # from which error on the fit fails


@dataclass(frozen=True)
class FitReport:
    """What one fit adds to page, terminal and summary; all that these know of its model."""

    headline: Headline  # what stands at the top of the page
    verdict: str  # what the answer in one line says of it
    # 2 to trust, 1 predicts but single parameters may be off, 0 not to be used; None where that is unknown.
    grade: int | None
    sections: tuple[Section, ...]  # its sections; their anchors are unique among them
    parameters: tuple[ParameterRow, ...] = ()  # its parameters
    summary: dict[str, float] = field(default_factory=dict)  # its numbers by dotted name
    terminal: tuple[Group, ...] = ()  # what the end of a run prints
    basis: Basis = Basis()  # what its grade rests on


@dataclass(frozen=True)
class ReportContent:
    """All of a report."""

    title: str  # title of the page, usually the experiment's name
    verdict: Verdict  # the answer in one line
    robot: str  # name of the robot
    headlines: tuple[Headline, ...] = ()  # what stands at the top about each fit, the most important first
    warnings: tuple[str, ...] = ()  # what the reader must know before using a number
    sections: tuple[Section, ...] = ()  # everything below
    fits: Table | None = None  # the fits, a row each


def fit_sections(fits: tuple[FitReport, ...]) -> tuple[Section, ...]:
    """Puts the sections of all fits after each other, under their fit's name where there are several."""
    return tuple(
        replace(
            section, anchor=f"fit-{number}-{section.anchor}", group=f"Fit {fit.headline.name}" if len(fits) > 1 else ""
        )
        for number, fit in enumerate(fits, 1)
        for section in fit.sections
    )


_KINDS = {
    Figure: "curves",
    Bars: "bars",
    Skeletons: "skeletons",
    MovingArms: "motions",
    Waterfall: "waterfall",
    RatioChart: "ratios",
    Heatmap: "heatmap",
}


def figure_data(figure: AnyFigure) -> dict[str, Any]:
    """Gathers what the page draws of a figure; `kind` names the script that does it."""
    return bode_data(figure) if isinstance(figure, BodeMatrix) else {"kind": _KINDS[type(figure)], **_drawn(figure)}


def _drawn(value: Any) -> Any:  # noqa: ANN401
    """A figure as JSON knows it, numbers rounded; without title and caption, and of curves what they state alone."""
    if is_dataclass(value):
        parts = [(one, getattr(value, one.name)) for one in fields(value) if one.name not in ("title", "caption")]
        return {one.name: _drawn(part) for one, part in parts if not isinstance(value, Curve) or part != one.default}
    if isinstance(value, tuple):
        return [_drawn(each) for each in value]
    return value if value is None or isinstance(value, str | int) else rounded(value)


_OF_FIGURES = ("bode", "ratios", "curves", "bars", "skeletons", "motions", "waterfall", "heatmap")
_SCRIPTS = ("page", "choice", "quality", *_OF_FIGURES, "fitting")


def render(content: ReportContent) -> str:
    """Renders a report as one self-contained HTML page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # what pages are made of is needed without
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=PackageLoader("robid.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    drawn: list[dict[str, Any]] = []

    def number(figure: AnyFigure) -> int:
        """Keeps the data of a figure; they stand behind all sections."""
        drawn.append(figure_data(figure))
        return len(drawn) - 1

    return environment.get_template("page.html.j2").render(
        content=content,
        terms=Terms(content),
        sections=_numbered(content.sections),
        kind=lambda part: "Figure" if type(part) in _KINDS else type(part).__name__,
        number=number,
        body=_body,
        badges=_badges,
        style=Markup(_own("page.css")),
        scripts=[Markup(_own(f"{name}.js")) for name in _SCRIPTS],
        plotly=lambda: Markup(get_plotlyjs() if drawn else ""),
        # JSON that cannot end the script element it stands in.
        data=lambda: Markup(
            json.dumps({"figures": drawn}, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace(
                "<", "\\u003c"
            )
        ),
    )


def _numbered(sections: tuple[Section, ...]) -> list[tuple[str, list[tuple[str, Section]]]]:
    """Sections with their anchors, in runs of the same group."""
    named = [(section.anchor or f"section-{place}", section) for place, section in enumerate(sections, 1)]
    return [(group, list(members)) for group, members in groupby(named, key=lambda item: item[1].group)]


def _body(table: Table) -> list[tuple[str, list[tuple[int, Row]]]]:
    """Rows with their places, in runs of the same group."""
    rows = [(place, row if isinstance(row, Row) else Row(row)) for place, row in enumerate(table.rows)]
    return [(group, list(members)) for group, members in groupby(rows, key=lambda item: item[1].group)]


def _badges(table: Table) -> dict[str, str]:
    """What the letters before some cells mean."""
    cells = (cell for _, rows in _body(table) for _, row in rows for cell in row.cells if isinstance(cell, Cell))
    return {cell.badge: cell.hint for cell in cells if cell.badge}


def _own(name: str) -> str:
    return resources.files("robid.report").joinpath("templates", name).read_text("utf-8")
