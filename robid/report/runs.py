"""A page that sets the fits and responses of two runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from robid.frf.frf import Frf
from robid.report.comparison import Compared, comparison_content
from robid.report.numbers import engineering, percent
from robid.report.page import ReportContent, Verdict
from robid.report.parameters import kind_title
from robid.report.section import Cell, ColumnStyle, Folded, Notes, Part, Row, Section, Table
from robid.results.differences import FALSE_ALARMS, ParameterDifference

PARAMETER_COLUMNS = ("Parameter", "{first}", "±", "{other}", "± ", "Change", "Ratio", "")
"""Heads of the columns about a parameter, with the names of both runs."""
LEAVES = ("Ratio", "± ", "±")
"""Columns that leave a narrow page or terminal, the first first."""
_STYLES: tuple[ColumnStyle, ...] = ("name", "strong", "number", "strong", "number", "number", "number", "text")
CAPTION = (
    "± is half the interval of what predicts, over the estimate. Ratio: the difference over the root of the sum of both"
    f" squared half widths; from the limit on, {{limit:.3g}}, a parameter differs. In {percent(FALSE_ALARMS)} of the"
    " comparisons of two fits of one robot some parameter does so by chance. What the robot file has wrong is alike in"
    " both fits and widens no interval here."
)
"""What the columns mean."""


@dataclass(frozen=True)
class FitSide:
    """A fit as one of two."""

    run: str  # name of the run
    name: str  # name of the fit
    kind: str  # its kind of model
    grade: int  # 2 to trust, 1 predicts, 0 not to be used
    sentence: str  # the grade, and why it is no better


@dataclass(frozen=True)
class FitPair:
    """Two fits side by side."""

    first: FitSide  # that of the first run
    other: FitSide  # that of the other
    parameters: tuple[ParameterDifference, ...]  # the parameters that both have
    alone: tuple[tuple[str, ...], tuple[str, ...]]  # names of those that one has alone

    @property
    def differing(self) -> tuple[ParameterDifference, ...]:
        """Parameters that differ by more than the intervals allow, the clearest first."""
        found = (each for each in self.parameters if each.differs)
        return tuple(sorted(found, key=lambda each: -each.ratio / each.limit))


@dataclass(frozen=True)
class ResponsePair:
    """Responses of one campaign in both runs."""

    campaign: str  # name of the campaign
    first: Frf  # that of the first run
    other: Compared  # that of the other, compared


def runs_content(
    first: str, other: str, fits: Sequence[FitPair], responses: Sequence[ResponsePair], notes: Sequence[str] = ()
) -> ReportContent:
    """Lays out the page: grades and parameters of fits, then responses over each other."""
    apart = any(pair.differing for pair in fits) or any(pair.other.comparison.agree is False for pair in responses)
    sections = [section for pair in fits for section in _fit_sections(pair)]
    for pair in responses:
        of_campaign = comparison_content(f"{first}/{pair.campaign}", pair.first, [pair.other]).sections
        sections += [replace(one, group=f"Response {pair.campaign}", anchor="") for one in of_campaign]
    return ReportContent(
        title=f"{first} against {other}",
        verdict=Verdict(runs_verdict(fits, responses), "warn" if apart else "ok"),
        robot=f"{first}, {other}",
        warnings=tuple(notes),
        sections=tuple(sections),
    )


def runs_verdict(fits: Sequence[FitPair], responses: Sequence[ResponsePair]) -> str:
    """Says of each pair of fits and responses whether they differ."""
    return " ".join([*map(_fit_sentence, fits), *map(_response_sentence, responses)])


def _fit_sentence(pair: FitPair) -> str:
    named = _pair_name(pair)
    if not pair.parameters:
        return f"Fit {named}: the two share no parameter."
    apart = pair.differing
    if not apart:
        return f"Fit {named}: no parameter of {len(pair.parameters)} differs by more than the intervals allow."
    most = apart[0]
    told = f"{len(apart)} of {len(pair.parameters)} parameters differ"
    return f"Fit {named}: {told}, most clearly {most.name} ({percent(most.relative, signed=True)})."


def _response_sentence(pair: ResponsePair) -> str:
    comparison = pair.other.comparison
    if comparison.agree is None:
        return f"Response {pair.campaign}: without a known uncertainty."
    if comparison.agree:
        return f"Response {pair.campaign} agrees within both uncertainties."
    apart = sum(element.agrees is False for element in comparison.elements)
    return f"Response {pair.campaign} differs in {apart} of {len(comparison.elements)} elements."


def _pair_name(pair: FitPair) -> str:
    return pair.first.name if pair.first.name == pair.other.name else f"{pair.first.name} and {pair.other.name}"


def _fit_sections(pair: FitPair) -> tuple[Section, ...]:
    sides = Table(
        ("Run", "Fit", "Kind", "Grade and its reasons"),
        tuple((side.run, side.name, side.kind, side.sentence) for side in (pair.first, pair.other)),
        styles=("name", "text", "text", "prose"),
    )
    parts: list[Part] = [sides]
    if pair.parameters:
        heads = tuple(head.format(first=pair.first.run, other=pair.other.run) for head in PARAMETER_COLUMNS)
        caption = CAPTION.format(limit=pair.parameters[0].limit)
        rows = tuple(_row(each) for each in pair.parameters if not each.is_nuisance)
        along = tuple(_row(each) for each in pair.parameters if each.is_nuisance)
        table = Table(heads, rows, title="Parameters", caption=caption, styles=_STYLES, leaves=LEAVES)
        parts += [table] if rows else []
        more = replace(table, rows=along, title="", caption="" if rows else caption)
        parts += [Folded(f"Friction and ripple, estimated along, {len(along)}", (more,))] if along else []
    alone = zip((pair.first.run, pair.other.run), pair.alone, strict=True)
    told = tuple(f"{run} alone estimates {', '.join(names)}." for run, names in alone if names)
    parts += [Notes(told)] if told else []
    return (Section(f"Fit {_pair_name(pair)}", _fit_sentence(pair), tuple(parts)),)


def parameter_cells(each: ParameterDifference) -> tuple[str, ...]:
    """Writes the numbers of a parameter, without whether it differs."""
    sides = ((each.first, each.first_interval), (each.second, each.second_interval))
    written = []
    for value, (low, high) in sides:
        half = 0.5 * (high - low)
        unit = "" if each.unit == "1" else each.unit
        written += [engineering(value, unit, half), _half(value, half, unit)]
    return (each.name, *written, percent(each.relative, signed=True), f"{each.ratio:.2f}")


def _half(value: float, half: float, unit: str) -> str:
    """Half an interval, relative to its value, or with its unit where it is wider than that."""
    return percent(half / abs(value)) if half < abs(value) else engineering(half, unit, half / 10)


def difference_word(each: ParameterDifference) -> str:
    """Says in a word whether a parameter differs."""
    return {True: "differs", False: "agrees", None: "unknown"}[each.differs]


def _row(each: ParameterDifference) -> Row:
    mark = Cell(difference_word(each), "bad" if each.differs else "good" if each.differs is False else "")
    return Row((*parameter_cells(each), mark), faint=not each.identified, group=kind_title(each.kind, "N m"))
