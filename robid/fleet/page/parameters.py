"""Every parameter over the rows with its intervals; of very many rows how they are distributed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from robid.arrays import FloatArray
from robid.fleet.collected import Collected
from robid.fleet.page.found import Found
from robid.report.numbers import MISSING, percent, scale_for
from robid.report.parameters import kind_title
from robid.report.section import Choice, ColumnStyle, Curve, Figure, Line, Section, Table

_FEW_ROWS, _MANY_ROWS = 40, 300
_MOST_OFF = 100
_SHARES = np.linspace(0, 100, 201)
_EACH = (
    "The parameter itself with its interval, which holds what the robot file may have wrong, in the order of the"
    " manifest; the line is the robot file's value."
)
_SHARE = (
    "The parameter itself, from the lowest row to the highest, with the interval of the median row;"
    " the line is the robot file's value."
)


def parameter_sections(found: Found) -> Iterator[Section]:
    """One section a fit: a table of all parameters, and the rows of the one that the reader chooses."""
    fits = dict.fromkeys(fit for (fit, _), of in found.collected.items() if not of.is_misfit)
    for fit in fits:
        own = {name: of for (of_fit, name), of in found.collected.items() if of_fit == fit and not of.is_misfit}
        many = max(len(of.rows) for of in own.values()) > _MANY_ROWS
        figures = tuple((name, (_figure(found, fit, name, of),)) for name, of in own.items())
        title = f"Parameters over rows, fit {fit}" if len(fits) > 1 else "Parameters over rows"
        yield Section(title, _SHARE if many else _EACH, (_table(own), Choice("Parameter", figures)))


def _table(parameters: dict[str, Collected]) -> Table:
    rows = []
    for name, of in parameters.items():
        values, nominal = np.array(of.middle), np.array(of.nominal)
        centre = float(np.median(values))
        scale = scale_for(centre, _unit(of), float(np.ptp(values)) / 2)
        half = _known((np.array(of.high) - np.array(of.low)) / 2)
        relative = percent(float(np.median(half)) / abs(centre)) if half.size and centre else MISSING
        different = "several" if np.isfinite(nominal).any() else MISSING
        stated = scale.text(float(nominal[0])) if np.ptp(nominal) == 0 else different
        numbers = (scale.text(each) for each in (centre, float(values.min()), float(values.max())))
        rows.append((name, kind_title(of.kind), scale.unit, str(len(values)), stated, *numbers, relative))
    columns = ("Parameter", "Kind", "Unit", "Rows", "Robot file", "Median", "Lowest", "Highest", "Half interval")
    styles: tuple[ColumnStyle, ...] = ("name", "text", "text", *("number",) * 6)
    return Table(columns, tuple(rows), styles=styles, fit="compact")


def _figure(found: Found, fit: str, name: str, of: Collected) -> Figure:
    nominal, many = set(of.nominal), len(of.rows) > _MANY_ROWS
    x_title, curves = (_distribution if many else _rows)(found, fit, name, of)
    unit = f" [{of.unit}]" if _unit(of) else ""
    labels = tuple(found.ledgers[row].id for row in of.rows) if len(of.rows) <= _FEW_ROWS else ()
    return Figure(
        title=name,
        x_title=x_title,
        y_title=f"{kind_title(of.kind)}{unit}",
        curves=curves,
        log_x=False,
        log_y=False,
        x_labels=labels,
        x_range=(-1.0, 101.0) if many else None,
        lines=tuple(Line("y", each, "robot file") for each in nominal if np.isfinite(each))
        if len(nominal) == 1
        else (),
    )


def _rows(found: Found, fit: str, name: str, of: Collected) -> tuple[str, tuple[Curve, ...]]:
    """Each row with its interval, and those that are off once more."""
    places = tuple(float(place) for place in range(len(of.rows)))
    texts = tuple(_text(found, of, place) for place in range(len(of.rows)))
    gap = np.full(len(of.rows), np.nan)
    ends = np.column_stack([np.array(of.low), np.array(of.high), gap]).ravel()
    off = [place for place, row in enumerate(of.rows) if (row, fit, name) in found.comparison.accused]
    curves = [
        Curve("estimated", places, tuple(of.middle), texts, points=True, shade=0),
        Curve(
            f"{percent(of.confidence)} interval",
            tuple(chain.from_iterable((place,) * 3 for place in places)),
            tuple(ends.tolist()),
            shade=0,
        ),
        *_off(off, [places[place] for place in off], [texts[place] for place in off], of),
    ]
    return "Row", tuple(curves)


def _distribution(found: Found, fit: str, name: str, of: Collected) -> tuple[str, tuple[Curve, ...]]:
    """The value that a share of the rows stays below, and those that are off, where they stand among the others."""
    values = np.array(of.middle)
    order = np.argsort(values, kind="stable")
    share = np.empty(len(values))
    share[order] = 100 * np.arange(len(values)) / (len(values) - 1)
    off = [place for place, row in enumerate(of.rows) if (row, fit, name) in found.comparison.accused][:_MOST_OFF]
    middle = np.percentile(values, _SHARES)
    half = _known((np.array(of.high) - np.array(of.low)) / 2)
    reach = float(np.median(half)) if half.size else np.nan
    curves = (
        Curve(
            f"estimated, with the median {percent(of.confidence)} interval",
            tuple(_SHARES.tolist()),
            tuple(middle.tolist()),
            lower=tuple((middle - reach).tolist()),
            upper=tuple((middle + reach).tolist()),
            shade=0,
        ),
        *_off(off, [float(share[place]) for place in off], [_text(found, of, place) for place in off], of),
    )
    return "Share of rows below [%]", curves


def _off(places: Sequence[int], x: Sequence[float], texts: Sequence[str], of: Collected) -> Iterator[Curve]:
    if places:
        values = tuple(of.middle[place] for place in places)
        yield Curve("off the fleet", tuple(x), values, tuple(texts), points=True, symbol="ring", shade=1)


def _text(found: Found, of: Collected, place: int) -> str:
    """What is said of a row's point."""
    name, value, low, high = found.ledgers[of.rows[place]].id, of.middle[place], of.low[place], of.high[place]
    half = (high - low) / 2 if np.isfinite(high - low) else None
    scale = scale_for(value, _unit(of), half)
    ends = f", {scale.text(low)} to {scale.text(high)}" if half else ""
    return f"{name}: {scale.text(value)}{ends} {scale.unit}".strip()


def _known(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _unit(of: Collected) -> str:
    return "" if of.unit == "1" else of.unit
