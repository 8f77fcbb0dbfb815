"""All fits of a page as one table: grade, worst error, and what these rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal

from robid.report.numbers import MISSING
from robid.report.page import FitReport
from robid.report.parameter_section import count_identified
from robid.report.section import Cell, ColumnStyle, Table
from robid.robot.parameters import FRICTION_KIND

_STYLES: tuple[ColumnStyle, ...] = ("name", "text", "text", "number", "number", "text", "text")
_LEAVES = ("Limit", "Identified", "Fitted to", "Validated on", "Worst error, new data")
_GRADES: Mapping[int | None, str] = MappingProxyType({2: "trust", 1: "predicts", 0: "do not use", None: "not graded"})
_MARKS: Mapping[int | None, Literal["", "good", "bad"]] = MappingProxyType({2: "good", 0: "bad"})


def fits_table(fits: Sequence[FitReport]) -> Table | None:
    """Tabulates the fits of a page; None without any."""
    if not fits:
        return None
    heads = ("Fit", "Grade", "Worst error, new data", "Limit", "Identified", "Fitted to", "Validated on")
    return Table(heads, tuple(_row(number, fit) for number, fit in enumerate(fits, 1)), styles=_STYLES, leaves=_LEAVES)


def _row(number: int, fit: FitReport) -> tuple[str | Cell, ...]:
    basis = fit.basis
    own = [row for row in fit.parameters if row.kind != FRICTION_KIND]
    first = f"#fit-{number}-{fit.sections[0].anchor}" if fit.sections else ""
    return (
        Cell(fit.headline.name, link=first),
        Cell(_GRADES[fit.grade], _MARKS.get(fit.grade, "")),
        basis.error or MISSING,
        basis.limit or MISSING,
        f"{count_identified(own)} of {len(own)}" if own else MISSING,
        ", ".join(basis.fitted) or MISSING,
        basis.validated or "not validated",
    )
