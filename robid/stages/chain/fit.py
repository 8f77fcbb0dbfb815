"""fit: the parameters of a model from frequency responses or records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robid.artifacts.results import MODEL
from robid.artifacts.store import inspect_artifact, read_artifact
from robid.models.family import Graded, family_of
from robid.stages.stage import Job, Plan, Stage

if TYPE_CHECKING:
    from robid.settings.experiment import Experiment
    from robid.settings.fits import FitSettings, Read
    from robid.settings.load import LoadedExperiment


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(experiment.fits)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit, family = loaded.experiment.fits[owner], family_of(loaded, owner)
    plain = {key: value for key, value in loaded.plain["fits"][owner].items() if key != "validate_on"}
    settings = {f"fits.{owner}": plain, **family.decides(loaded, fit.campaign), **payloads(loaded, fit)}
    inputs = {**data_inputs(family.reads, fit.campaigns), **taken_inputs(fit)}
    return Plan((f"fits/{owner}/model.h5",), settings, inputs)


def taken_inputs(fit: FitSettings) -> dict[str, str]:
    """Returns where the models of the fits lie that a fit takes something of, by what it takes."""
    return {what: f"fits/{name}/model.h5" for what, name in fit.takes.items()}


def payloads(loaded: LoadedExperiment, fit: FitSettings) -> dict[str, float | None]:
    """Returns the payloads of a fit's campaigns, where they may differ."""
    if not fit.takes_payloads:
        return {}
    return {f"campaigns.{name}.payload_kg": loaded.experiment.campaigns[name].payload_kg for name in fit.campaigns}


def data_inputs(reads: Sequence[Read], campaigns: Sequence[str]) -> dict[str, str]:
    """Returns where the responses and records of campaigns lie; the first one's name is its kind."""
    return {
        f"{kind}_{name}" if index else kind: f"{name}/{kind}.h5"
        for kind in reads
        for index, name in enumerate(campaigns)
    }


def read_grade(path: Path) -> Graded:
    """Reads the grade that an artifact holds."""
    attributes = inspect_artifact(path)["attributes"]
    return Graded(int(attributes["grade/value"]), str(attributes["grade/sentence"]))


def _grade(loaded: LoadedExperiment, owner: str, output: Path) -> Graded | None:
    """Where a fit is validated, the validation owns the grade."""
    return read_grade(output) if loaded.experiment.fits[owner].validate_on is None else None


def _problem(output: Path) -> str:
    attributes = inspect_artifact(output)["attributes"]
    status, advice = (attributes[f"estimate/{name}"] for name in ("status", "advice"))
    return "" if status == "converged" else f"the fit has not converged ({status}): {advice}"


def _run(job: Job) -> str:
    from robid.stages.fit import run

    return run(job)


def _phrase(loaded: LoadedExperiment, owner: str, output: Path) -> str:
    return family_of(loaded, owner).phrase(read_artifact(output, MODEL))


STAGE = Stage(
    "fit",
    "Fits a model to frequency responses.",
    "fit",
    MODEL,
    _owners,
    _plan,
    _run,
    _phrase,
    problem=_problem,
    grade=_grade,
)
