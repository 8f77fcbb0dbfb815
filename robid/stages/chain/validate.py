"""validate: a fitted model on a campaign that its fit never saw."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robid.artifacts.results import VALIDATION
from robid.artifacts.store import read_artifact
from robid.models.family import family_of
from robid.stages.chain.fit import data_inputs, payloads, read_grade, taken_inputs
from robid.stages.stage import Job, Plan, Stage

if TYPE_CHECKING:
    from robid.settings.experiment import Experiment
    from robid.settings.fits import FitSettings
    from robid.settings.load import LoadedExperiment


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(name for name, fit in experiment.fits.items() if fit.validate_on is not None)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    campaign = fit.validate_on or fit.campaign
    settings = {f"fits.{owner}": loaded.plain["fits"][owner], **family.decides(loaded, fit.campaign)}
    settings |= payloads(loaded, fit)
    settings |= {f"campaigns.{campaign}.payload_kg": loaded.experiment.campaigns[campaign].payload_kg}
    inputs = {"model": f"fits/{owner}/model.h5", **data_inputs(family.reads, (campaign,)), **truth_input(loaded, fit)}
    inputs |= taken_inputs(fit) | record_inputs(fit)
    return Plan((f"fits/{owner}/validation.h5",), settings, inputs)


def record_inputs(fit: FitSettings) -> dict[str, str]:
    """Returns where the records lie in which samples of the fit are looked for, whatever the family reads."""
    seen = {f"seen_{name}": f"{name}/record.h5" for name in fit.campaigns}
    return {**seen, "new_record": f"{fit.validate_on or fit.campaign}/record.h5"}


def truth_input(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, str]:
    """Returns where the truth of a fit's campaign and its record lie; a measured robot has none."""
    from robid.settings.experiment import heaviest

    campaign = heaviest(loaded.experiment, fit, loaded.robot)
    source = loaded.experiment.campaigns[campaign].source
    simulated = source is not None and source.simulate is not None
    return {"truth": f"{campaign}/truth.json", "true_record": f"{campaign}/record.h5"} if simulated else {}


def _run(job: Job) -> str:
    from robid.stages.validate import run

    return run(job)


def _phrase(loaded: LoadedExperiment, owner: str, output: Path) -> str:
    return family_of(loaded, owner).verdict(read_artifact(output, VALIDATION))


STAGE = Stage(
    "validate",
    "Holds a fitted model against a campaign that its fit never saw.",
    "fit",
    VALIDATION,
    _owners,
    _plan,
    _run,
    _phrase,
    grade=lambda _loaded, _owner, output: read_grade(output),
)
