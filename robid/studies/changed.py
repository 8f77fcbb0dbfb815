"""Simulated campaigns with other imperfections and another truth than their settings have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robid.settings.experiment import Campaign, Source
from robid.settings.sources import SimulateSettings


def changed_simulation(
    campaign: Campaign, physics: Mapping[str, Any], seed: int | None = None, noise: int = 0
) -> SimulateSettings:
    """Returns how a campaign is simulated with changed imperfections and another truth.

    Args:
        campaign: The campaign, simulated.
        physics: `imperfections` and `truth` that take the place of the campaign's.
        seed: Seed of the true robot; the campaign's when None.
        noise: Seed of the noise, where `seed` is given.

    Raises:
        ValidationError: If there is no such option, or its value is not allowed.
    """
    if campaign.source is None:
        message = "the settings' checks let a study without a simulated campaign pass"
        raise RuntimeError(message)
    plain = campaign.source.model_dump(mode="json")["simulate"]
    for key in ("imperfections", "truth"):
        changed = physics.get(key) or {}
        plain[key] = {**plain[key], **changed} if isinstance(changed, dict) else plain[key]
    if seed is not None:
        plain["truth"]["seed"], plain["seed"] = seed, noise
    options = Source.model_validate({"simulate": plain}).simulate
    if options is None:
        message = "the settings' checks let a study without a simulated campaign pass"
        raise RuntimeError(message)
    return options
