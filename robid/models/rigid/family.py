"""The rigid family: inertias, first moments, friction and offsets from records."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from robid.models.family import Data, Family, Shown, Work
from robid.models.rigid.exports import EXPORTS
from robid.models.rigid.settings import RigidFit, model_settings, problems

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.report.content import FitReport
    from robid.settings.fits import FitSettings
    from robid.settings.load import LoadedExperiment
    from robid.simulate.truth import TrueRobot


def _fit(data: Data, work: Work) -> Artifact:
    from robid.models.rigid.fitting import fit

    return fit(data, work)


def _validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    from robid.models.rigid.fitting import validate

    return validate(data, model, true)


def _true_values(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    from robid.models.rigid.truth import values_in

    return values_in(loaded, name, true)


def _phrase(model: Artifact) -> str:
    from robid.models.rigid.fitting import phrase_of_model

    return phrase_of_model(model)


def _verdict(validation: Artifact) -> str:
    from robid.artifacts.results import outcome_from_artifact

    return outcome_from_artifact(validation).verdict


def _report(shown: Shown) -> FitReport:
    from robid.models.rigid.page.report import report

    return report(shown)


def _compare(_every: Sequence[Shown]) -> dict[str, float]:
    return {}


def _seed(settings: FitSettings) -> int | None:
    return settings.base.seed if isinstance(settings, RigidFit) else None


def _misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    from robid.models.rigid.files import solution_from_artifact, validation_from_artifact

    found = {"relative error": solution_from_artifact(model).residuals.total_error}
    if validation is not None:
        found["relative error of the validation"] = validation_from_artifact(validation).total_error
    return found


RIGID = Family(
    name="rigid",
    settings=RigidFit,
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
    misfits=_misfits,
)
