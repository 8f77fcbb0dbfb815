"""The report: one HTML file that needs nothing but a browser."""

from __future__ import annotations

import json
import os
from importlib import resources
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from robid.report import numbers, summary, tables
from robid.report.content import ReportContent
from robid.report.figures import page_data

_SCRIPTS = ("page.js", "quality.js", "bode.js", "charts.js", "curves.js", "bars.js", "skeletons.js")


def write_report(path: Path, content: ReportContent) -> None:
    """Renders a report and puts it in place at once, so that a half-written page is never seen.

    Args:
        path: Where the page goes; its folder exists.
        content: What it shows.
    """
    partial = path.with_name(f"{path.name}.partial")
    partial.write_text(render(content), encoding="utf-8")
    os.replace(partial, path)  # noqa: PTH105


def render(content: ReportContent) -> str:
    """Renders a report as one self-contained HTML page."""
    environment = Environment(
        loader=PackageLoader("robid.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "percent": numbers.percent,
        "engineering": numbers.engineering,
        "significant": numbers.significant,
        "duration": numbers.duration,
        "unit": numbers.pretty_unit,
        "number": numbers.number_of,
        "degrees": _degrees,
    }
    return environment.get_template("page.html.j2").render(
        content=content,
        key_figures=summary.key_figures,
        tables=tables,
        style=Markup(_own("page.css")),
        scripts=[Markup(_own(name)) for name in _SCRIPTS],
        plotly=Markup(get_plotlyjs()),
        data=Markup(_script_json(page_data(content))),
    )


def _own(name: str) -> str:
    return resources.files("robid.report").joinpath("templates", name).read_text("utf-8")


def _script_json(value: object) -> str:
    """Writes JSON that cannot end the script element it stands in."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _degrees(angle_rad: float) -> str:
    written = f"{np.rad2deg(angle_rad):.1f}"
    return "0.0" if float(written) == 0 else written.replace("-", numbers.MINUS)
