"""validate: a fitted model on a campaign that its fit never saw."""

from __future__ import annotations

from dataclasses import replace

from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, write_artifact
from robid.artifacts.truth import read_truth
from robid.models.family import Data, family_of
from robid.stages.chain.validate import STAGE
from robid.stages.copies import refuse_copies
from robid.stages.fit import read_taken
from robid.stages.stage import Job


def run(job: Job) -> str:
    """Validates a model; returns what it found."""
    family, inputs = family_of(job.loaded, job.owner), job.inputs
    fit = job.loaded.experiment.fits[job.owner]
    refuse_copies(fit, {name: inputs[f"seen_{name}"] for name in fit.campaigns}, inputs["new_record"])
    frf = frf_from_artifact(read_artifact(inputs["frf"], FRF)) if "frf" in inputs else None
    records = (record_from_artifact(read_artifact(inputs["record"], RECORD)),) if "record" in inputs else ()
    true = read_truth(inputs["truth"], inputs["true_record"]) if "truth" in inputs else None
    taken = read_taken(fit, inputs)
    data = Data(job.loaded, job.owner, frf, records, taken=taken)
    found = family.validate(data, read_artifact(inputs["model"], MODEL), true)
    made = replace(found, provenance=job.provenance(STAGE.name))
    write_artifact(job.output, made)
    return family.verdict(made)
