"""simulate-or-acquire: the record of a campaign, simulated in closed loop or imported from a log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robid.artifacts.kinds import RECORD
from robid.artifacts.truth import check_vouched
from robid.settings.robot_parts import Part, require_controller, robot_settings
from robid.simulate.options import STEP_LIMITS
from robid.stages.stage import Job, Plan, Stage, measured_campaigns

if TYPE_CHECKING:
    from robid.settings.experiment import Campaign
    from robid.settings.load import LoadedExperiment
    from robid.settings.sources import Acquire

_BYTES_PER_SAMPLE = 4


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    campaign = loaded.experiment.campaigns[owner]
    section = f"campaigns.{owner}"
    settings: dict[str, Any] = {f"{section}.periods": campaign.periods}
    settings[f"{section}.source"] = loaded.plain["campaigns"][owner]["source"]
    record = f"{owner}/record.h5"
    inputs = {} if campaign.is_one_shot else {"excitation": f"{owner}/excitation.h5"}
    if campaign.source is not None and campaign.source.acquire is not None:
        settings |= {f"{section}.{key}": getattr(campaign, key) for key in ("realizations", "experiments")}
        # The excitation's file holds the lines, and not whether they are candidates, or those of any signal.
        settings |= {f"{section}.excitation.lines": "found"} if campaign.finds_lines else {}
        settings |= {f"{section}.excitation.signal": "arbitrary"} if campaign.is_arbitrary else {}
        return Plan((record,), settings, inputs, log_files(loaded, campaign, campaign.source.acquire))
    settings[f"{section}.payload_kg"] = campaign.payload_kg
    settings[f"{section}.outputs"] = loaded.plain["campaigns"][owner]["outputs"]
    simulated = None if campaign.source is None else campaign.source.simulate
    if simulated is None or simulated.steps_per_sample is None:
        settings["steps_per_sample"] = dict(STEP_LIMITS)
    settings |= robot_settings(loaded, "mechanics", "motor_limits", "friction", "controller", _told(campaign))
    return Plan((record, f"{owner}/truth.json"), settings, inputs, needed_bytes=_needed_bytes(loaded, campaign))


def _told(campaign: Campaign) -> Part:
    """The part of the robot file that says what is recorded."""
    return "pose" if campaign.moves_poses else "sensors"


def _needed_bytes(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Inputs and outputs of all samples, once in the parts and once merged."""
    from robid.settings.checks.configurations import configuration_count
    from robid.settings.checks.experiment import sampling_period_s
    from robid.settings.robot_derived import input_count

    n_input = input_count(campaign, loaded.robot)
    period_s = sampling_period_s(campaign, loaded.robot) or require_controller(loaded).sampling_period_s
    n_channel = 2 * n_input + len(campaign.outputs) - 1
    blocks = (configuration_count(loaded.experiment, campaign) or 0) * campaign.realizations
    experiments = blocks * campaign.block_size(n_input)
    samples = experiments * campaign.periods * campaign.excitation.period_s / period_s
    return 2 * _BYTES_PER_SAMPLE * samples * n_channel


def log_files(loaded: LoadedExperiment, campaign: Campaign, acquire: Acquire) -> dict[str, Path]:
    """Returns the path of every log by a name that says which it is; `log` where there is only one."""
    from robid.settings.checks.configurations import configuration_count

    counts = (
        configuration_count(loaded.experiment, campaign) or 0,
        campaign.realizations,
        experiment_count(campaign, acquire),
    )
    found: dict[str, Path] = {}
    for place in np.ndindex(*counts):
        c, r, e = (index + 1 for index in place)
        name = "log" if np.prod(counts) == 1 else f"log of configuration {c}, realization {r}, experiment {e}"
        found[name] = acquire.log_path(loaded.path.parent, *place)
        for further in acquire.further_paths(loaded.path.parent, *place).values():
            found[f"{name}, {further.name}"] = further
    return found


def experiment_count(campaign: Campaign, acquire: Acquire) -> int:
    """Returns the number of logged experiments of each block: as many as inputs unless the campaign says less.

    Shots that do not repeat are one unless the campaign says more.
    """
    return campaign.experiments or 1 if acquire.one_shot else campaign.block_size(len(acquire.inputs))


def _vouched(outputs: Sequence[Path]) -> str:
    """Refuses a truth that is not the record's; an imported record has none, and an older one says nothing of it."""
    for truth in outputs[1:]:
        if not check_vouched(truth, outputs[0]):
            return "the record is of an earlier version, which does not say its truth"
    return ""


def _run(job: Job) -> str:
    from robid.stages.simulate_or_acquire import run

    return run(job)


def _phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    from robid.stages.simulate_or_acquire import phrase

    return phrase(output)


STAGE = Stage(
    "simulate-or-acquire",
    "Simulates a campaign in closed loop, or imports it from a log.",
    "campaign",
    RECORD,
    measured_campaigns,
    _plan,
    _run,
    _phrase,
    vouched=_vouched,
)
