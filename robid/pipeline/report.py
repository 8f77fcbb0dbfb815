"""report: one page from all artifacts of a run, and its numbers as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robid.artifacts.artifact import Provenance
from robid.artifacts.atomic import replacing, write_json
from robid.pipeline.freshness import stamped
from robid.pipeline.report_content import RunContent, gather
from robid.pipeline.stage import Job, Stage, counted
from robid.report.page import ReportContent, render


def run(chain: Sequence[Stage], job: Job) -> str:
    """Writes the page and its numbers on what a chain of stages has made; returns what is on it."""
    gathered = gather(chain, job.loaded, job.folder, job.inputs)
    write_json(job.output.with_name("summary.json"), summarize(gathered))
    write_page(job.output, gathered.content, job.provenance())
    responses = sum(path.name == "frf.h5" for path in job.inputs.values())
    return counted(len(gathered.fits), "fit") if gathered.fits else f"responses of {counted(responses, 'campaign')}"


def write_page(path: Path, content: ReportContent, provenance: Provenance) -> None:
    """Writes a report that says how it came about, see `read_stamp`."""
    with replacing(path) as partial:
        partial.write_text(stamped(render(content), provenance), encoding="utf-8")


def summarize(gathered: RunContent) -> dict[str, float]:
    """Returns everything that a run says in numbers, in SI units."""
    found: dict[str, float] = {}
    for name, design in gathered.designs.items():
        found |= {f"designs.{name}.efficiency": design.efficiency, f"designs.{name}.gap": design.gap}
        found[f"designs.{name}.average_std"] = float(design.predicted_relative_std.mean())
        if design.stability is not None:
            found[f"designs.{name}.chosen_again"] = float(design.stability.kept.mean())
    for row in gathered.excitations:
        found[f"campaigns.{row.campaign}.measuring_time_s"] = row.duration_s
        found[f"campaigns.{row.campaign}.lines"] = row.lines
    for fit in gathered.fits:
        found |= {f"fits.{fit.headline.name}.{key}": value for key, value in fit.summary.items()}
    return found | gathered.responses | gathered.comparison
