"""Setting the fits and responses of two runs side by side: `robid compare RUN RUN`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Group

from robid.arrays import Meaning
from robid.artifacts.results import MODEL, read_grade
from robid.commands.compare import ComparisonTold, check_output, comparison_told, write_page
from robid.commands.output import Answer, print_json
from robid.errors import DataError, SettingsError
from robid.frf.comparison import compare
from robid.pipeline.terminal import Shell, make_console
from robid.report.comparison import Compared
from robid.report.runs import (
    CAPTION,
    LEAVES,
    PARAMETER_COLUMNS,
    FitPair,
    FitSide,
    ResponsePair,
    difference_word,
    parameter_cells,
    runs_content,
    runs_verdict,
)
from robid.report.terminal_table import Column, Footnotes, TerminalTable
from robid.results.differences import ParameterDifference, differences

if TYPE_CHECKING:
    from robid.face.runs import RunFolder, StoredFit


@dataclasses.dataclass(frozen=True)
class FitTold:
    """A fit of one of the runs."""

    run: Annotated[str, Meaning("Name of the run.")]
    fit: Annotated[str, Meaning("Name of the fit.")]
    kind: Annotated[str, Meaning("Kind of its model.")]
    grade: Annotated[int, Meaning("2 to trust, 1 predicts but single parameters may be off, 0 not to be used.")]
    sentence: Annotated[str, Meaning("The grade, and why it is no better.")]


@dataclasses.dataclass(frozen=True)
class FitsTold:
    """Two fits side by side."""

    first: Annotated[FitTold, Meaning("That of the first run.")]
    second: Annotated[FitTold, Meaning("That of the other.")]
    parameters: Annotated[tuple[ParameterDifference, ...], Meaning("The parameters that both have.")]
    first_alone: Annotated[tuple[str, ...], Meaning("Names of the parameters of the first alone.")]
    second_alone: Annotated[tuple[str, ...], Meaning("Names of the parameters of the other alone.")]


@dataclasses.dataclass(frozen=True)
class RunsAnswer(Answer, type="compare-runs"):
    """Where two runs differ."""

    runs: Annotated[tuple[str, str], Meaning("Names of both runs.")]
    fits: Annotated[tuple[FitsTold, ...], Meaning("Fits that both runs have.")]
    responses: Annotated[tuple[ComparisonTold, ...], Meaning("Responses of campaigns that both runs have.")]
    notes: Annotated[tuple[str, ...], Meaning("What could not be compared, and why.")]
    verdict: Annotated[str, Meaning("What differs, in sentences.")]
    output: Annotated[str | None, Meaning("The page; null where `--output` was not given.")]
    outcome: Annotated[str | None, Meaning("`made`, or `fresh` where the page was there.")]


@dataclasses.dataclass(frozen=True)
class _Side:
    """A run, and the fit of it that was named, if one was."""

    label: str
    opened: RunFolder
    fit: str | None


def names_runs(named: Sequence[str]) -> bool:
    """Whether run folders are to be compared: some name is a folder, or one with `:` and the name of a fit."""
    return any(_folder(name)[0].is_dir() for name in named)


def compare_runs(named: Sequence[str], output: Path | None, *, force: bool, as_json: bool) -> int:
    """Sets the fits and responses of two runs side by side; returns the exit code.

    Raises:
        SettingsError: If something else than two run folders is named, or they have nothing in common.
        ArtifactError: If a folder holds nothing of a run, or a file of it cannot be read.
    """
    first, other = _sides(named, output)
    fits = tuple(_fits(first, other))
    responses, notes = _responses(first, other)
    if not fits and not responses:
        what = f"S586 {first.label} and {other.label} have no fit and no response of one name"
        raise SettingsError(what, where="compare", remedy="name fits that differ in name as RUN:FIT")
    page = None
    if output is not None:
        content = runs_content(first.label, other.label, fits, responses, notes)
        folders = {"the run": first.opened.folder, "the other run": other.opened.folder}
        page = write_page(output, content, {what: path / "report.html" for what, path in folders.items()}, force=force)
    verdict = runs_verdict(fits, responses)
    if as_json:
        told, compared = tuple(map(_told, fits)), tuple(comparison_told(pair.other) for pair in responses)
        written = None if output is None else str(output)
        print_json(RunsAnswer((first.label, other.label), told, compared, notes, verdict, written, page))
        return 0
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    for pair in fits:
        shell.show(_shown(pair))
    for line in (*notes, verdict, *([] if output is None else [f"{output}  {page}"])):
        shell.say(line)
    return 0


def _folder(name: str) -> tuple[Path, str | None]:
    """The folder of a name, and the fit that it names after a colon."""
    if not Path(name).exists() and ":" in name:
        before, _, fit = name.rpartition(":")
        return Path(before), fit
    return Path(name), None


def _sides(named: Sequence[str], output: Path | None) -> tuple[_Side, _Side]:
    from robid.face.runs import open as open_folder

    check_output(output)
    others = [name for name in named if not _folder(name)[0].is_dir()]
    if len(named) != 2 or others:
        told = f"`{others[0]}` is no run folder" if others else f"{len(named)} run folders are named"
        what = f"S587 {told}: a run is compared with one other run"
        remedy = "name two run folders, as runs/kr300, or responses alone, as EXPERIMENT.yaml:CAMPAIGN"
        raise SettingsError(what, where="compare", remedy=remedy)
    folders = [_folder(name) for name in named]
    labels = [path.resolve().name for path, _ in folders]
    if labels[0] == labels[1]:
        labels = [f"{labels[0]} (1)", f"{labels[1]} (2)"]
    sides = [_Side(label, open_folder(path), fit) for label, (path, fit) in zip(labels, folders, strict=True)]
    for side in sides:
        if side.fit is not None and side.fit not in side.opened.fits:
            there = ", ".join(side.opened.fits) or "none"
            what = f"S588 {side.label} has no fit `{side.fit}`"
            raise SettingsError(what, where="compare", remedy=f"its fits: {there}")
    return sides[0], sides[1]


def _fits(first: _Side, other: _Side) -> list[FitPair]:
    """Pairs of fits: those that are named, those of one name, or the only one of each run."""
    every, theirs = list(first.opened.fits), list(other.opened.fits)
    if first.fit is not None or other.fit is not None:
        pairs = [(first.fit or other.fit or "", other.fit or first.fit or "")]
    else:
        pairs = [(name, name) for name in every if name in theirs]
        if not pairs and len(every) == len(theirs) == 1:
            pairs = [(every[0], theirs[0])]
    return [
        _pair(first.label, first.opened.fits[one], other.label, other.opened.fits[two])
        for one, two in pairs
        if one in every and two in theirs
    ]


def _pair(label: str, one: StoredFit, other_label: str, two: StoredFit) -> FitPair:
    estimates = one.parameters.estimate, two.parameters.estimate
    names = estimates[0].names, estimates[1].names
    return FitPair(
        first=_side(label, one),
        other=_side(other_label, two),
        parameters=differences(*estimates),
        alone=(
            tuple(name for name in names[0] if name not in names[1]),
            tuple(name for name in names[1] if name not in names[0]),
        ),
    )


def _side(label: str, fit: StoredFit) -> FitSide:
    grade = fit.grade or read_grade(fit.folder / "model.h5", MODEL)
    return FitSide(label, fit.folder.name, fit.kind, grade.value, grade.sentence)


def _responses(first: _Side, other: _Side) -> tuple[tuple[ResponsePair, ...], tuple[str, ...]]:
    """Compares the responses of campaigns that both have, and says which cannot be."""
    found, notes = [], []
    theirs = other.opened.responses
    for name in (name for name in first.opened.responses if name in theirs):
        own, its = first.opened.responses[name], theirs[name]
        try:
            found.append(ResponsePair(name, own, Compared(f"{other.label}/{name}", its, compare(own, its))))
        except DataError as error:
            notes.append(f"responses {name} are not compared: {error.what}")
    return tuple(found), tuple(notes)


def _told(pair: FitPair) -> FitsTold:
    first, other = (
        FitTold(side.run, side.name, side.kind, side.grade, side.sentence) for side in (pair.first, pair.other)
    )
    return FitsTold(first, other, pair.parameters, *pair.alone)


def _shown(pair: FitPair) -> Group:
    """Grades and parameters of two fits, those that differ first in bold words."""
    heads = [head.format(first=pair.first.run, other=pair.other.run) for head in PARAMETER_COLUMNS]
    leaves = {head: place for place, head in enumerate(LEAVES, 1)}
    columns = [
        Column(head, numbers=0 < place < len(heads) - 1, leaves=leaves.get(raw, 0))
        for place, (head, raw) in enumerate(zip(heads, PARAMETER_COLUMNS, strict=True))
    ]
    grades = [f"{side.run}, fit {side.name}: {side.sentence}" for side in (pair.first, pair.other)]
    if not pair.parameters:
        return Group(Footnotes(grades, style=""))
    table = TerminalTable(columns, elsewhere="in `--json`, on the page of `--output`")
    shown = [each for each in pair.parameters if not each.is_nuisance]
    for each in shown:
        table.add(*parameter_cells(each), difference_word(each))
    along = len(pair.parameters) - len(shown)
    told = [f"{along} more, of friction and ripple, are in `--json` and on the page"] if along else []
    told += [CAPTION.format(limit=pair.parameters[0].limit)]
    alone = zip((pair.first.run, pair.other.run), pair.alone, strict=True)
    told += [f"{run} alone estimates {', '.join(names)}" for run, names in alone if names]
    return Group(Footnotes(grades, style=""), table, Footnotes(told, style=""))
