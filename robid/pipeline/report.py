"""report: one page from all artifacts of a run, and its numbers as JSON."""

from __future__ import annotations

from pathlib import Path

from robid.artifacts.artifact import Provenance
from robid.artifacts.atomic import replacing, write_json
from robid.pipeline.chain.report import NAME
from robid.pipeline.report_content import gather
from robid.pipeline.stage import Job, Stage, counted
from robid.pipeline.stamp import stamped
from robid.pipeline.summary import summarize
from robid.report.content import ReportContent
from robid.report.page import render


def run(job: Job, chain: tuple[Stage, ...]) -> str:
    """Writes the page and its numbers on what these stages have made; returns what is on it."""
    gathered = gather(job.loaded, job.folder, job.inputs, chain)
    write_json(job.output.with_name("summary.json"), summarize(gathered))
    write_page(job.output, gathered.content, job.provenance(NAME))
    responses = sum(path.name == "frf.h5" for path in job.inputs.values())
    return counted(len(gathered.fits), "fit") if gathered.fits else f"responses of {counted(responses, 'campaign')}"


def write_page(path: Path, content: ReportContent, provenance: Provenance) -> None:
    """Writes a report that says how it came about, see `read_stamp`."""
    with replacing(path) as partial:
        partial.write_text(stamped(render(content), provenance), encoding="utf-8")
