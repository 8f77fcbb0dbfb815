"""The report: one HTML file that needs nothing but a browser."""

from __future__ import annotations

import json
from importlib import resources
from itertools import groupby
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from robid.report.bode import BodeMatrix
from robid.report.content import ReportContent
from robid.report.figures import figure_data
from robid.report.section import AnyFigure, Beside, Cell, Choice, Folded, Notes, Part, Row, Section, Table

_SCRIPTS = (
    "page.js",
    "choice.js",
    "quality.js",
    "bode.js",
    "ratios.js",
    "curves.js",
    "bars.js",
    "skeletons.js",
    "waterfall.js",
)


def render(content: ReportContent) -> str:
    """Renders a report as one self-contained HTML page."""
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
        sections=_numbered(content.sections),
        kind=_kind,
        number=number,
        body=_body,
        badges=_badges,
        styles=_styles,
        style=Markup(_own("page.css")),
        scripts=[Markup(_own(name)) for name in _SCRIPTS],
        plotly=lambda: Markup(get_plotlyjs() if drawn else ""),
        data=lambda: Markup(_script_json({"figures": drawn})),
    )


def _numbered(sections: tuple[Section, ...]) -> list[tuple[str, list[tuple[str, Section]]]]:
    """Sections with their anchors, in runs of the same group."""
    named = [(section.anchor or f"section-{place}", section) for place, section in enumerate(sections, 1)]
    return [(group, list(members)) for group, members in groupby(named, key=lambda item: item[1].group)]


def _kind(part: Part) -> str:
    if isinstance(part, Table | Notes | Beside | Folded | Choice | BodeMatrix):
        return type(part).__name__
    return "Figure"


def _body(table: Table) -> list[tuple[str, list[tuple[int, Row]]]]:
    """Rows with their places, in runs of the same group."""
    rows = [(place, row if isinstance(row, Row) else Row(row)) for place, row in enumerate(table.rows)]
    return [(group, list(members)) for group, members in groupby(rows, key=lambda item: item[1].group)]


def _badges(table: Table) -> dict[str, str]:
    """What the letters before some cells mean."""
    cells = (cell for _, rows in _body(table) for _, row in rows for cell in row.cells if isinstance(cell, Cell))
    return {cell.badge: cell.hint for cell in cells if cell.badge}


def _styles(table: Table) -> tuple[str, ...]:
    """Style of each column; sentences or numbers behind the name where none is given."""
    if table.styles:
        return table.styles
    return ("name", *(("text" if table.prose else "number",) * (len(table.columns) - 1)))


def _own(name: str) -> str:
    return resources.files("robid.report").joinpath("templates", name).read_text("utf-8")


def _script_json(value: object) -> str:
    """Writes JSON that cannot end the script element it stands in."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
