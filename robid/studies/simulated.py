"""Simulated campaigns inside the tasks of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robid.frf.options import EstimateOptions
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings, robot_settings
from robid.signals.friction import TorqueLaw
from robid.simulate.options import SimulateOptions
from robid.stages.estimate_frf import stated_laws


@dataclass(frozen=True)
class Estimator:
    """One way to estimate, with what it reads from the robot file."""

    options: EstimateOptions
    laws: tuple[TorqueLaw, ...] | None
    delay_s: float


def make_estimator(loaded: LoadedExperiment, campaign: Campaign, options: EstimateOptions) -> Estimator:
    """Returns an estimator with what these options read from the robot file."""
    laws, delay = stated_laws(loaded, campaign, options)
    return Estimator(options, laws, delay)


def simulate_options(campaign: Campaign) -> SimulateOptions:
    """Returns how a campaign that the settings' checks let pass as simulated is simulated."""
    if campaign.source is None or campaign.source.simulate is None:
        message = "the settings' checks let a study without a simulated campaign pass"
        raise RuntimeError(message)
    return campaign.source.simulate


def simulation_settings(loaded: LoadedExperiment, campaign: Campaign) -> dict[str, Any]:
    """Returns what decides, beside the excitation, what a campaign's simulation and estimate give."""
    return {
        "source": plain_settings(campaign.source),
        "periods": campaign.periods,
        "payload_kg": campaign.payload_kg,
        **robot_settings(loaded, "mechanics", "motor_limits", "friction", "friction_std", "controller"),
    }
