"""A study of several parts: what they found is joined, and whether all that is asked of them is reached."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robid.pipeline.graph import Run
from robid.report.content import Verdict
from robid.report.numbers import MISSING, significant
from robid.report.section import Cell, Section, Table
from robid.settings.load import LoadedExperiment
from robid.studies.conclusion import Conclusion
from robid.studies.part import Asked, Part, PartFound
from robid.studies.study import Earlier, Procedure

_DIGITS = 5  # published values are asked for within a hundredth


def joined(parts: Sequence[Part], prepare: Callable[[LoadedExperiment], None], reached: str) -> Procedure:
    """Returns the procedure of a study of several parts that reads nothing of its own chain.

    Args:
        parts: The parts, in the order of the page.
        prepare: Refuses, before anything is computed, what cannot be read.
        reached: What it means that all that is asked for is reached, in words.
    """

    def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
        prepare(loaded)
        return ()

    def further(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
        return tuple(one for part in parts for one in part.further(run))

    def conclude(run: Run, results: Earlier) -> Conclusion:
        each = (part.conclude(run, list(done)) for part, done in zip(parts, results, strict=True))
        return _join([one for one in each if one is not None], reached)

    names = [part.name for part in parts]
    steps = tuple(part.step(names[:index]) for index, part in enumerate(parts))
    return Procedure(needs, steps, conclude, further)


def _join(found: Sequence[PartFound], reached: str) -> Conclusion:
    figures = {name: value for one in found for name, value in one.figures.items()}
    asked = {name: limits for one in found for name, limits in one.asked.items()}
    missed = [name for name, limits in asked.items() if not limits.is_reached(figures[name])]
    sections = tuple(section for one in found for section in one.sections)
    return Conclusion(
        Verdict(_sentence(len(asked), missed, reached), "warn" if missed or not asked else "ok"),
        figures,
        (_asked_section(figures, asked), *sections),
        tuple(warning for one in found for warning in one.warnings),
    )


def _sentence(count: int, missed: Sequence[str], reached: str) -> str:
    if not count:
        return "No part of the study could be done."
    if not missed:
        return f"All {count} figures that are asked for are reached: {reached}."
    return f"{count - len(missed)} of {count} figures that are asked for are reached; missed: {', '.join(missed)}."


def _asked_section(figures: dict[str, float], asked: dict[str, Asked]) -> Section:
    rows = tuple(
        (
            name,
            _end(limits.lower),
            _end(limits.upper),
            significant(figures[name], _DIGITS),
            Cell("reached", "good") if limits.is_reached(figures[name]) else Cell("missed", "bad"),
        )
        for name, limits in asked.items()
    )
    table = Table(("Figure", "At least", "At most", "Ours", ""), rows, fit="compact")
    return Section("What is asked", "By their name in summary.json.", (table,))


def _end(value: float) -> str:
    return MISSING if abs(value) == float("inf") else significant(value, _DIGITS)
