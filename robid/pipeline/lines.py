"""The lines of a campaign, by the same rule for what is played, what a log is said to hold, and what is planned."""

from __future__ import annotations

from robid.arrays import IntArray
from robid.design.excitation.signal_lines import signal_lines
from robid.settings.checks.experiment import sampling_period_s
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import require_controller


def campaign_lines(loaded: LoadedExperiment, campaign: Campaign) -> tuple[IntArray, IntArray]:
    """Returns the excited and the detection lines of a campaign.

    Raises:
        SettingsError: If its signal cannot be made, or nothing says how it is sampled.
    """
    return signal_lines(campaign.excitation, campaign_sampling_s(loaded, campaign))


def campaign_sampling_s(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Returns the sampling period of a campaign: the log's, else the controller's [s].

    Raises:
        SettingsError: If there is neither.
    """
    found = sampling_period_s(campaign, loaded.robot)
    return require_controller(loaded).sampling_period_s if found is None else found
