"""estimate-frf: frequency responses of a campaign from its record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from robid.artifacts.kinds import FRF
from robid.models.family import family_of
from robid.settings.robot_parts import delay_s, robot_settings
from robid.stages.stage import Job, Plan, Stage, responding_campaigns

if TYPE_CHECKING:
    from robid.settings.load import LoadedExperiment


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    campaign = loaded.experiment.campaigns[owner]
    settings: dict[str, Any] = {f"campaigns.{owner}.estimate": loaded.plain["campaigns"][owner]["estimate"]}
    if campaign.estimate.compensation != "none":
        settings |= {"delay_s": delay_s(loaded, campaign), **robot_settings(loaded, "friction", "friction_std")}
    inputs = {"record": f"{owner}/record.h5"}
    if campaign.estimate.friction_fit is not None:
        inputs["friction"] = f"fits/{campaign.estimate.friction_fit}/model.h5"
    return Plan((f"{owner}/frf.h5",), settings, inputs)


def _on_request(loaded: LoadedExperiment, owner: str) -> bool:
    """Whether fits read the campaign's record, and nothing reads its response."""
    experiment = loaded.experiment
    reads = {
        kind
        for name, fit in experiment.fits.items()
        if owner in (*fit.campaigns, fit.validate_on)
        for kind in family_of(loaded, name).reads
    }
    designs = [design for design in experiment.designs.values() if design.information == "measured"]
    return "record" in reads and "frf" not in reads and owner not in [design.campaign for design in designs]


def _run(job: Job) -> str:
    from robid.stages.estimate_frf import run

    return run(job)


def _phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    from robid.stages.estimate_frf import phrase

    return phrase(output)


STAGE = Stage(
    "estimate-frf",
    "Estimates frequency responses with their covariance from a record.",
    "campaign",
    FRF,
    responding_campaigns,
    _plan,
    _run,
    _phrase,
    on_request=_on_request,
)
