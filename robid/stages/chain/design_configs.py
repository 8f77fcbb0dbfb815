"""design-configs: which of a campaign's configurations to measure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from robid.artifacts.kinds import DESIGN
from robid.artifacts.store import inspect_artifact
from robid.report.numbers import percent
from robid.settings.robot_parts import (
    Part,
    delay_s,
    line_settings,
    log_sampling_settings,
    plain_settings,
    robot_settings,
)
from robid.stages.design_options import about_options, fit_options
from robid.stages.stage import Job, Plan, Stage

if TYPE_CHECKING:
    from rich.console import Group

    from robid.settings.experiment import Campaign, Design, Experiment
    from robid.settings.load import LoadedExperiment

_WIDE_GAP = 0.01
_READ: tuple[Part, ...] = ("mechanics", "range", "timing")
_READ_OF_FIT = ("estimator", "weights", "correct_torques", "free", "fixed", "prior_decades")
_READ_FOR_COST: tuple[Part, ...] = ("motor_limits",)
_READ_OF_ROTORS: tuple[Part, ...] = ("inertia_std",)


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(experiment.designs)


def _robot_parts(experiment: Experiment, design: Design) -> tuple[Part, ...]:
    cost = _READ_FOR_COST if design.cost == "travel" else ()
    rotors = _READ_OF_ROTORS if "motor_inertia" in about_options(experiment, design).along() else ()
    return (*_READ, *cost, *rotors)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    design = loaded.experiment.designs[owner]
    campaign = loaded.experiment.campaigns[design.campaign]
    section = f"campaigns.{design.campaign}"
    settings = {
        f"designs.{owner}": loaded.plain["designs"][owner],
        f"{section}.payload_kg": campaign.payload_kg,
        **robot_settings(loaded, *_robot_parts(loaded.experiment, design)),
    }
    if design.cost == "travel":
        settings[f"{section}.visit_s"] = visit_s(loaded, campaign)
    inputs = {} if design.prior is None else {"model": f"fits/{design.prior}/model.h5"}
    if design.between is not None:
        inputs["between"] = f"fits/{design.between}/model.h5"
    if design.information == "measured":
        settings |= {f"{section}.pooled_lines": campaign.estimate.pooled_lines, "delay_s": delay_s(loaded, campaign)}
        inputs["frf"] = f"{design.campaign}/frf.h5"
        if (fit := fit_options(loaded.experiment, design)) is not None:
            settings[f"designs.{owner}.for"] = {name: plain_settings(getattr(fit, name)) for name in _READ_OF_FIT}
    else:
        settings |= {
            f"{section}.configurations": loaded.plain["campaigns"][design.campaign]["configurations"],
            f"{section}.excitation": line_settings(campaign),
            **log_sampling_settings(design.campaign, campaign),
        }
        inputs |= design_inputs(campaign)
    return Plan((f"designs/{owner}.h5",), settings, inputs)


def visit_s(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Returns the time that a campaign's experiments in one configuration take [s]."""
    transient = 0
    if campaign.source is not None and campaign.source.acquire is not None:
        transient = campaign.source.acquire.drop_periods
    elif campaign.source is not None and campaign.source.simulate is not None:
        transient = campaign.source.simulate.transient_periods
    experiments = campaign.realizations * campaign.block_size(len(loaded.robot.joints))
    return experiments * (transient + campaign.periods) * campaign.excitation.period_s


def design_inputs(campaign: Campaign) -> dict[str, str]:
    """Returns the designs that a campaign's configurations come from, by name of input."""
    names = campaign.designs
    if len(names) == 1:
        return {"design": f"designs/{names[0]}.h5"}
    return {f"design {name}": f"designs/{name}.h5" for name in names}


def _problem(output: Path) -> str:
    gap = inspect_artifact(output)["attributes"]["gap"]
    if gap <= _WIDE_GAP:
        return ""
    return (
        f"no weights were found that are optimal within {percent(_WIDE_GAP)} (gap {percent(gap)}): raise `iterations`"
    )


def _run(job: Job) -> str:
    from robid.stages.design_configs import run

    return run(job)


def _phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    from robid.stages.design_configs import phrase

    return phrase(output)


def _show(output: Path, _loaded: LoadedExperiment) -> Group:
    from robid.stages.design_configs import show

    return show(output)


def _told(output: Path) -> dict[str, Any]:
    from robid.stages.design_configs import told

    return told(output)


STAGE = Stage(
    "design-configs",
    "Chooses the robot configurations to measure.",
    "design",
    DESIGN,
    _owners,
    _plan,
    _run,
    _phrase,
    problem=_problem,
    show=_show,
    told=_told,
)
