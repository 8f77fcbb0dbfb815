"""What the study of robust regression found: its parts joined, and whether all that is asked of them is reached."""

from __future__ import annotations

from collections.abc import Sequence

from robid.pipeline import Run
from robid.report.content import Verdict
from robid.report.numbers import MISSING, significant
from robid.report.section import Cell, Section, Table
from robid.settings.load import LoadedExperiment
from robid.studies.conclusion import Conclusion
from robid.studies.janot2009.part import Asked, PartFound, study_of
from robid.studies.janot2009.parts import PARTS
from robid.studies.paper import paper_figures
from robid.studies.study import Earlier

_DIGITS = 5  # published values are asked for within a hundredth


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns no outputs of the chain, once the paper's figures can be read."""
    paper_figures(study_of(loaded).paper, loaded)
    return ()


def further(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the other experiments of all parts."""
    return tuple(one for part in PARTS for one in part.further(run))


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Joins what the parts found."""
    each = (part.conclude(run, list(done)) for part, done in zip(PARTS, results, strict=True))
    found = [one for one in each if one is not None]
    figures = {name: value for one in found for name, value in one.figures.items()}
    asked = {name: limits for one in found for name, limits in one.asked.items()}
    missed = [name for name, limits in asked.items() if not limits.is_reached(figures[name])]
    sections = tuple(section for one in found for section in one.sections)
    return Conclusion(
        Verdict(_sentence(len(asked), missed), "warn" if missed or not asked else "ok"),
        figures,
        (_asked_section(figures, asked), *sections),
        _warnings(found),
    )


def _sentence(count: int, missed: Sequence[str]) -> str:
    if not count:
        return "No part of the study could be done."
    if not missed:
        return f"All {count} figures that are asked for are reached: the verdict on least squares is right."
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


def _warnings(found: Sequence[PartFound]) -> tuple[str, ...]:
    return tuple(warning for one in found for warning in one.warnings)
