"""The logs of a campaign and their import, configuration by configuration."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np

from robid.arrays import IntArray
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.logs.columns import check_turns
from robid.logs.importing import import_arbitrary, import_log, import_shot, join_experiments, join_shots
from robid.logs.mapping import LogMapping
from robid.logs.placing import PlayedExcitation
from robid.pipeline.plans import experiment_count
from robid.settings.experiment import Campaign
from robid.settings.robot import RobotFile
from robid.settings.sources import Acquire
from robid.signals.log_options import LogOptions
from robid.signals.record import Record

_Log: TypeAlias = tuple[tuple[int, ...], LogMapping]

_OTHERS = 8
"""Configurations whose first log is looked at to see whether another's remedy fits it."""

_SAME_CLOCK = 1e-4
"""Relative difference of what two logs ask for up to which it is the same."""

_NUMBER = re.compile(r"\d+\.?\d*(?:e-?\d+)?")


def acquire_shots(campaign: Campaign, acquire: Acquire, folder: Path) -> Record:
    """Imports the logs of a campaign that does not repeat: one shot for each experiment of each realization.

    Raises:
        DataError: If a log is not what was said.
    """
    n_exp = experiment_count(campaign, acquire)
    places = np.ndindex(campaign.realizations, n_exp)
    shots = [(place, _mapping(acquire, folder, 0, *place)) for place in places]
    record = join_shots(_each(lambda _, mapping: import_shot(mapping), shots), n_exp)
    return replace(record, notes=(f"Imported from {Path(acquire.file).name}, as one shot.", *record.notes))


def acquire_configuration(
    campaign: Campaign,
    acquire: Acquire,
    content: CampaignExcitation,
    index: int,
    folder: Path,
    joint_units: tuple[str, ...] | None = None,
) -> Record:
    """Imports every experiment of one configuration.

    Raises:
        DataError: If a log is not what was said.
    """
    n_exp = experiment_count(campaign, acquire)
    places = np.ndindex(len(content.configurations), campaign.realizations, n_exp)
    logs = [(place, _mapping(acquire, folder, *place)) for place in places]
    others = [log for log in logs if log[0][0] != index and not any(log[0][1:])]
    read = partial(_arbitrary if campaign.is_arbitrary else _periodic, campaign, acquire, content)
    record = join_experiments(_alike(_each(read, [log for log in logs if log[0][0] == index], others[:_OTHERS])), n_exp)
    if acquire.takes_turns:
        check_turns(record, acquire.file)
    name = Path(acquire.file).name
    told = f"Imported from {name}, periods dropped: {acquire.drop_periods}, used: {campaign.periods}"
    told = f"{told} ({acquire.take} of those that are whole)."
    told = f"Imported from {name}, as an arbitrary signal." if campaign.is_arbitrary else told
    return replace(record, joint_units=joint_units, notes=(told, *record.notes))


def _alike(records: Sequence[Record]) -> list[Record]:
    """Returns records with the same lines, those that any of them has, and arbitrary signals of the same length."""
    segments = min(record.segments for record in records)
    lines = np.unique(np.concatenate([record.excited_lines for record in records]))
    return [with_lines(record, segments, lines) for record in records]


def with_lines(record: Record, segments: int, lines: IntArray) -> Record:
    """Returns a record whose arbitrary signal is some segments long, or, of another signal, with these lines."""
    return record.shortened(segments) if segments else replace(record, excited_lines=lines)


def _each(
    read: Callable[[tuple[int, ...], LogMapping], Record], logs: Sequence[_Log], others: Sequence[_Log] = ()
) -> list[Record]:
    """Reads logs one by one; what one of them is refused for has to be set so that it does not spoil the others."""
    records: list[Record] = []
    refused: list[tuple[_Log, DataError]] = []
    for log in logs:
        try:
            records.append(read(*log))
        except DataError as error:
            refused.append((log, error))
    if not refused:
        return records
    (place, mapping), first = refused[0]
    asked = [error for _, error in refused[1:]] + [_refusal(read, log) for log in others]
    if len(refused) < len(logs) or not all(_ask_alike(first, one) for one in asked):
        read(place, replace(mapping, differs=True))
    raise first


def _refusal(read: Callable[[tuple[int, ...], LogMapping], Record], log: _Log) -> DataError | None:
    try:
        read(*log)
    except DataError as error:
        return error
    return None


def _ask_alike(first: DataError, other: DataError | None) -> bool:
    """Whether what one log asks for, to a ten thousandth, is what another one asks for."""
    if other is None:
        return False
    here, there = ([float(text) for text in _NUMBER.findall(one.remedy or one.what)] for one in (first, other))
    return len(here) == len(there) and np.allclose(here, there, rtol=_SAME_CLOCK, atol=0)


def _periodic(
    campaign: Campaign, acquire: Acquire, content: CampaignExcitation, indices: tuple[int, ...], mapping: LogMapping
) -> Record:
    """One log of a signal that repeats: indices of its configuration, realization and place in the block."""
    excitation = content.excitation
    return import_log(
        mapping,
        samples_per_period=excitation.reference.shape[2],
        periods=campaign.periods,
        excited_lines=excitation.excited_lines,
        configurations=content.configurations[indices[0] : indices[0] + 1],
        detection_lines=np.asarray(excitation.detection_lines),
        played=PlayedExcitation(np.asarray(excitation.reference), excitation.kind, *indices[1:])
        if acquire.references
        else None,
        find=campaign.finds_lines,
        listed=campaign.lists_lines,
    )


def _arbitrary(
    campaign: Campaign, acquire: Acquire, content: CampaignExcitation, indices: tuple[int, ...], mapping: LogMapping
) -> Record:
    """One log of an arbitrary signal: indices as in `_periodic`."""
    del campaign, acquire
    return import_arbitrary(
        mapping,
        segment_samples=content.excitation.reference.shape[2],
        lines=np.asarray(content.excitation.excited_lines),
        configurations=content.configurations[indices[0] : indices[0] + 1],
    )


def _mapping(acquire: Acquire, folder: Path, *indices: int) -> LogMapping:
    """The logs of one experiment: indices of its configuration, realization and place in the block."""
    options = acquire.in_place(*indices)
    return LogMapping(
        file=acquire.log_path(folder, *indices),
        files=acquire.further_paths(folder, *indices),
        **{field.name: getattr(options, field.name) for field in fields(LogOptions)},
    )


_TOLD_RAD = 0.3
_NEAR_RAD = 0.02
_NEARER = 0.1
_NOTE = "The log's angles are those of the configuration"


def radians_note(record: Record, robot: RobotFile) -> tuple[str, ...]:
    """Returns a note where the angles of a record are its configuration's numbers, read as radians.

    Asked are all joints that turn and whose numbers would be far apart; logs whose angles count from elsewhere say
    nothing.
    """
    if record.configurations is None:
        return ()
    angles = _arm_angles(record, robot)
    told = {
        index: float(np.rad2deg(rest))
        for index, rest in enumerate(record.configurations[0].tolist())
        if not robot.joints[index].slides and _TOLD_RAD < abs(np.rad2deg(rest)) <= 2 * np.pi
    }
    if not told or any(index not in angles for index in told):
        return ()
    for index, written in told.items():
        off = abs(angles[index] - written)
        if off > _NEAR_RAD or off > _NEARER * abs(angles[index] - np.deg2rad(written)):
            return ()
    index, written = next(iter(told.items()))
    return (
        f"{_NOTE}, were it in radians: {robot.joints[index].name} is at {angles[index]:.4g} rad,"
        f" {np.rad2deg(angles[index]):.4g} deg, and the file says {written:.4g} deg; are these radians?",
    )


def is_radians_note(note: str) -> bool:
    """Whether a note of a record says that its configurations look like radians."""
    return note.startswith(_NOTE)


def _arm_angles(record: Record, robot: RobotFile) -> dict[int, float]:
    """Mean angle of each joint that a channel tells alone, by the joint's index [rad]."""
    mean = record.outputs.mean(axis=(0, 1, 2, 3, 4)) + record.output_offset[0]
    found: dict[int, float] = {}
    for index, joint in enumerate(robot.joints):
        ratio = None if joint.motor is None or joint.couplings else joint.motor.ratio
        for place, channel in enumerate(record.output_channels):
            if channel.quantity != "angle":
                continue
            if channel.name == f"{joint.name}.arm":
                found[index] = float(mean[place])
            elif channel.name == joint.name and channel.side == "motor" and ratio:
                found.setdefault(index, float(mean[place] / ratio))
    return found
