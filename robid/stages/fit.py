"""fit: the parameters of a model from frequency responses or records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.model import MODEL
from robid.artifacts.record import RECORD, record_from_artifact
from robid.artifacts.store import inspect_artifact, read_artifact, write_artifact
from robid.families.family import Data, Graded, Work, family_of
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.settings.experiment import Experiment
from robid.settings.fits import Read
from robid.settings.load import LoadedExperiment
from robid.settings.slices import to_plain
from robid.signals.record import Record
from robid.stages.stage import Job, Plan, Stage


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(experiment.fits)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    plain = {key: value for key, value in to_plain(fit).items() if key != "validate_on"}
    settings = {f"fits.{owner}": plain, **family.decides(loaded, fit.campaign)}
    return Plan((f"fits/{owner}/model.h5",), settings, data_inputs(family.reads, fit.campaigns))


def data_inputs(reads: Sequence[Read], campaigns: Sequence[str]) -> dict[str, str]:
    """Returns where the responses and records of campaigns lie; the first one's name is its kind."""
    return {
        f"{kind}_{name}" if index else kind: f"{name}/{kind}.h5"
        for kind in reads
        for index, name in enumerate(campaigns)
    }


def read_data(loaded: LoadedExperiment, name: str, inputs: Mapping[str, Path]) -> Data:
    """Reads what a fit is fitted to."""
    fit, reads = loaded.experiment.fits[name], family_of(loaded, name).reads
    responses, records = (
        [inputs[key] for key in data_inputs([each for each in reads if each == kind], fit.campaigns)]
        for kind in ("frf", "record")
    )
    frfs = [frf_from_artifact(read_artifact(path, FRF)) for path in responses]
    return data_of(loaded, name, frfs, tuple(record_from_artifact(read_artifact(path, RECORD)) for path in records))


def data_of(loaded: LoadedExperiment, name: str, frfs: Sequence[Frf], records: tuple[Record, ...] = ()) -> Data:
    """Joins the responses of a fit's campaigns and selects its configurations."""
    fit = loaded.experiment.fits[name]
    if not frfs:
        return Data(loaded, name, None, records, fit.configurations or ())
    frf = frfs[0] if len(frfs) == 1 else join(frfs, fit.campaigns)
    if fit.configurations is None:
        return Data(loaded, name, frf, records, tuple(range(len(frf.configurations))))
    return Data(loaded, name, frf.select(fit.configurations), records, fit.configurations)


def _run(job: Job) -> str:
    family, data = family_of(job.loaded, job.owner), read_data(job.loaded, job.owner, job.inputs)
    model = family.fit(data, Work(job.map, job.progress))
    made = replace(model, provenance=job.provenance(STAGE.name, family.seed(data.settings)))
    write_artifact(job.output, made)
    return family.phrase(made)


def graded(path: Path) -> Graded | None:
    """Reads the grade that an artifact holds."""
    attributes = inspect_artifact(path)["attributes"]
    if "grade/value" not in attributes:
        return None
    return Graded(int(attributes["grade/value"]), str(attributes["grade/sentence"]))


def _grade(loaded: LoadedExperiment, owner: str, output: Path) -> Graded | None:
    """Where a fit is validated, the validation owns the grade."""
    return graded(output) if loaded.experiment.fits[owner].validate_on is None else None


def _problem(output: Path) -> str:
    attributes = inspect_artifact(output)["attributes"]
    if attributes["status"] == "converged":
        return ""
    return f"the fit has not converged ({attributes['status']}): {attributes['advice']}"


STAGE = Stage(
    "fit",
    "Fits a model to frequency responses.",
    "fit",
    MODEL,
    _owners,
    _plan,
    _run,
    _problem,
    grade=_grade,
)
