"""The external family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.errors import DataError
from robid.models.external.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import Ports
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.prediction import compare_homes
from robid.models.external.judge.validating import validate_external
from robid.models.external.settings import external_fit
from robid.models.family import Data, Shown, Work
from robid.signals.quantities import Channel, channel_names, describe
from robid.signals.record import Record
from robid.simulate.truth import TrueRobot

_SAME_HOME = 1e-6  # rad, or m
_ALIKE = "validate on a record of the same channels and units, held alike"


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


def selected(records: Sequence[Record], configurations: Sequence[int]) -> tuple[Record | None, ...]:
    """Returns the records of some configurations, all where none is named; None where a record has none of them."""
    found: list[Record | None] = []
    first = 0
    for record in records:
        count = len(record.inputs)
        rows = [index - first for index in configurations if first <= index < first + count]
        found.append(record if not configurations else _rows(record, rows) if rows else None)
        first += count
    return tuple(found)


def homes_of(records: Sequence[Record | None]) -> FloatArray:
    """Returns the configurations (n_home, n_joint) of records, each once; none where they are unknown."""
    known = [one.configurations for one in records if one is not None and one.configurations is not None]
    return np.unique(np.concatenate(known), axis=0) if known else np.zeros((0, 0))


def at_homes(record: Record, homes: FloatArray) -> Record:
    """Returns a record in those of its configurations that are homes; all of it where none is."""
    if record.configurations is None or homes.shape[1] != record.configurations.shape[1]:
        return record
    apart = np.abs(record.configurations[:, None] - homes).max(axis=2, initial=0.0).min(axis=1, initial=np.inf)
    rows = np.flatnonzero(apart < _SAME_HOME).tolist()
    return _rows(record, rows) if rows else record


def _rows(record: Record, rows: Sequence[int]) -> Record:
    chosen = list(rows)
    return replace(
        record,
        inputs=record.inputs[chosen],
        outputs=record.outputs[chosen],
        output_offset=record.output_offset[chosen],
        configurations=None if record.configurations is None else record.configurations[chosen],
        reference=None if record.reference is None else record.reference[chosen],
    )


def refuse_other_ports(ports: Ports, record: Record, options: ExternalOptions) -> None:
    """Refuses a record of other channels than those of a fit.

    Raises:
        DataError: If it has such.
    """
    told = commands_of(record, options)
    found = _ports(told.channels), _ports(record.output_channels), told.hold
    own = (ports.inputs, ports.input_units), (ports.outputs, ports.output_units), ports.hold
    if found != own:
        message = (
            f"D157 the validation has {describe(told.channels)} ({told.hold}) and "
            f"{describe(record.output_channels)}, the "
            f"fit {', '.join(ports.inputs)} ({ports.hold}) and {', '.join(ports.outputs)}, or in other units"
        )
        raise DataError(message, where="validation", remedy=_ALIKE)


def _ports(channels: Sequence[Channel]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return channel_names(channels), tuple(channel.unit for channel in channels)


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
            message = f"D158 campaign `{name}` has other channels, or another hold, than `{campaigns[0]}`"
            raise DataError(message, where="record", remedy="fit the two on their own")
