"""The logs of a campaign and their import, configuration by configuration."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from robid.design.excitation.excitation import CampaignExcitation
from robid.logs.columns import check_turns
from robid.logs.importing import import_log, import_shot, join_experiments, join_shots
from robid.logs.mapping import LogMapping
from robid.logs.match import PlayedExcitation
from robid.settings.acquire import Acquire
from robid.settings.experiment import Campaign
from robid.signals.log_options import LogOptions
from robid.signals.record import Record
from robid.stages.chain.simulate_or_acquire import experiment_count


def acquire_shots(campaign: Campaign, acquire: Acquire, folder: Path) -> Record:
    """Imports the logs of a campaign that does not repeat: one shot for each experiment of each realization.

    Args:
        campaign: The campaign.
        acquire: Its logs.
        folder: Folder of the experiment file.

    Raises:
        DataError: If a log is not what was said.
    """
    n_exp = experiment_count(campaign, acquire)
    shots = [_mapping(acquire, folder, 0, *place) for place in np.ndindex(campaign.realizations, n_exp)]
    record = join_shots([import_shot(shot) for shot in shots], n_exp)
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

    Args:
        campaign: The campaign.
        acquire: Its logs.
        content: Its excitation: lines and configurations, and what the references are matched to.
        index: Index of the configuration.
        folder: Folder of the experiment file.
        joint_units: Unit of each joint's position; None where all are angles.

    Raises:
        DataError: If a log is not what was said.
    """
    excitation, n_exp = content.excitation, experiment_count(campaign, acquire)
    records = [
        import_log(
            _mapping(acquire, folder, index, realization, experiment),
            samples_per_period=excitation.reference.shape[2],
            periods=campaign.periods,
            excited_lines=excitation.excited_lines,
            configurations=content.configurations[index : index + 1],
            detection_lines=np.asarray(excitation.detection_lines),
            played=PlayedExcitation(np.asarray(excitation.reference), excitation.kind, realization, experiment)
            if acquire.references
            else None,
        )
        for realization, experiment in np.ndindex(campaign.realizations, n_exp)
    ]
    record = join_experiments(records, n_exp)
    if acquire.takes_turns:
        check_turns(record, acquire.file)
    told = f"Imported from {Path(acquire.file).name}, periods dropped: {acquire.drop_periods}, used: {campaign.periods}"
    return replace(
        record, joint_units=joint_units, notes=(f"{told} ({acquire.take} of those that are whole).", *record.notes)
    )


def _mapping(acquire: Acquire, folder: Path, *indices: int) -> LogMapping:
    """The logs of one experiment: indices of its configuration, realization and place in the block."""
    options = acquire.in_place(*indices)
    return LogMapping(
        file=acquire.log_path(folder, *indices),
        files=acquire.further_paths(folder, *indices),
        **{field.name: getattr(options, field.name) for field in fields(LogOptions)},
    )
