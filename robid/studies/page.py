"""What a study found, and the page that all share: what is asked, tables by their columns, curves over one axis."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.report.numbers import MISSING, significant
from robid.report.page import Verdict
from robid.report.section import Cell, Curve, Figure, Section, Table

_DIGITS = 5  # published values are asked for within a hundredth

CHOOSING = "These seeds are for choosing thresholds: their shares flatter."
"""What the reader must know of figures from the seeds that everything was chosen with."""


@dataclass(frozen=True)
class Conclusion:
    """What a study found."""

    verdict: Verdict  # The answer
    summary: dict[str, float]  # Figures by dotted name
    sections: tuple[Section, ...]  # Tables and figures of the page
    warnings: tuple[str, ...] = ()  # What the reader must know before using a number


@dataclass(frozen=True)
class Asked:
    """What is asked of a figure."""

    lower: float = float("-inf")  # The least that it may be
    upper: float = float("inf")  # The most that it may be
    what: str = ""  # What it says, where its name does not

    def is_reached(self, value: float) -> bool:
        """Whether a figure lies within; one that is not known does not."""
        return self.lower <= value <= self.upper


@dataclass(frozen=True)
class PartFound:
    """What a part of a study found."""

    figures: dict[str, float]  # Figures by their name in summary.json
    asked: Mapping[str, Asked] = field(default_factory=dict)  # What is asked of some of them
    sections: tuple[Section, ...] = ()  # Tables and figures of the page
    warnings: tuple[str, ...] = ()  # Why something is left out, where it is


def concluded(found: Sequence[PartFound], reached: str) -> Conclusion:
    """Joins what the parts of a study found, the table of what is asked before all others."""
    figures = {name: value for one in found for name, value in one.figures.items()}
    asked = {name: limits for one in found for name, limits in one.asked.items()}
    missed = [name for name, limits in asked.items() if not limits.is_reached(figures.get(name, np.nan))]
    text = f"All {len(asked)} figures that are asked for are reached: {reached}."
    if not asked:
        text = "No part of the study could be done."
    elif missed:
        met = f"{len(asked) - len(missed)} of {len(asked)}"
        text = f"{met} figures that are asked for are reached; missed: {', '.join(missed)}."
    # A share over robots has its Monte Carlo deviation beside it.
    deviations = {name: figures[std] for name in asked if (std := name.removesuffix("_95") + "_std") in figures}
    columns: list[tuple[str, Callable[[str], str | Cell]]] = [
        ("Figure", lambda name: f"{name}: {asked[name].what}" if asked[name].what else name),
        ("At least", lambda name: _end(asked[name].lower)),
        ("At most", lambda name: _end(asked[name].upper)),
        ("Ours", lambda name: significant(figures.get(name), _DIGITS)),
        *([("Deviation", lambda name: significant(deviations.get(name)))] if deviations else []),
        ("", lambda name: Cell("missed", "bad") if name in missed else Cell("reached", "good")),
    ]
    section = Section("What is asked", "By their name in summary.json.", (table(columns, asked, fit="compact"),))
    return Conclusion(
        Verdict(text, "warn" if missed or not asked else "ok"),
        figures,
        (section, *chain.from_iterable(one.sections for one in found)),
        tuple(chain.from_iterable(one.warnings for one in found)),
    )


def _end(value: float) -> str:
    return MISSING if np.isinf(value) else significant(value, _DIGITS)


def table(
    columns: Iterable[tuple[str, Callable[[Any], str | Cell]]],
    rows: Iterable[Any],
    **options: Any,  # noqa: ANN401
) -> Table:
    """Returns a table by its columns: the head of each, and what it writes of a row; `options` are those of `Table`."""
    heads, cells = zip(*columns, strict=True)
    return Table(heads, tuple(tuple(write(row) for write in cells) for row in rows), **options)


def by_name(
    figures: Mapping[str, float], head: str, key: str, write: Callable[[Any], str] = significant
) -> tuple[str, Callable[[str], str]]:
    """Returns a column of a table of names: its head, and how it writes the figure `<name>.<key>`."""
    return head, lambda name: write(figures.get(f"{name}.{key}"))


def curves(x: FloatArray | None, series: Mapping[str, Any], **options: Any) -> tuple[Curve, ...]:  # noqa: ANN401
    """Returns curves by name over one axis (n_point,), or over 1, 2, ...; `options` are those of `Curve`."""
    found = []
    for name, values in series.items():
        along = np.arange(1.0, len(values) + 1) if x is None else np.asarray(x, float)
        found.append(Curve(name, tuple(along.tolist()), tuple(np.asarray(values, float).tolist()), **options))
    return tuple(found)


def figure(
    title: str,
    titles: tuple[str, str],
    x: FloatArray | None,
    series: Mapping[str, Any],
    **options: Any,  # noqa: ANN401
) -> Figure:
    """Returns a figure of `curves`, with the titles of both axes; `options` are those of `Figure`."""
    return Figure(title, *titles, curves(x, series), **options)
