"""Laying responses of several campaigns or runs over each other."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

from rich.console import Group

from robid.arrays import Meaning
from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.commands.output import Answer, print_json
from robid.commands.shared import choose_node, open_run, require_inputs
from robid.errors import DataError, SettingsError
from robid.frf.comparison import ElementDifference, compare
from robid.frf.frf import Frf
from robid.pipeline.export import write_export
from robid.pipeline.export_campaign import frf_export_plan
from robid.pipeline.freshness import stamped
from robid.pipeline.terminal import Shell, make_console
from robid.report.comparison import (
    COLUMNS,
    Compared,
    agreement_word,
    comparison_content,
    comparison_place,
    comparison_verdict,
    element_cells,
)
from robid.report.page import ReportContent, render
from robid.report.terminal_table import Column, Footnotes, TerminalTable

_FEWEST, _MOST = 2, 6
_SHOWN = 12
_PAGE = ".html"
_NAMES = "name EXPERIMENT.yaml:CAMPAIGN or a frf.h5 for each, as `robid compare --help` says"
_LEAVES = {"Lines": 1, "Phase": 2, "Magnitude": 3, "Within band": 4, "Limit": 5, "Square / variance": 6}
"""Which columns are left out first where there is no room."""


@dataclasses.dataclass(frozen=True)
class PairTold:
    """The same in one configuration of both."""

    first: Annotated[int, Meaning("Number, from 1, of the configuration in the first response.")]
    second: Annotated[int, Meaning("Number, from 1, of the same configuration in the other.")]
    elements: Annotated[
        tuple[ElementDifference, ...], Meaning("The elements in it; limits are for one pair at a time.")
    ]


@dataclasses.dataclass(frozen=True)
class ComparisonTold:
    """A response held against the first."""

    label: Annotated[str, Meaning("Name of the response.")]
    agree: Annotated[bool | None, Meaning("Whether all elements agree; null where that is unknown.")]
    lines: Annotated[int, Meaning("Frequencies that were compared.")]
    interpolated: Annotated[
        Literal["first", "second"] | None,
        Meaning("Which of the two was interpolated to the other's lines; null where enough are common."),
    ]
    frequency_hz: Annotated[tuple[float, float], Meaning("Lowest and highest frequency [Hz].")]
    elements: Annotated[tuple[ElementDifference, ...], Meaning("The elements, over all configurations.")]
    configurations: Annotated[tuple[PairTold, ...], Meaning("The configurations that both have.")]
    notes: Annotated[tuple[str, ...], Meaning("What a reader must know.")]


@dataclasses.dataclass(frozen=True)
class CompareAnswer(Answer, type="compare"):
    """Where responses differ."""

    reference: Annotated[str, Meaning("Name of the first response, which the others are compared with.")]
    comparisons: Annotated[tuple[ComparisonTold, ...], Meaning("The others.")]
    output: Annotated[str | None, Meaning("The page; null where `--output` was not given.")]
    outcome: Annotated[str | None, Meaning("`made`, or `fresh` where the page was there.")]


@dataclasses.dataclass(frozen=True)
class _Named:
    """A response with its name and its file."""

    label: str
    path: Path
    frf: Frf


def compare_responses(named: Sequence[str], output: Path | None, *, force: bool, as_json: bool) -> int:
    """Compares every response with the first; returns the exit code."""
    _check(named, output)
    responses = _distinct([_load(name) for name in named])
    first, others = responses[0], [_compared(responses[0], other) for other in responses[1:]]
    page = None
    if output is not None:
        read = {f"the response {response.label}": response.path for response in responses}
        page = write_page(output, comparison_content(first.label, first.frf, others), read, force=force)
    if as_json:
        found = tuple(comparison_told(other) for other in others)
        print_json(CompareAnswer(first.label, found, None if output is None else str(output), page))
        return 0
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    for other in others:
        shell.show(_shown(first.label, other))
    shell.say(comparison_verdict(first.label, others))
    if output is not None:
        shell.say(f"{output}  {page}")
    return 0


def write_page(
    output: Path, content: ReportContent, read: Mapping[str, Path], *, force: bool
) -> Literal["made", "fresh"]:
    """Writes a comparison's page; without times, so that the same comparison makes the same page."""
    text = stamped(render(content), Provenance(stage="compare"))
    return write_export(output, text.encode(), read, force=force, kind="comparison")


def _check(named: Sequence[str], output: Path | None) -> None:
    if not _FEWEST <= len(named) <= _MOST:
        what = f"S003 {_FEWEST} to {_MOST} responses are compared, not {len(named)}"
        raise SettingsError(what, where="compare", remedy=_NAMES)
    check_output(output)


def check_output(output: Path | None) -> None:
    """Refuses an output that is no page.

    Raises:
        SettingsError: If its name does not end with `.html`.
    """
    if output is not None and output.suffix != _PAGE:
        what = f"S004 `--output {output}` must end with {_PAGE}"
        raise SettingsError(what, where="compare", remedy=f"name a page, as comparison{_PAGE}")


def _load(name: str) -> _Named:
    """Finds the response that is named by a file, or by an experiment and its campaign.

    Raises:
        SettingsError: If it is neither.
        ArtifactError: If it is not there, or not up to date.
    """
    path, campaign = Path(name), None
    if not path.exists() and ":" in name:
        before, _, campaign = name.rpartition(":")
        path = Path(before)
    if path.suffix == ".h5" and campaign is None:
        frf = frf_from_artifact(read_artifact(path, FRF))
        return _Named("/".join(path.parts[-3:-1]) or path.stem, path, frf)
    if path.suffix not in {".yaml", ".yml"}:
        remedy = "name EXPERIMENT.yaml, EXPERIMENT.yaml:CAMPAIGN, or a frf.h5"
        raise SettingsError(f"S005 `{name}` is neither an experiment file nor a frf.h5", where="compare", remedy=remedy)
    run = open_run(path, None, None, None)
    node = choose_node(run, "estimate-frf", campaign, option=f"as in `{path}:CAMPAIGN`")
    inputs = require_inputs(run, dataclasses.replace(node, plan=frf_export_plan(node.owner)), [])
    frf = frf_from_artifact(read_artifact(inputs["frf"], FRF))
    return _Named(f"{run.loaded.experiment.name}/{node.owner}", inputs["frf"], frf)


def _distinct(responses: Sequence[_Named]) -> list[_Named]:
    labels = [response.label for response in responses]
    return [
        dataclasses.replace(response, label=f"{response.label} ({labels[: index + 1].count(response.label)})")
        if labels.count(response.label) > 1
        else response
        for index, response in enumerate(responses)
    ]


def _compared(first: _Named, other: _Named) -> Compared:
    try:
        return Compared(other.label, other.frf, compare(first.frf, other.frf))
    except DataError as error:
        where = f"{first.label} (the first) and {other.label} (the second)"
        raise DataError(error.what, where=where, remedy=error.remedy) from error


def comparison_told(other: Compared) -> ComparisonTold:
    """Writes a comparison for programs."""
    aligned = other.comparison.aligned
    return ComparisonTold(
        label=other.label,
        agree=other.comparison.agree,
        lines=len(aligned.frequency_hz),
        interpolated=None if aligned.how == "common" else aligned.how,
        frequency_hz=(float(aligned.frequency_hz[0]), float(aligned.frequency_hz[-1])),
        elements=other.comparison.elements,
        configurations=tuple(
            PairTold(mine + 1, theirs + 1, elements)
            for (mine, theirs), elements in zip(aligned.pairs, other.comparison.each, strict=True)
        ),
        notes=other.comparison.notes,
    )


def _shown(label: str, other: Compared) -> Group:
    """The elements that differ the most, and what the reader must know."""
    elements = other.comparison.elements
    ordered = sorted(elements, key=lambda one: -one.ratio / one.limit if one.agrees is not None else 0.0)
    first, last = 0, len(COLUMNS) - 1
    columns = [
        Column(head, numbers=place not in (first, last), leaves=_LEAVES.get(head, 0))
        for place, head in enumerate(COLUMNS)
    ]
    table = TerminalTable(columns, elsewhere="in `--json`, on the page of `--output`")
    for element in ordered[:_SHOWN]:
        table.add(*element_cells(element), agreement_word(element))
    title = f"{other.label} against {label}, {comparison_place(other.comparison)}"
    told = list(other.comparison.notes)
    if len(ordered) > _SHOWN:
        told.insert(0, f"{len(ordered) - _SHOWN} more elements, nearer than these, are on the page of --output")
    return Group(Footnotes([title], style=""), table, Footnotes(told, style=""))
