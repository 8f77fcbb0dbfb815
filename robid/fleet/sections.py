"""Who is off the fleet, who changes, what the fleet is like, and every parameter over the rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from robid.arrays import FloatArray
from robid.fleet.comparison import MOST_SHOWN, Collected, Compared, Comparison, Found, listed
from robid.fleet.drift import Drift
from robid.fleet.population import FEWEST_ROBOTS, LEVEL, Outlier
from robid.pipeline.stage import counted
from robid.report.numbers import MISSING, percent, scale_for
from robid.report.parameters import kind_title
from robid.report.section import Choice, ColumnStyle, Curve, Figure, Line, Row, Section, Table


def outlier_sentence(comparison: Comparison, outlier: Outlier) -> str:
    """Says what of a row is off, by how much, and how well both are known."""
    of = comparison.compared[outlier.trait]
    if of.population is None:
        message = "an outlier has a population"
        raise RuntimeError(message)
    about, (value, low, high) = of.population, of.interval(outlier.row)
    scale = scale_for((low + high) / 2, _unit(of.of), (high - low) / 2)
    known = "" if low == high else f" ({scale.text(low)} to {scale.text(high)})"
    centre = of.natural(about.centre)
    return (
        f"{of.name} is {_number(of, value)}{known}, {_away(of, value, centre)} the fleet's {_number(of, centre)};"
        f" robots differ by {_spread(of, about.spread)}: {deviations(outlier.away)}"
    )


def deviations(away: float) -> str:
    """Writes how far something is off."""
    return f"{abs(away):.2g} deviations" if abs(away) < 100 else f"{abs(away):.0f} deviations"


def short(comparison: Comparison, outlier: Outlier) -> str:
    """Names what of a row is off, as in `gear_a1.stiffness +29 %`."""
    of = comparison.compared[outlier.trait]
    if of.population is None or not of.of.is_logarithmic:
        return of.name
    value, *_ = of.interval(outlier.row)
    ratio = value / of.natural(of.population.centre)
    return f"{of.name} {f'{ratio:.2g} times' if ratio > 2 else percent(ratio - 1, signed=True)}"


def changes(comparison: Comparison, drift: Drift) -> tuple[str, str]:
    """Writes slope and change of a drift with their intervals."""
    of = comparison.compared[drift.trait]
    slope = _change(of, drift.slope, drift.slope_half_width)
    return f"{slope} a {comparison.robots.time_unit}", _change(of, drift.change, drift.change_half_width)


def centre_and_spread(of: Compared) -> tuple[str, str]:
    """Writes what a population is like."""
    if of.population is None:
        return "", ""
    return _number(of, of.natural(of.population.centre)), _spread(of, of.population.spread)


def known_to(of: Compared) -> str:
    """Writes how well the median row knows its value; nothing of a misfit."""
    return "" if of.of.is_misfit else _spread(of, float(np.median(of.trait.std)))


def _away(of: Compared, value: float, centre: float) -> str:
    side = "above" if value > centre else "below"
    if not of.of.is_logarithmic:
        return f"{_number(of, abs(value - centre))} {side}"
    ratio = value / centre
    return f"{ratio:.3g} times" if ratio > 2 else f"{percent(abs(ratio - 1))} {side}"


def _change(of: Compared, change: float, half: float) -> str:
    middle, low, high = (of.change(change + part) for part in (0.0, -half, half))
    if of.of.is_logarithmic:
        return f"{percent(middle, signed=True)} ({percent(low, signed=True)} to {percent(high, signed=True)})"
    scale = scale_for(middle, _unit(of.of), half)
    return f"{scale.text(middle)} {scale.unit} ({scale.text(low)} to {scale.text(high)})"


def _spread(of: Compared, spread: float) -> str:
    return percent(spread) if of.of.is_logarithmic else _number(of, spread)


def _number(of: Compared, value: float) -> str:
    scale = scale_for(value, _unit(of.of), abs(value) / 20)
    return f"{scale.text(value)} {scale.unit}".strip()


def _unit(of: Collected) -> str:
    return "" if of.unit == "1" else of.unit


_MANY_ROWS = 300
_OTHERS = 6
_MIXED = 0.2
_LEVEL = f"{100 * LEVEL:g} %"


def outlier_sections(found: Found) -> tuple[Section, ...]:
    """Says which rows are off, the clearest first, with a sentence each."""
    comparison = found.comparison
    if not comparison.compared:
        return ()
    untold = untold_sentence(found)
    if len(comparison.untold) == len(comparison.robots.groups):
        return (Section("Outliers", untold),)
    level = f"a chance of {_LEVEL} for a sound fleet to have any row named here"
    if not comparison.off:
        return (Section("Outliers", f"No row is off the fleet: {level}. {untold}".strip()),)
    rows = []
    for row, (first, *others) in list(comparison.off.items())[:MOST_SHOWN]:
        also = [short(comparison, each) for each in others]
        rows.append((found.cell(row), f"{outlier_sentence(comparison, first)}.", listed(also, _OTHERS)))
    more = len(comparison.off) - len(rows)
    caption = f"The clearest {len(rows)}; {more} more are in the table and in fleet.json." if more else ""
    heads = ("Row", "What is off most", "Also off")
    table = Table(heads, tuple(rows), styles=("name", "prose", "prose"), caption=caption)
    lead = (
        f"Rows whose parameters or misfit are none of their population, the clearest first: {level}. Deviations hold"
        f" what robots differ by and how well each value is known. {_mixture(found)}{untold}"
    )
    return (Section("Outliers", lead.strip(), (table,)),)


def _mixture(found: Found) -> str:
    """Asks whether there are two populations, where very many rows are off."""
    [(trait, count)] = Counter(outlier.trait for outlier in found.comparison.outliers).most_common(1)
    of = found.comparison.compared[trait]
    if count <= _MIXED * len(of.trait.rows):
        return ""
    told = f"Of {of.name}, {count} of {len(of.trait.rows)} rows are off."
    return f"{told} Are these two types? A column `group` tells them apart. "


def untold_sentence(found: Found) -> str:
    """Says where too few robots tell who is off; empty where enough do."""
    comparison = found.comparison
    if not comparison.untold:
        return ""
    names = [comparison.robots.groups[group] or "without a name" for group in comparison.untold]
    of = "" if len(comparison.robots.groups) == 1 else f" in {counted(len(names), 'group')} ({listed(names, 5)})"
    return f"With fewer than {FEWEST_ROBOTS} robots{of}, outliers cannot be named."


def drift_sections(found: Found) -> tuple[Section, ...]:
    """Says which robots change between their measurements."""
    comparison = found.comparison
    if not comparison.robots.repeated:
        return ()
    several = f"{counted(comparison.robots.repeated, 'robot')} that were measured more than once"
    level = f"a chance of {_LEVEL} for a fleet that does not change to have any robot named here"
    if not len(comparison.followed):
        return (Section("Drift", f"Of {several}, none has values of different times: no drift can be determined."),)
    left = comparison.robots.repeated - len(comparison.followed)
    untold = f" {counted(left, 'robot')} cannot be judged, without values of different times." if left else ""
    if not comparison.drifts:
        return (Section("Drift", f"Of {several}, none changes clearly: {level}.{untold}"),)
    rows = []
    for drift in comparison.drifts[:MOST_SHOWN]:
        of = comparison.compared[drift.trait]
        name = _with_fit(found, of)
        rows.append((comparison.robots.names[drift.robot], name, str(drift.count), *changes(comparison, drift)))
    columns = ("Robot", "What changes", "Measured", "Slope", "Change in all")
    table = Table(columns, tuple(rows), styles=("name", "text", "number", "number", "number"), fit="compact")
    lead = f"Robots, of {several}, that change: {level}. Intervals are of 95 %.{untold}"
    return (Section("Drift", lead, (table,)),)


def population_sections(found: Found) -> tuple[Section, ...]:
    """Says what each population is like in what its rows are compared by."""
    comparison = found.comparison
    off, rows = Counter(outlier.trait for outlier in comparison.outliers), []
    for trait, each in sorted(enumerate(comparison.compared), key=lambda one: one[1].group):
        if each.population is not None:
            own = str(each.population.robots), *centre_and_spread(each), known_to(each), str(off[trait] or "")
            group = comparison.robots.groups[each.group] if len(comparison.robots.groups) > 1 else ""
            rows.append(Row((_with_fit(found, each), *own), group=group))
    if not rows:
        return ()
    columns = ("Compared by", "Robots", "Fleet", "Robots differ by", "Known to", "Off")
    more = "" if len(rows) <= _MANY_ROWS else f"The first {_MANY_ROWS} of {len(rows)}; all are in fleet.json."
    table = Table(columns, tuple(rows[:_MANY_ROWS]), fit="compact", caption=more)
    lead = (
        "Middle and standard deviation of each population, errors of measurement apart, whatever a minority of robots"
        " shows; how well the median row knows its value; and how many rows are off."
    )
    return (Section("Populations", lead, (table,)),)


def _with_fit(found: Found, of: Compared) -> str:
    several = len({each.fit for each in found.comparison.compared}) > 1
    return f"{of.fit}: {of.name}" if several else of.name


_FEW_ROWS, _MOST_POINTS = 40, 300
_MOST_OFF = 100
_SHARES = np.linspace(0, 100, 201)
_EACH = (
    "The parameter itself with its interval, which contains what the robot file may have wrong, in the order of the"
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
        many = max(len(of.rows) for of in own.values()) > _MOST_POINTS
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
    return Table(columns, tuple(rows), styles=styles, leaves=("Kind", "Rows", "Lowest", "Highest", "Robot file"))


def _figure(found: Found, fit: str, name: str, of: Collected) -> Figure:
    nominal, many = set(of.nominal), len(of.rows) > _MOST_POINTS
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
        lines=tuple(Line("y", each, "robot file") for each in nominal if np.isfinite(each) and len(nominal) == 1),
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
    name, value, low, high = found.ledgers[of.rows[place]].id, of.middle[place], of.low[place], of.high[place]
    half = (high - low) / 2 if np.isfinite(high - low) else None
    scale = scale_for(value, _unit(of), half)
    ends = f", {scale.text(low)} to {scale.text(high)}" if half else ""
    return f"{name}: {scale.text(value)}{ends} {scale.unit}".strip()


def _known(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]
