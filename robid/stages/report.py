"""report: one page from all artifacts of a run, and its numbers as JSON."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path

from robid.artifacts.artifact import Provenance
from robid.artifacts.atomic import replacing, write_json
from robid.errors import ArtifactError
from robid.report.content import ReportContent
from robid.report.page import render
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import assumed_names
from robid.settings.robot_parts import delay_s, robot_settings
from robid.settings.slices import to_plain
from robid.stages import design_configs, design_excitation, estimate_frf, fit, simulate_or_acquire, validate
from robid.stages.report_content import gather
from robid.stages.stage import Job, Plan, Stage, counted, measured_campaigns
from robid.stages.summary import summarize

CHAIN = (
    design_configs.STAGE,
    design_excitation.STAGE,
    simulate_or_acquire.STAGE,
    estimate_frf.STAGE,
    fit.STAGE,
    validate.STAGE,
)
_STAMP = re.compile(r'<script type="application/json" id="provenance">(.*?)</script>', re.DOTALL)


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return (experiment.name,)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    experiment, robot = loaded.experiment, loaded.robot
    settings = {
        "name": owner,
        "robot.name": robot.name,
        "robot.notes": list(robot.notes),
        "robot.assumed": list(assumed_names(robot)),
        "fits": to_plain(experiment.fits),
        **robot_settings(loaded, "mechanics"),
    }
    for name in measured_campaigns(experiment):
        campaign = experiment.campaigns[name]
        settings[f"campaigns.{name}"] = {"payload_kg": campaign.payload_kg, "delay_s": delay_s(loaded, campaign)}
    inputs = {
        path: path
        for stage in CHAIN
        for name in stage.owners(experiment)
        if not stage.on_request(loaded, name)
        for path in stage.plan(loaded, name).outputs
    }
    return Plan(("report.html", "summary.json"), settings, inputs)


def _run(job: Job) -> str:
    gathered = gather(job.loaded, job.folder, job.inputs)
    write_json(job.output.with_name("summary.json"), summarize(gathered))
    write_page(job.output, gathered.content, job.provenance(STAGE.name))
    return counted(len(gathered.fits), "fit")


def write_page(path: Path, content: ReportContent, provenance: Provenance) -> None:
    """Writes a report that says how it came about, see `read_stamp`."""
    stamp = json.dumps(asdict(provenance), sort_keys=True).replace("<", "\\u003c")
    mark = f'<script type="application/json" id="provenance">{stamp}</script>\n'
    page = render(content).replace("</body>", f"{mark}</body>", 1)
    with replacing(path) as partial:
        partial.write_text(page, encoding="utf-8")


def read_stamp(path: Path) -> Provenance:
    """Reads how a report came about.

    Raises:
        ArtifactError: If the page does not say it, or cannot be read.
    """
    remedy = "move it away; `robid report EXPERIMENT.yaml` makes it again"
    try:
        found = _STAMP.findall(path.read_text(encoding="utf-8"))
        if found:
            return Provenance(**json.loads(found[-1]))
    except (OSError, ValueError, TypeError) as error:
        raise ArtifactError(f"The page is damaged: {error}.", where=str(path), remedy=remedy) from error
    raise ArtifactError("The page does not say what it was made from.", where=str(path), remedy=remedy)


STAGE = Stage(
    "report",
    "Puts everything on one page, and its numbers into summary.json.",
    "experiment",
    None,
    _owners,
    _plan,
    _run,
    takes_what_is_there=True,
)
