"""validate: a fitted model on a campaign that its fit never saw."""

from __future__ import annotations

from dataclasses import replace

from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.model import MODEL
from robid.artifacts.record import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.artifacts.truth import read_truth
from robid.artifacts.validation import VALIDATION
from robid.families.family import Data, family_of
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings
from robid.settings.load import LoadedExperiment
from robid.settings.slices import to_plain
from robid.stages.fit import data_inputs, graded
from robid.stages.stage import Job, Plan, Stage


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(name for name, fit in experiment.fits.items() if fit.validate_on is not None)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    campaign = fit.validate_on or fit.campaign
    settings = {f"fits.{owner}": to_plain(fit), **family.decides(loaded, fit.campaign)}
    settings |= {f"campaigns.{campaign}.payload_kg": loaded.experiment.campaigns[campaign].payload_kg}
    inputs = {"model": f"fits/{owner}/model.h5", **data_inputs(family.reads, (campaign,)), **truth_input(loaded, fit)}
    return Plan((f"fits/{owner}/validation.h5",), settings, inputs)


def truth_input(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, str]:
    """Returns where the truth of a fit's campaign and its record lie; a measured robot has none."""
    source = loaded.experiment.campaigns[fit.campaign].source
    simulated = source is not None and source.simulate is not None
    return {"truth": f"{fit.campaign}/truth.json", "true_record": f"{fit.campaign}/record.h5"} if simulated else {}


def _run(job: Job) -> str:
    family, inputs = family_of(job.loaded, job.owner), job.inputs
    frf = frf_from_artifact(read_artifact(inputs["frf"], FRF)) if "frf" in inputs else None
    records = (record_from_artifact(read_artifact(inputs["record"], RECORD)),) if "record" in inputs else ()
    true = read_truth(inputs["truth"], inputs["true_record"]) if "truth" in inputs else None
    found = family.validate(Data(job.loaded, job.owner, frf, records), read_artifact(inputs["model"], MODEL), true)
    made = replace(found, provenance=job.provenance(STAGE.name))
    write_artifact(job.output, made)
    return family.verdict(made)


STAGE = Stage(
    "validate",
    "Holds a fitted model against a campaign that its fit never saw.",
    "fit",
    VALIDATION,
    _owners,
    _plan,
    _run,
    grade=lambda _loaded, _owner, output: graded(output),
)
