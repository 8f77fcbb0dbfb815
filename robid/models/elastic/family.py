"""The elastic family: springs and dampers from frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robid.models.elastic.exports import EXPORTS
from robid.models.elastic.settings import ElasticFit, model_settings, problems
from robid.models.family import Data, Family, Shown, Work

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.report.page import FitReport
    from robid.settings.load import LoadedExperiment
    from robid.simulate.truth import TrueRobot


def _fit(data: Data, work: Work) -> Artifact:
    from robid.models.elastic.fitting import fit

    return fit(data, work)


def _free_too(loaded: LoadedExperiment, name: str, more: Sequence[str]) -> LoadedExperiment:
    from robid.models.elastic.freed import free_too

    return free_too(loaded, name, more)


def _refit(data: Data, model: Artifact, work: Work) -> Artifact:
    from robid.models.elastic.fitting import refit

    return refit(data, model, work)


def _validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    from robid.models.elastic.fitting import validate

    return validate(data, model, true)


def _true_values(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    from robid.models.elastic.fitting import values_in

    return values_in(loaded, name, true)


def _phrase(model: Artifact) -> str:
    from robid.models.elastic.fitting import phrase_of_model

    return phrase_of_model(model)


def _verdict(validation: Artifact) -> str:
    from robid.models.elastic.fitting import verdict_of_validation

    return verdict_of_validation(validation)


def _report(shown: Shown) -> FitReport:
    from robid.models.elastic.page.report import report

    return report(shown)


def _compare(every: Sequence[Shown]) -> dict[str, float]:
    from robid.models.elastic.page.report import compare

    return compare(every)


def _misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    from robid.models.elastic.files import solution_from_artifact, validation_from_artifact

    found = {"misfit": solution_from_artifact(model).misfit}
    if validation is not None:
        found["misfit of the validation"] = validation_from_artifact(validation).cost_ratio
    return found


ELASTIC = Family(
    name="elastic",
    settings=ElasticFit,
    reads=("frf",),
    problems=problems,
    decides=model_settings,
    fit=_fit,
    validate=_validate,
    seed=lambda settings: settings.seed if isinstance(settings, ElasticFit) else None,
    true_values=_true_values,
    phrase=_phrase,
    verdict=_verdict,
    report=_report,
    compare=_compare,
    exports=EXPORTS,
    free_too=_free_too,
    refit=_refit,
    misfits=_misfits,
)
