"""The external family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.errors import DataError
from robid.models.external.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.records import at_homes, homes_of, refuse_other_channels, refuse_other_ports, selected
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.prediction import compare_homes
from robid.models.external.judge.validating import validate_external
from robid.models.external.settings import external_fit
from robid.models.family import Data, Shown, Work
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits transfer functions and grades them by themselves."""
    settings = external_fit(data.loaded.experiment, data.name)
    options = settings.options()
    work.progress.expect(1, "fits")
    refuse_other_channels(data.records, settings.campaigns, options)
    records = selected(data.records, data.configurations)
    shots = {
        name: () if record is None else shots_of(record, options, name)
        for name, record in zip(settings.campaigns, records, strict=True)
    }
    own = [shot for name, group in shots.items() if name != settings.choose_on for shot in group]
    held_back = shots.get(settings.choose_on or "", ())
    if not own or (settings.choose_on is not None and not held_back):
        message = f"D156 `configurations` leave no shot {'to choose on' if own else 'to fit'}"
        remedy = "name configurations of the campaign that chooses and of the others"
        raise DataError(message, where=f"fits.{data.name}", remedy=remedy)
    told = commands_of(data.records[0], options)
    solution = fit_external(own, told.channels, data.records[0].output_channels, told.hold, options, held_back)
    solution = replace(solution, homes=homes_of(records))
    work.progress.advance()
    return model_of(solution, assess_external(solution, options))


def validate(data: Data, model: Artifact, _true: TrueRobot | None = None) -> Artifact:
    """Holds transfer functions against motions that they never saw; no robot file states poles and zeros."""
    settings = external_fit(data.loaded.experiment, data.name)
    options = settings.options()
    campaign = settings.validate_on or settings.campaign
    solution = solution_from_artifact(model)
    record = at_homes(data.records[0], solution.homes)
    refuse_other_ports(solution.ports, record, options)
    shots = shots_of(record, options, campaign)
    return validation_of(validate_external(solution, shots, grade_from_artifact(model).findings))


def compare(every: Sequence[Shown]) -> dict[str, float]:
    """Returns how far fits, of several home positions, differ in the channels that they share, by dotted name."""
    found: dict[str, float] = {}
    for one, other in combinations(every, 2):
        for each in compare_homes(solution_from_artifact(one.model), solution_from_artifact(other.model)):
            key = f"differences.{one.data.name}.{other.data.name}.{each.channel}"
            found |= {
                f"{key}.relative": each.relative,
                f"{key}.at_hz": each.at_hz,
                f"{key}.magnitude_db": each.magnitude_db,
                f"{key}.phase_deg": each.phase_deg,
                f"{key}.significant": float(each.significant),
            }
    return found


def misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    """What the worst output lacks to an NRMSE of 1, of the fit and of its validation."""
    found = {"relative error": 1 - float(solution_from_artifact(model).quality.nrmse.min())}
    if validation is not None:
        worst = min(each.nrmse for each in validation_from_artifact(validation).agreements)
        found["relative error of the validation"] = 1 - worst
    return found


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    structures = ", ".join(
        f"{name} {poles} poles {zeros} zeros"
        for name, poles, zeros in zip(
            solution.transfers.blocks, solution.transfers.poles, solution.transfers.zeros, strict=True
        )
    )
    return f"{solution.estimate.status}, {structures}, NRMSE {np.min(solution.quality.nrmse):.4g} or more"
