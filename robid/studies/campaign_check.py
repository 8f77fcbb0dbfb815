"""What studies of one simulated campaign check of it."""

from __future__ import annotations

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest


def campaign_problem(experiment: Experiment, name: str) -> str:
    """Says why a campaign cannot be studied: it is not there, or its truth is not known; empty when it can be."""
    campaign = experiment.campaigns.get(name)
    if campaign is None:
        return f"there is no campaign `{name}`; {suggest(name, experiment.campaigns)}"
    if campaign.source is None or campaign.source.simulate is None:
        return f"campaign `{name}` is not simulated, so its true response is not known"
    return ""
