"""fit: the parameters of a model from frequency responses or records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from robid.artifacts.artifact import Artifact
from robid.artifacts.atomic import parts_of, remove_parts
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.parts import Parts
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import SettingsError
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.models.family import Data, Work, family_of
from robid.pipeline.plans import data_inputs
from robid.pipeline.stage import Job
from robid.settings.fits import FitSettings, HandedOn
from robid.settings.load import LoadedExperiment
from robid.signals.record import Record


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
    pairs = zip(fit.campaigns, frfs, strict=True)
    of_each = [(name, row) for name, one in pairs for row in range(len(one.configurations))]
    chosen = tuple(range(len(of_each))) if fit.configurations is None else fit.configurations
    origins, rows = (tuple(column) for column in zip(*(of_each[index] for index in chosen), strict=True))
    selected = frf if fit.configurations is None else frf.select(chosen)
    return Data(loaded, name, selected, records, chosen, origins=origins, rows=rows)


def run(job: Job) -> str:
    """Fits a model; returns its key figures."""
    family, data = family_of(job.loaded, job.owner), read_data(job.loaded, job.owner, job.inputs)
    kept = partial(Parts, job.output, key=job.key)
    model = family.fit(data, Work(job.map, job.progress, kept))
    made = replace(model, provenance=job.provenance(family.seed(data.settings)))
    write_artifact(job.output, made)
    remove_parts(parts_of(job.output))
    return family.phrase(made)


def phrase(loaded: LoadedExperiment, owner: str, output: Path) -> str:
    """Reads what a fit found, in a phrase."""
    return family_of(loaded, owner).phrase(read_artifact(output, MODEL))


@dataclass(frozen=True)
class Trial:
    """A fit and what it becomes."""

    before: Artifact  # the model of the fit
    after: Artifact  # the model with more freed
    torque_unit: str  # what stands for N m in both


def tried_experiment(loaded: LoadedExperiment, fit: str, names: Sequence[str]) -> LoadedExperiment:
    """Returns the experiment with more names in a fit's `free`.

    Raises:
        SettingsError: If the fit's family has nothing to free, or no robot has such a thing.
    """
    family = family_of(loaded, fit)
    if family.free_too is None:
        known = ", ".join(sorted(name for name, each in loaded.families.items() if getattr(each, "free_too", None)))
        message = f"S109 a fit of family `{family.name}` has nothing to try"
        raise SettingsError(message, where="--try", remedy=f"it belongs to fits of family {known}")
    return family.free_too(loaded, fit, names)


def try_fit(tried: LoadedExperiment, fit: str, inputs: Mapping[str, Path], work: Work) -> Trial:
    """Refits `tried_experiment` from the minimum found, in memory; inputs are those of the fit, and its `model`."""
    family, before = family_of(tried, fit), read_artifact(inputs["model"], MODEL)
    if family.refit is None:
        message = f"family {family.name} frees what it cannot fit"
        raise RuntimeError(message)
    data = read_data(tried, fit, {name: path for name, path in inputs.items() if name != "model"})
    unit = "N m" if data.frf is None else data.frf.input_unit
    return Trial(before, family.refit(data, before, work), unit)


def write_tried(trial: Trial, job: Job) -> None:
    """Writes the model with more freed; its settings say where it began, so that it is no fit's own."""
    job = replace(job, settings={**job.settings, "begun_at": "the minimum of another fit"})
    write_artifact(job.output, replace(trial.after, provenance=job.provenance()))
