"""The page of a fleet: failures by cause, outliers, drifts, populations, every parameter over the rows."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from robid.artifacts.artifact import Provenance, canonical_hash, git_commit, package_versions, utc_now
from robid.errors import ArtifactError
from robid.fleet.page.failures import failure_sections, grade_sections
from robid.fleet.page.found import Found
from robid.fleet.page.outliers import drift_sections, outlier_sections, population_sections
from robid.fleet.page.parameters import parameter_sections
from robid.pipeline.freshness import check_replaceable, read_stamp
from robid.pipeline.report import write_page
from robid.pipeline.stage import counted
from robid.report.page import ReportContent, Verdict

_STAGE = "reprocess"


def write_report(path: Path, found: Found) -> Literal["made", "fresh"]:
    """Writes the page unless the one that is there says the same."""
    content = report_content(found)
    provenance = provenance_of(found.name, {"content": hashlib.sha256(repr(content).encode()).hexdigest()})
    if _is_fresh(path, provenance):
        return "fresh"
    check_report(path)
    write_page(path, content, provenance)
    return "made"


def provenance_of(name: str, inputs: dict[str, str]) -> Provenance:
    """Returns where a page of an experiment's fleet comes from."""
    settings, now = {"name": name}, utc_now()
    return Provenance(
        stage=_STAGE,
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs=inputs,
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=now,
        finished_utc=now,
    )


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


def report_content(found: Found) -> ReportContent:
    """Lays out the page of a fleet."""
    comparison, rows = found.comparison, len(found.ledgers)
    failed = sum(ledger.error is not None for ledger in found.ledgers)
    unusable = sum(any(value == 0 for value, _ in ledger.grades.values()) for ledger in found.ledgers)
    off, changing = len(comparison.off), len(comparison.changing)
    counts = ((failed, "failed"), (off, "off the fleet"), (unusable, "graded do not use"))
    texts = [f"{rows - failed} of {counted(rows, 'row')} done"]
    texts += [f"{count} {what}" for count, what in counts if count]
    texts += [f"{counted(changing, 'robot')} drifting"] if changing else []
    level: Literal["ok", "warn"] = "warn" if failed or unusable or off or changing else "ok"
    robots = len(comparison.robots.names)
    return ReportContent(
        title=found.name,
        verdict=Verdict(f"{'; '.join(texts)}.", level),
        robot=counted(rows, "row") if robots == rows else f"{counted(rows, 'row')} of {counted(robots, 'robot')}",
        sections=(
            *failure_sections(found),
            *outlier_sections(found),
            *drift_sections(found),
            *population_sections(found),
            *parameter_sections(found),
            *grade_sections(found),
        ),
    )
