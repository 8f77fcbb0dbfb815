"""design-configs: which of a campaign's configurations to measure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group

from robid.artifacts.design import DESIGN, design_from_artifact, design_to_artifact
from robid.artifacts.store import inspect_artifact, read_artifact, write_artifact
from robid.design.cost import visit_cost_s
from robid.design.information import ConfigurationDesign, design_configurations
from robid.design.stability import Trial, stability
from robid.report.design import design_numbers, design_tables, stability_sentence
from robid.report.numbers import percent
from robid.settings.experiment import Campaign, Design, Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import Part, delay_s, line_settings, log_sampling_settings, robot_settings
from robid.settings.slices import to_plain
from robid.stages.configurations import design_inputs
from robid.stages.design_information import Gathered, gather_information
from robid.stages.design_weights import about_options, fit_options
from robid.stages.stage import Job, Plan, Stage, counted
from robid.stages.terminal import section_table

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
        f"designs.{owner}": to_plain(design),
        f"{section}.payload_kg": campaign.payload_kg,
        **robot_settings(loaded, *_robot_parts(loaded.experiment, design)),
    }
    if design.cost == "travel":
        settings[f"{section}.visit_s"] = visit_s(loaded, campaign)
    inputs = {} if design.prior is None else {"model": f"fits/{design.prior}/model.h5"}
    if design.information == "measured":
        settings |= {f"{section}.pooled_lines": campaign.estimate.pooled_lines, "delay_s": delay_s(loaded, campaign)}
        inputs["frf"] = f"{design.campaign}/frf.h5"
        if (fit := fit_options(loaded.experiment, design)) is not None:
            settings[f"designs.{owner}.for"] = {name: to_plain(getattr(fit, name)) for name in _READ_OF_FIT}
    else:
        settings |= {
            f"{section}.configurations": to_plain(campaign.configurations),
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
    experiments = campaign.realizations * (campaign.experiments or len(loaded.robot.joints))
    return experiments * (transient + campaign.periods) * campaign.excitation.period_s


def _run(job: Job) -> str:
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    found = gather_information(job)
    cost = None
    if design.cost == "travel":
        robot = job.loaded.robot.to_robot(campaign.payload_kg)
        cost = visit_cost_s(robot, found.configurations, visit_s(job.loaded, campaign), design.joint_speed_share)
    options = design.options()
    choice = design_configurations(
        found.matrices,
        found.configurations,
        found.names,
        options,
        prior=found.prior,
        cost=cost,
        fitted=found.fitted,
    )
    trials = _trials(found)
    repeated = None
    if trials and found.fitted is None:
        source = "realizations" if len(found.halves) else "draws"
        repeated = stability(source, trials, choice, options, found.prior, cost)
    if found.fitted is not None:
        # What optimal weights of the chosen ones would be worth is no measure of a fit that has others.
        choice = replace(choice, rounding_loss=float("nan"), choice_efficiency=choice.efficiency)
    choice = replace(choice, cost_s=cost, stability=repeated, joint_units=job.loaded.robot.joint_units)
    write_artifact(job.output, design_to_artifact(choice, job.provenance(STAGE.name)))
    return figures(choice)


def _trials(found: Gathered) -> list[Trial]:
    """Choices by each half of the realizations, judged by the other; else by each draw, judged by their mean."""
    if len(found.halves):
        return [Trial(way[side], way[1 - side]) for way in found.halves for side in (0, 1)]
    mean = found.matrices.mean(axis=0)
    return [Trial(draw, mean) for draw in found.matrices] if len(found.matrices) > 1 else []


def figures(choice: ConfigurationDesign) -> str:
    """Says what was chosen, in a phrase."""
    deviation = 100 * float(np.median(choice.predicted_relative_std))
    worth = f"{choice.criterion.upper()}-efficiency {percent(choice.efficiency)}"
    if np.isnan(choice.rounding_loss):
        worth = f"for the weights of a fit, which reaches {percent(choice.efficiency)} of what optimal weights could"
    text = (
        f"{len(choice.chosen)} of {counted(len(choice.configurations), 'configuration')}, {worth},"
        f" predicted deviation {deviation:.2g} % (median)"
    )
    return text if choice.stability is None else f"{text}; {stability_sentence(choice.stability)}"


def _problem(output: Path) -> str:
    gap = inspect_artifact(output)["attributes"]["gap"]
    if gap <= _WIDE_GAP:
        return ""
    return (
        f"no weights were found that are optimal within {percent(_WIDE_GAP)} (gap {percent(gap)}): raise `iterations`"
    )


def _show(output: Path, loaded: LoadedExperiment) -> Group:
    del loaded
    tables = design_tables(design_from_artifact(read_artifact(output, DESIGN)))
    return Group(*(section_table(table.title, table.columns, table.texts) for table in tables))


def _told(output: Path) -> dict[str, Any]:
    return {"design": design_numbers(design_from_artifact(read_artifact(output, DESIGN)))}


STAGE = Stage(
    "design-configs",
    "Chooses the robot configurations to measure.",
    "design",
    DESIGN,
    _owners,
    _plan,
    _run,
    _problem,
    _show,
    _told,
)
