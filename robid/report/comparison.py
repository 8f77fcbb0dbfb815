"""A page that lays responses over each other, and says where they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.frf.comparison import LEVEL, Comparison, ElementDifference
from robid.frf.frf import Frf
from robid.report.charts import BodeMatrix, BodeResponse, Overlay, band_radius, configuration_label
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import ReportContent, Verdict
from robid.report.responses import named_by_quantity, quantity_title, shown_unit
from robid.report.section import Cell, ColumnStyle, Notes, Part, Row, Section, Table

_NOTHING = 1e-9
_LEAD = (
    "Every column is one input, every row one output; select an element to enlarge it. The uncertainty of each response"
    " is shaded in its colour."
)
_NUMBERS: tuple[ColumnStyle, ...] = ("number",) * 7
_STYLES: tuple[ColumnStyle, ...] = ("name", *_NUMBERS, "text")
COLUMNS = ("Element", "Lines", "Magnitude", "Phase", "Difference", "Within band", "Square / variance", "Limit", "")
"""Heads of the columns about an element."""

CAPTION = (
    "Magnitude, phase and difference: median over the lines, of the second against the first. Within band: share of the"
    " lines whose difference is within the band that both uncertainties make; 95 % where they agree. Square /"
    " variance: mean square of the difference over the sum of both variances; some element is above its limit in one of"
    " twenty comparisons of responses that are the same. Records that share data agree better than that; what both have"
    " wrong alike is in no band."
)
"""What the columns mean."""

_HOW = {
    "common": "at {count} common lines",
    "first": "at {count} lines of the second, to which the first is interpolated",
    "second": "at {count} lines of the first, to which the second is interpolated",
}


@dataclass(frozen=True)
class Compared:
    """A response and how it compares with the first."""

    label: str  # its name
    frf: Frf  # the response
    comparison: Comparison  # the comparison


def comparison_content(label: str, first: Frf, others: Sequence[Compared]) -> ReportContent:
    """Lays out the page: all responses over each other, then each against the first."""
    names = [label, *(other.label for other in others)]
    agree = [other.comparison.agree for other in others]
    return ReportContent(
        title=" against ".join(names) if len(names) <= 2 else f"{len(names)} responses",
        verdict=Verdict(comparison_verdict(label, others), "ok" if all(agree) else "warn"),
        robot=", ".join(names),
        sections=(_overlay_section(label, first, others), *(_section(label, first, other) for other in others)),
    )


def comparison_verdict(label: str, others: Sequence[Compared]) -> str:
    """Says of each whether it agrees with the first."""
    return " ".join(f"{other.label} {_agreement(other.comparison)} {label}." for other in others)


def comparison_place(comparison: Comparison) -> str:
    """Says where two responses were compared."""
    aligned = comparison.aligned
    low, high = aligned.frequency_hz[[0, -1]].tolist()
    told = _HOW[aligned.how].format(count=len(aligned.frequency_hz))
    pairs = f", in {len(aligned.pairs)} configurations" if len(aligned.pairs) > 1 else ""
    return f"{told}, {significant(low)} to {significant(high)} Hz{pairs}"


def element_cells(element: ElementDifference) -> tuple[str, ...]:
    """Writes the numbers of an element, without whether it agrees."""
    return (
        f"{element.output} per {element.input}",
        str(element.lines),
        _number(element.decibels, " dB"),
        _number(element.degrees, "°"),
        percent(element.relative),
        percent(element.share_within),
        significant(element.ratio),
        significant(element.limit),
    )


def agreement_word(element: ElementDifference) -> str:
    """Says in a word whether an element agrees."""
    return {True: "agrees", False: "differs", None: "unknown"}[element.agrees]


def _agreement(comparison: Comparison) -> str:
    if comparison.agree is None:
        return "has no known uncertainty to be compared with that of"
    if comparison.agree:
        return f"agrees within both uncertainties, in all {len(comparison.elements)} elements, with"
    apart = [element for element in comparison.elements if element.agrees is False]
    worst = max(apart, key=lambda element: element.ratio / element.limit)
    named = f"{worst.output} per {worst.input}, by {percent(worst.relative)} in the median"
    return f"differs in {len(apart)} of {len(comparison.elements)} elements (the most in {named}) from"


def _overlay_section(label: str, first: Frf, others: Sequence[Compared]) -> Section:
    shown = named_by_quantity(first)
    overlays = tuple(_overlay(first, other) for other in others)
    bode = BodeMatrix(
        "",
        (BodeResponse(label, shown, overlays=overlays),),
        level=LEVEL,
        input_quantity=quantity_title(first.input_channels),
        output_quantity=quantity_title(first.output_channels),
        unit=shown_unit(first),
        measured=label,
        quality=False,
    )
    return Section("Responses", _LEAD, (bode,), "responses")


def _overlay(first: Frf, other: Compared) -> Overlay:
    """The other response where the first has its configurations and elements."""
    frf, aligned = other.frf, other.comparison.aligned
    shape = (len(first.configurations), len(frf.frequency_hz), *first.response.shape[2:])
    response, radius = np.full(shape, np.nan + 0j), np.zeros(shape)
    found, known = band_radius(frf, LEVEL), frf.known_response
    for mine, theirs in aligned.pairs:
        for (row, from_row), (column, from_column) in (
            (output, given) for output in aligned.outputs for given in aligned.inputs
        ):
            response[mine, :, row, column] = known[theirs, :, from_row, from_column]
            radius[mine, :, row, column] = found[theirs, :, from_row, from_column]
    return Overlay(other.label, frf.frequency_hz, response, radius)


def _section(label: str, first: Frf, other: Compared) -> Section:
    comparison = other.comparison
    rows = tuple(_row(element) for element in comparison.elements)
    parts: list[Part] = [Table(COLUMNS, rows, caption=CAPTION, styles=_STYLES, fit="tall")]
    if len(comparison.each) > 1:
        labels = [configuration_label(first, mine) for mine, _ in comparison.aligned.pairs]
        pairs = zip(labels, comparison.each, strict=True)
        rows = tuple(_row(element, label) for label, elements in pairs for element in elements)
        title, choice = "By configuration", "Configuration"
        parts.append(Table(COLUMNS, rows, title=title, styles=_STYLES, choice=choice, fit="tall"))
    parts += [Notes(comparison.notes)] if comparison.notes else []
    lead = f"Compared {comparison_place(comparison)}."
    return Section(f"{other.label} against {label}", lead, tuple(parts))


def _row(element: ElementDifference, choice: str = "") -> Row:
    marks: dict[bool | None, Literal["", "good", "bad"]] = {True: "good", False: "bad", None: ""}
    agrees = Cell(agreement_word(element), marks[element.agrees])
    return Row((*element_cells(element), agrees), choice=choice, group=choice)


def _number(value: float, unit: str) -> str:
    return MISSING if np.isnan(value) else significant(value if abs(value) > _NOTHING else 0.0, 2) + unit
