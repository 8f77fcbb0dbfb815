"""The page of a fleet: failures by cause, and every parameter over the robots with its intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from statistics import median
from typing import Any, Literal

from robid.artifacts.artifact import Provenance
from robid.artifacts.provenance import canonical_hash, git_commit, package_versions, utc_now
from robid.errors import ArtifactError
from robid.fleet.ledger import Ledger
from robid.report.content import ReportContent, Verdict
from robid.report.numbers import MISSING, percent, scale_for
from robid.report.parameters import kind_title
from robid.report.section import Choice, ColumnStyle, Curve, Figure, Line, Section, Table
from robid.robot.parameters import DOUBT, NUISANCE
from robid.stages.replacing import check_replaceable
from robid.stages.report import write_page
from robid.stages.stage import counted
from robid.stages.stamp import read_stamp
from robid.validation.grade import WORDS

_STAGE = "reprocess"
_SHOWN_ROWS = 12
_FEW_ROBOTS = 40


def causes(ledgers: Iterable[Ledger]) -> list[tuple[str, str, str, list[str]]]:
    """Groups failures by kind and message, the most frequent first: kind, message, remedy and ids."""
    found: dict[tuple[str, str], tuple[str, list[str]]] = {}
    for ledger in ledgers:
        if ledger.error is not None:
            error = ledger.error
            found.setdefault((error.kind, error.message), (error.remedy, []))[1].append(ledger.id)
    groups = [(kind, message, remedy, ids) for (kind, message), (remedy, ids) in found.items()]
    return sorted(groups, key=lambda group: -len(group[3]))


def write_report(path: Path, name: str, ledgers: Sequence[Ledger]) -> Literal["made", "fresh"]:
    """Writes the page unless the one that is there says the same.

    Args:
        path: Where to.
        name: Name of the experiment.
        ledgers: What became of each row, in the order of the manifest.
    """
    shown = [[ledger.id, ledger.error and str(ledger.error), ledger.grades, ledger.results] for ledger in ledgers]
    settings, now = {"name": name}, utc_now()
    provenance = Provenance(
        stage=_STAGE,
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs={"rows": canonical_hash(shown)},
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=now,
        finished_utc=now,
    )
    if _is_fresh(path, provenance):
        return "fresh"
    check_report(path)
    write_page(path, report_content(name, ledgers), provenance)
    return "made"


def check_report(path: Path) -> None:
    """Refuses to replace what is no report.

    Raises:
        ArtifactError: If it is none.
    """
    check_replaceable(path, "report", {})


def _is_fresh(path: Path, now: Provenance) -> bool:
    try:
        made = read_stamp(path)
    except ArtifactError:
        return False
    return (made.stage, made.settings_hash, made.inputs) == (now.stage, now.settings_hash, now.inputs)


def report_content(name: str, ledgers: Sequence[Ledger]) -> ReportContent:
    """Lays out the page of a fleet."""
    failed = [ledger for ledger in ledgers if ledger.error is not None]
    unusable = sum(any(value == 0 for value, _ in ledger.grades.values()) for ledger in ledgers)
    texts = [f"{len(ledgers) - len(failed)} of {counted(len(ledgers), 'row')} done"]
    texts += [f"{len(failed)} failed"] if failed else []
    texts += [f"{unusable} graded do not use"] if unusable else []
    level: Literal["ok", "warn"] = "warn" if failed or unusable else "ok"
    return ReportContent(
        title=name,
        verdict=Verdict(f"{'; '.join(texts)}.", level),
        robot=counted(len(ledgers), "row"),
        sections=(*_failures(failed), *_parameters(ledgers), *_grades(ledgers)),
    )


def _failures(failed: Sequence[Ledger]) -> tuple[Section, ...]:
    if not failed:
        return ()
    rows = tuple((kind, str(len(ids)), message, remedy, listed(ids)) for kind, message, remedy, ids in causes(failed))
    columns = ("Kind", "Rows", "What is wrong", "What to do", "Which")
    table = Table(columns, rows, styles=("name", "number", "prose", "prose", "prose"))
    return (Section("Failures by cause", "Where each is wrong stands in its row.json and in the table.", (table,)),)


def _parameters(ledgers: Sequence[Ledger]) -> tuple[Section, ...]:
    """One section a fit: a table of all parameters, and the robots of the one that the reader chooses."""
    found: dict[str, dict[str, dict[str, Mapping[str, Any]]]] = {}
    for ledger in ledgers:
        for entry in ledger.results:
            if entry["kind"] not in (DOUBT, NUISANCE):
                found.setdefault(entry["fit"], {}).setdefault(entry["parameter"], {})[ledger.id] = entry
    lead = (
        "The parameter itself with its interval, which holds what the robot file may have wrong, in the order of the"
        " manifest; the line is the robot file's value."
    )
    return tuple(
        Section(
            f"Parameters over robots, fit {fit}" if len(found) > 1 else "Parameters over robots",
            lead,
            (
                _table(parameters),
                Choice("Parameter", tuple((name, (_figure(name, of),)) for name, of in parameters.items())),
            ),
        )
        for fit, parameters in found.items()
    )


def _table(parameters: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Table:
    rows = []
    for name, robots in parameters.items():
        values = [_middle(entry) for entry in robots.values()]
        centre, first = median(values), next(iter(robots.values()))
        scale = scale_for(centre, first["unit"] if first["unit"] != "1" else "", (max(values) - min(values)) / 2)
        widths = [(entry["physical_high"] - entry["physical_low"]) / 2 for entry in robots.values() if _bounded(entry)]
        half = percent(median(widths) / abs(centre)) if widths and centre else MISSING
        numbers = (scale.text(each) for each in (first["nominal"], centre, min(values), max(values)))
        rows.append((name, kind_title(first["kind"]), scale.unit, str(len(robots)), *numbers, half))
    columns = ("Parameter", "Kind", "Unit", "Robots", "Robot file", "Median", "Lowest", "Highest", "Half interval")
    styles: tuple[ColumnStyle, ...] = (
        "name",
        "text",
        "text",
        "number",
        "number",
        "number",
        "number",
        "number",
        "number",
    )
    return Table(columns, tuple(rows), styles=styles, fit="compact")


def _figure(name: str, robots: Mapping[str, Mapping[str, Any]]) -> Figure:
    entries = list(robots.values())
    unit = "" if entries[0]["unit"] == "1" else f" [{entries[0]['unit']}]"
    middles, gap = [_middle(entry) for entry in entries], math.nan
    ends = [
        (entry["physical_low"], entry["physical_high"], gap) if _bounded(entry) else (gap,) * 3 for entry in entries
    ]
    places = tuple(float(place) for place in range(len(entries)))
    level = entries[0]["confidence"]
    nominal = {entry["nominal"] for entry in entries}
    return Figure(
        title=name,
        x_title="Robot",
        y_title=f"{kind_title(entries[0]['kind'])}{unit}",
        curves=(
            Curve("estimated", places, tuple(middles), _texts(robots), points=True, shade=0),
            Curve(
                f"{percent(level)} interval",
                tuple(place for place in places for _ in range(3)),
                tuple(chain(*ends)),
                shade=0,
            ),
        ),
        log_x=False,
        log_y=False,
        x_labels=tuple(robots) if len(robots) <= _FEW_ROBOTS else (),
        lines=tuple(Line("y", each, "robot file") for each in nominal if each is not None) if len(nominal) == 1 else (),
    )


def _texts(robots: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """What is said of each robot's point."""
    found = []
    for name, entry in robots.items():
        half = (entry["physical_high"] - entry["physical_low"]) / 2 if _bounded(entry) else None
        scale = scale_for(_middle(entry), entry["unit"] if entry["unit"] != "1" else "", half)
        ends = f", {scale.text(entry['physical_low'])} to {scale.text(entry['physical_high'])}" if half else ""
        found.append(f"{name}: {scale.text(_middle(entry))}{ends} {scale.unit}")
    return tuple(found)


def _middle(entry: Mapping[str, Any]) -> float:
    """The physical value; a parameter that follows another one has its estimate alone."""
    value = entry.get("physical")
    return float(entry["estimate"] if value is None else value)


def _bounded(entry: Mapping[str, Any]) -> bool:
    return entry["physical_low"] is not None and entry["physical_high"] is not None


def _grades(ledgers: Sequence[Ledger]) -> tuple[Section, ...]:
    """How many robots have which grade, and why not a better one."""
    found: dict[tuple[int, str], list[str]] = {}
    for ledger in ledgers:
        for value, sentence in ledger.grades.values():
            found.setdefault((value, sentence), []).append(ledger.id)
    if not found:
        return ()
    ordered = sorted(found.items(), key=lambda item: (item[0][0], -len(item[1])))
    rows = tuple((WORDS[value], str(len(ids)), sentence, listed(ids)) for (value, sentence), ids in ordered)
    table = Table(("Grade", "Robots", "Why", "Which"), rows, styles=("name", "number", "prose", "prose"))
    return (Section("Grades", "The worst first.", (table,)),)


def listed(ids: Sequence[str]) -> str:
    """Names some rows, the first of many."""
    more = f" and {len(ids) - _SHOWN_ROWS} more" if len(ids) > _SHOWN_ROWS else ""
    return ", ".join(ids[:_SHOWN_ROWS]) + more
