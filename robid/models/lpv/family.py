"""The position-dependent family: one sparse state-space model from responses at several positions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robid.models.family import Data, Family, Shown, Work
from robid.models.lpv.exports import EXPORTS
from robid.models.lpv.settings import LpvFit, model_settings, problems

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.models.lpv.fit.model import LpvModel
    from robid.report.content import FitReport
    from robid.settings.fits import FitSettings
    from robid.settings.load import LoadedExperiment
    from robid.simulate.truth import TrueRobot


def evaluate(path: Path | str) -> LpvModel:
    """Reads a model: of a run folder's `model.h5`, or of an export as JSON or HDF5.

    `evaluate(path).at(points)` gives A(p), B(p), C(p) and D(p) at points (n_point, n_scheduling).

    Args:
        path: The file.

    Raises:
        ArtifactError: If it holds no model of this family.
    """
    from robid.models.lpv.reading import read_model

    return read_model(Path(path))


def _fit(data: Data, work: Work) -> Artifact:
    from robid.models.lpv.fitting import fit

    return fit(data, work)


def _validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    from robid.models.lpv.fitting import validate

    del true  # no robot file states poles
    return validate(data, model)


def _true_values(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    del loaded, name, true
    return {}


def _phrase(model: Artifact) -> str:
    from robid.models.lpv.fitting import phrase_of_model

    return phrase_of_model(model)


def _verdict(validation: Artifact) -> str:
    from robid.artifacts.results import outcome_from_artifact

    return outcome_from_artifact(validation).verdict


def _report(shown: Shown) -> FitReport:
    from robid.models.lpv.page.report import report

    return report(shown)


def _compare(every: Sequence[Shown]) -> dict[str, float]:
    del every
    return {}


def _seed(_settings: FitSettings) -> int | None:
    return None


def _misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    from robid.models.lpv.files import misfits

    return misfits(model, validation)


LPV = Family(
    name="lpv",
    settings=LpvFit,
    reads=("frf",),
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
