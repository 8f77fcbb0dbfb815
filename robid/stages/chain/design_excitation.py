"""design-excitation: what each motor is told to do, within the limits of every configuration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from robid.artifacts.kinds import EXCITATION
from robid.settings.robot_parts import line_settings, log_sampling_settings, robot_settings
from robid.stages.chain.design_configs import design_inputs
from robid.stages.stage import Job, Plan, Stage, periodic_campaigns

if TYPE_CHECKING:
    from rich.console import Group

    from robid.settings.experiment import Campaign
    from robid.settings.load import LoadedExperiment
    from robid.settings.sources import Acquire


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    campaign = loaded.experiment.campaigns[owner]
    section, plain = f"campaigns.{owner}", loaded.plain["campaigns"][owner]
    settings = {f"{section}.configurations": plain["configurations"]}
    acquire = played_by_others(campaign)
    if acquire is None:
        read = ("excitation", "realizations", "experiments", "periods", "payload_kg")
        settings |= {f"{section}.{key}": plain[key] for key in read}
        settings |= {f"{section}.source.{key}": value for key, value in transient_periods(campaign).items()}
        settings |= robot_settings(loaded, "mechanics", "range", "motor_limits", "controller")
        if campaign.moves_poses:
            settings |= robot_settings(loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "pose")
        elif campaign.is_trajectory:
            settings |= robot_settings(loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "controller")
    else:
        settings[f"{section}.excitation"] = line_settings(campaign)
        settings |= log_sampling_settings(owner, campaign)
        settings |= robot_settings(loaded, "range")
    return Plan((f"{owner}/excitation.h5",), settings, design_inputs(campaign))


def played_by_others(campaign: Campaign) -> Acquire | None:
    """Returns the logs of a campaign whose excitation is not designed here: arbitrary, or without references."""
    acquire = None if campaign.source is None else campaign.source.acquire
    designed = acquire is None or (acquire.references and not campaign.is_arbitrary)
    return None if designed else acquire


def transient_periods(campaign: Campaign) -> dict[str, int]:
    """Periods before those that count, by the name of the setting below `source`."""
    source = campaign.source
    if source is not None and source.acquire is not None:
        return {"acquire.drop_periods": source.acquire.drop_periods}
    simulated = None if source is None else source.simulate
    return {"simulate.transient_periods": 0 if simulated is None else simulated.transient_periods}


def _run(job: Job) -> str:
    from robid.stages.design_excitation import run

    return run(job)


def _phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    from robid.stages.design_excitation import phrase

    return phrase(output)


def _show(output: Path, loaded: LoadedExperiment) -> Group | None:
    from robid.stages.design_excitation import show

    return show(output, loaded)


STAGE = Stage(
    "design-excitation",
    "Designs what each motor is told to do, within the limits of every configuration.",
    "campaign",
    EXCITATION,
    periodic_campaigns,
    _plan,
    _run,
    _phrase,
    show=_show,
)
