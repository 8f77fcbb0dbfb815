"""Who is off the fleet, who changes, and what the fleet is like."""

from __future__ import annotations

from collections import Counter

from robid.fleet.comparison import Compared
from robid.fleet.outliers import FEWEST_ROBOTS, LEVEL
from robid.fleet.page.found import MOST_SHOWN, Found, listed
from robid.fleet.page.sentences import centre_and_spread, changes, known_to, outlier_sentence, short
from robid.report.section import Cell, ColumnStyle, Row, Section, Table

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
    rows = tuple(_row(found, row) for row in list(comparison.off)[:MOST_SHOWN])
    more = len(comparison.off) - len(rows)
    caption = f"The clearest {len(rows)}; {more} more are in the table and in fleet.json." if more else ""
    table = Table(
        ("Row", "What is off most", "Also off"), rows, styles=("name", "prose", "prose"), fit="wide", caption=caption
    )
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
    of = "" if len(comparison.robots.groups) == 1 else f" in {_counted(len(names), 'group')} ({listed(names, 5)})"
    return f"With fewer than {FEWEST_ROBOTS} robots{of}, outliers cannot be told."


def drift_sections(found: Found) -> tuple[Section, ...]:
    """Says which robots change between their measurements."""
    comparison = found.comparison
    if not comparison.robots.repeated:
        return ()
    counted = f"{_counted(comparison.robots.repeated, 'robot')} that were measured more than once"
    level = f"a chance of {_LEVEL} for a fleet that does not change to have any robot named here"
    if not len(comparison.followed):
        return (Section("Drift", f"Of {counted}, none has values of different times: no drift can be told."),)
    left = comparison.robots.repeated - len(comparison.followed)
    untold = f" {_counted(left, 'robot')} cannot be told of, without values of different times." if left else ""
    if not comparison.drifts:
        return (Section("Drift", f"Of {counted}, none changes clearly: {level}.{untold}"),)
    rows = []
    for drift in comparison.drifts[:MOST_SHOWN]:
        of = comparison.compared[drift.trait]
        name = _with_fit(found, of)
        rows.append((comparison.robots.names[drift.robot], name, str(drift.count), *changes(comparison, drift)))
    columns = ("Robot", "What changes", "Measured", "Slope", "Change in all")
    table = Table(columns, tuple(rows), styles=("name", "text", "number", "number", "number"), fit="compact")
    lead = f"Robots, of {counted}, that change: {level}. Intervals are of 95 %.{untold}"
    return (Section("Drift", lead, (table,)),)


def population_sections(found: Found) -> tuple[Section, ...]:
    """Says what each population is like in what its rows are compared by."""
    comparison = found.comparison
    told = [(trait, each) for trait, each in enumerate(comparison.compared) if each.population is not None]
    if not told:
        return ()
    off = Counter(outlier.trait for outlier in comparison.outliers)
    rows = [
        Row(
            (_with_fit(found, each), *_numbers(each), str(off[trait] or "")),
            group=comparison.robots.groups[each.group] if len(comparison.robots.groups) > 1 else "",
        )
        for trait, each in sorted(told, key=lambda pair: pair[1].group)
    ]
    columns = ("Compared by", "Robots", "Fleet", "Robots differ by", "Known to", "Off")
    styles: tuple[ColumnStyle, ...] = ("name", *("number",) * 5)
    more = "" if len(rows) <= _MANY_ROWS else f"The first {_MANY_ROWS} of {len(rows)}; all are in fleet.json."
    table = Table(columns, tuple(rows[:_MANY_ROWS]), styles=styles, fit="compact", caption=more)
    lead = (
        "Middle and standard deviation of each population, errors of measurement apart, whatever a minority of robots"
        " shows; how well the median row knows its value; and how many rows are off."
    )
    return (Section("Populations", lead, (table,)),)


def _row(found: Found, row: int) -> tuple[Cell | str, ...]:
    first, *others = found.comparison.off[row]
    also = [short(found.comparison, each) for each in others]
    return found.cell(row), f"{outlier_sentence(found.comparison, first)}.", listed(also, _OTHERS)


def _numbers(of: Compared) -> tuple[str, ...]:
    if of.population is None:
        return ()
    return (str(of.population.robots), *centre_and_spread(of), known_to(of))


def _with_fit(found: Found, of: Compared) -> str:
    several = len({each.fit for each in found.comparison.compared}) > 1
    return f"{of.fit}: {of.name}" if several else of.name


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
