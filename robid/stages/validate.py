"""validate: a fitted model on a campaign that its fit never saw."""

from __future__ import annotations

from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.model import MODEL, grade_from_artifact, model_from_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.artifacts.truth import read_truth
from robid.artifacts.validation import VALIDATION, validation_to_artifact
from robid.families.elastic.settings import elastic_fit
from robid.families.elastic.truth import true_values
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.settings.slices import to_plain
from robid.stages.fit import graded, model_settings
from robid.stages.stage import Job, Plan, Stage
from robid.validation.elastic import Validation, validate_elastic
from robid.validation.recovery import recovery_sentence


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(name for name, fit in experiment.fits.items() if fit.validate_on is not None)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit = loaded.experiment.fits[owner]
    settings = {f"fits.{owner}": to_plain(fit), **model_settings(loaded, fit.campaign)}
    settings |= {f"campaigns.{fit.validate_on}.payload_kg": _validation_payload(loaded, fit)}
    inputs = {"model": f"fits/{owner}/model.h5", "frf": f"{fit.validate_on}/frf.h5", **truth_input(loaded, fit)}
    return Plan((f"fits/{owner}/validation.h5",), settings, inputs)


def truth_input(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, str]:
    """Returns where the truth of a fit's campaign and its record lie; a measured robot has none."""
    source = loaded.experiment.campaigns[fit.campaign].source
    simulated = source is not None and source.simulate is not None
    return {"truth": f"{fit.campaign}/truth.json", "record": f"{fit.campaign}/record.h5"} if simulated else {}


def _validation_payload(loaded: LoadedExperiment, fit: FitSettings) -> float | None:
    return None if fit.validate_on is None else loaded.experiment.campaigns[fit.validate_on].payload_kg


def _run(job: Job) -> str:
    fit = elastic_fit(job.loaded.experiment, job.owner)
    model = read_artifact(job.inputs["model"], MODEL)
    alone = grade_from_artifact(model)
    validation = validate_elastic(
        job.loaded.robot.to_robot(_validation_payload(job.loaded, fit)),
        model_from_artifact(model),
        frf_from_artifact(read_artifact(job.inputs["frf"], FRF)),
        fit.options(),
        delay_s(job.loaded, job.loaded.experiment.campaigns[fit.campaign]),
        _true_values(job, fit),
        () if alone is None else alone.doubts,
        str(fit.validate_on),
    )
    write_artifact(job.output, validation_to_artifact(validation, job.provenance(STAGE.name)))
    return figures(validation)


def _true_values(job: Job, fit: FitSettings) -> dict[str, float] | None:
    if "truth" not in job.inputs:
        return None
    nominal = job.loaded.robot.to_robot(job.loaded.experiment.campaigns[fit.campaign].payload_kg)
    return true_values(nominal, read_truth(job.inputs["truth"], job.inputs["record"]))


def figures(validation: Validation) -> str:
    """Says whether the model holds, in a sentence or two."""
    known = recovery_sentence(validation.springs_within, validation.springs_known, validation.coverage)
    return f"{validation.verdict}. {known}" if known else validation.verdict


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
