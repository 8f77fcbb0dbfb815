"""The external family: transfer functions from commands to positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robid.models.external.exports import EXPORTS
from robid.models.external.settings import ExternalFit, model_settings, problems
from robid.models.family import Data, Family, Shown, Work

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.report.content import FitReport
    from robid.settings.fits import FitSettings
    from robid.settings.load import LoadedExperiment
    from robid.simulate.truth import TrueRobot


def _fit(data: Data, work: Work) -> Artifact:
    from robid.models.external.fitting import fit

    return fit(data, work)


def _validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    from robid.models.external.fitting import validate

    del true  # no robot file states poles and zeros
    return validate(data, model)


def _true_values(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    del loaded, name, true
    return {}


def _phrase(model: Artifact) -> str:
    from robid.models.external.fitting import phrase_of_model

    return phrase_of_model(model)


def _verdict(validation: Artifact) -> str:
    from robid.artifacts.results import outcome_from_artifact

    return outcome_from_artifact(validation).verdict


def _report(shown: Shown) -> FitReport:
    from robid.models.external.page.report import report

    return report(shown)


def _compare(every: Sequence[Shown]) -> dict[str, float]:
    from robid.models.external.fitting import compare

    return compare(every)


def _seed(_settings: FitSettings) -> int | None:
    return None


def _misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    from robid.models.external.files import solution_from_artifact, validation_from_artifact

    found = {"relative error": 1 - float(solution_from_artifact(model).quality.nrmse.min())}
    if validation is not None:
        worst = min(each.nrmse for each in validation_from_artifact(validation).agreements)
        found["relative error of the validation"] = 1 - worst
    return found


EXTERNAL = Family(
    name="external",
    settings=ExternalFit,
    reads=("record",),
    problems=problems,
    decides=model_settings,
    fit=_fit,
    validate=_validate,
    seed=_seed,
    true_values=_true_values,
    phrase=_phrase,
    verdict=_verdict,
    report=_report,
    compare=_compare,
    exports=EXPORTS,
    needs_robot=False,
    misfits=_misfits,
)
