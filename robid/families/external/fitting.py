"""The external family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.grade import grade_from_artifact
from robid.errors import DataError
from robid.families.external.files import model_of, solution_from_artifact, validation_of
from robid.families.external.settings import external_fit
from robid.families.family import Data, Work
from robid.fit.external.data import Shot, commands_of, shots_of
from robid.fit.external.fitting import fit_external
from robid.fit.external.options import ExternalOptions
from robid.signals.quantities import describe
from robid.signals.record import Record
from robid.validation.external.grading import assess_external
from robid.validation.external.validating import validate_external


def fit(data: Data, work: Work) -> Artifact:
    """Fits transfer functions and grades them by themselves."""
    settings = external_fit(data.loaded.experiment, data.name)
    options = settings.options()
    work.progress.expect(1, "fits")
    refuse_other_channels(data.records, settings.campaigns, options)
    shots = shots_in(settings.campaigns, data.records, options, data.configurations)
    own = [shot for name, group in shots.items() if name != settings.choose_on for shot in group]
    held_back = shots.get(settings.choose_on or "", ())
    told = commands_of(data.records[0], options)
    solution = fit_external(own, told.channels, data.records[0].output_channels, told.hold, options, held_back)
    work.progress.advance()
    return model_of(solution, assess_external(solution, options))


def validate(data: Data, model: Artifact) -> Artifact:
    """Holds transfer functions against motions that they never saw."""
    settings = external_fit(data.loaded.experiment, data.name)
    options = settings.options()
    campaign = settings.validate_on or settings.campaign
    solution = solution_from_artifact(model)
    told = commands_of(data.records[0], options)
    expected = solution.ports.inputs, solution.ports.outputs
    if (tuple(each.name for each in told.channels), data.records[0].output_names) != expected:
        message = (
            f"the validation has {describe(told.channels)} and {describe(data.records[0].output_channels)}, the fit "
            f"{', '.join(expected[0])} and {', '.join(expected[1])}"
        )
        raise DataError(message, where="validation", remedy="validate on a record of the same channels")
    shots = shots_in((campaign,), data.records, options)[campaign]
    return validation_of(validate_external(solution, shots, grade_from_artifact(model).doubts))


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


def shots_in(
    campaigns: Sequence[str],
    records: Sequence[Record],
    options: ExternalOptions,
    configurations: Sequence[int] = (),
) -> dict[str, tuple[Shot, ...]]:
    """Returns the shots of the records of some campaigns, by campaign.

    Args:
        campaigns: Names of the campaigns.
        records: Their records.
        options: Options of the fit.
        configurations: Indices of the configurations to use, those of further campaigns counted on; all where empty.
    """
    found, first = {}, 0
    for name, record in zip(campaigns, records, strict=True):
        count = len(record.inputs)
        chosen = [index - first for index in configurations if first <= index < first + count]
        part = record if not configurations else _selected(record, chosen)
        found[name] = () if configurations and not chosen else shots_of(part, options, name)
        first += count
    return found


def _selected(record: Record, chosen: Sequence[int]) -> Record:
    rows = list(chosen)
    return replace(
        record,
        inputs=record.inputs[rows],
        outputs=record.outputs[rows],
        output_offset=record.output_offset[rows],
        configurations=None if record.configurations is None else record.configurations[rows],
        reference=None if record.reference is None else record.reference[rows],
    )


def refuse_other_channels(records: Sequence[Record], campaigns: Sequence[str], options: ExternalOptions) -> None:
    """Refuses records of other channels than the first.

    Raises:
        DataError: If there are such.
    """
    first = commands_of(records[0], options)
    for name, record in zip(campaigns[1:], records[1:], strict=True):
        told = commands_of(record, options)
        same = told.channels == first.channels and record.output_channels == records[0].output_channels
        if not same or told.hold != first.hold:
            message = f"campaign `{name}` has other channels, or another hold, than `{campaigns[0]}`"
            raise DataError(message, where="record", remedy="fit the two on their own")
