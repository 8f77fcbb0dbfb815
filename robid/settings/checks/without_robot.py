"""What an experiment can do without a robot file: read logs, for fits that ask for nothing inside the robot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.experiment import Campaign, Experiment
from robid.settings.fits import Families
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


def check_without_robot(experiment: Experiment, families: Families) -> _Found:
    """Yields what needs the robot file that an experiment does not name; nothing where it names one."""
    if experiment.robot is not None:
        return
    for name, campaign in experiment.campaigns.items():
        for below, message in _campaign(campaign):
            yield ("campaigns", name, *below), message
    for name in experiment.designs:
        yield ("designs", name), "a choice of configurations needs `robot`"
    for name, fit in experiment.fits.items():
        if families[fit.family].needs_robot:
            yield ("fits", name, "family"), f"a fit of family `{fit.family}` needs `robot`"


def _campaign(campaign: Campaign) -> _Found:
    acquire = None if campaign.source is None else campaign.source.acquire
    if acquire is None:
        what = "an excitation" if campaign.source is None else "a simulation"
        yield ("source",), f"{what} needs `robot`: without one, a campaign is imported from logs (`acquire`)"
    elif acquire.references and not (acquire.one_shot or campaign.is_arbitrary):
        message = "a match with an excitation that is designed here needs `robot`: name what drives it under `inputs`"
        yield ("source", "acquire", "references"), message
    if campaign.configurations is not None:
        yield ("configurations",), "are joint angles, which need `robot`: leave them out"
    if campaign.payload_kg is not None:
        yield ("payload_kg",), "is carried by a `robot`: leave it out"
    if campaign.is_trajectory:
        yield ("excitation",), "a trajectory is designed for a `robot`: import its log as `one_shot`"
    if campaign.estimate.compensation in ("nominal", "silent_lines") or campaign.estimate.friction_fit is not None:
        yield ("estimate", "compensation"), "friction is that of a `robot`: use `compensation: none`"
