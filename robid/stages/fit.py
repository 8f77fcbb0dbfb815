"""fit: the parameters of a model from frequency responses or records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, write_artifact
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.models.family import Data, Work, family_of
from robid.settings.fits import FitSettings, HandedOn
from robid.settings.load import LoadedExperiment
from robid.signals.record import Record
from robid.stages.chain.fit import STAGE, data_inputs
from robid.stages.stage import Job


def read_data(loaded: LoadedExperiment, name: str, inputs: Mapping[str, Path]) -> Data:
    """Reads what a fit is fitted to."""
    fit, reads = loaded.experiment.fits[name], family_of(loaded, name).reads
    responses, records = (
        [inputs[key] for key in data_inputs([each for each in reads if each == kind], fit.campaigns)]
        for kind in ("frf", "record")
    )
    frfs = [frf_from_artifact(read_artifact(path, FRF)) for path in responses]
    data = data_of(loaded, name, frfs, tuple(record_from_artifact(read_artifact(path, RECORD)) for path in records))
    return replace(data, taken=read_taken(fit, inputs))


def read_taken(fit: FitSettings, inputs: Mapping[str, Path]) -> dict[HandedOn, Artifact]:
    """Reads the models of the fits that a fit takes something of, by what it takes."""
    return {what: read_artifact(inputs[what], MODEL) for what in fit.takes}


def data_of(loaded: LoadedExperiment, name: str, frfs: Sequence[Frf], records: tuple[Record, ...] = ()) -> Data:
    """Joins the responses of a fit's campaigns and selects its configurations."""
    fit = loaded.experiment.fits[name]
    if not frfs:
        return Data(loaded, name, None, records, fit.configurations or ())
    frf = frfs[0] if len(frfs) == 1 else join(frfs, fit.campaigns)
    of_each = [name for name, one in zip(fit.campaigns, frfs, strict=True) for _ in one.configurations]
    chosen = tuple(range(len(of_each))) if fit.configurations is None else fit.configurations
    origins = tuple(of_each[index] for index in chosen)
    selected = frf if fit.configurations is None else frf.select(chosen)
    return Data(loaded, name, selected, records, chosen, origins=origins)


def run(job: Job) -> str:
    """Fits a model; returns its key figures."""
    family, data = family_of(job.loaded, job.owner), read_data(job.loaded, job.owner, job.inputs)
    model = family.fit(data, Work(job.map, job.progress))
    made = replace(model, provenance=job.provenance(STAGE.name, family.seed(data.settings)))
    write_artifact(job.output, made)
    return family.phrase(made)
