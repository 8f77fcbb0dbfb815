"""design-configs: which of a campaign's configurations to measure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group

from robid.artifacts.kinds import DESIGN, design_from_artifact, design_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.design.configurations.candidates import visit_cost_s
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.stability import Trial, stability
from robid.pipeline.design_comparison import alternatives, choose
from robid.pipeline.design_information import gather_information
from robid.pipeline.design_outputs import predicted_there
from robid.pipeline.design_prediction import gather_prediction
from robid.pipeline.design_tasks import design_tasks
from robid.pipeline.plans import visit_s
from robid.pipeline.stage import Job, counted
from robid.pipeline.terminal import section_table
from robid.report.design import design_tables, stability_sentence, worth_phrase
from robid.report.design_numbers import design_numbers
from robid.report.numbers import percent
from robid.settings.load import LoadedExperiment


def run(job: Job) -> str:
    """Chooses a design's configurations; returns its key figures."""
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    found = gather_information(job)
    cost = None
    if design.cost == "travel":
        robot = job.loaded.robot.to_robot(campaign.payload_kg)
        cost = visit_cost_s(robot, found.configurations, visit_s(job.loaded, campaign), design.joint_speed_share)
    options = design.options()
    predicts = options.criterion == "prediction"
    parts = None
    if predicts:
        parts = gather_prediction(job, design_tasks(job), found.between)
        parts = predicted_there(job, parts, found.between, found.configurations)
    choice = choose(found, options, cost, parts)
    # Choices by each half of the realizations, judged by the other; else by each draw, judged by their mean.
    mean = found.matrices.mean(axis=0)
    trials = [Trial(way[side], way[1 - side]) for way in found.halves for side in (0, 1)]
    if not len(found.halves) and len(found.matrices) > 1:
        trials = [Trial(draw, mean) for draw in found.matrices]
    repeated = None
    if trials and found.fitted is None and not predicts:
        source = "realizations" if len(found.halves) else "draws"
        repeated = stability(source, trials, choice, options, found.prior, cost, found.between)
    if found.fitted is not None and not predicts:
        # What optimal weights of the chosen ones would be worth is no measure of a fit that has others.
        choice = replace(choice, rounding_loss=float("nan"), choice_efficiency=choice.efficiency)
    choice = replace(choice, cost_s=cost, stability=repeated, joint_units=job.loaded.robot.joint_units)
    choice = replace(choice, predict=design.predict)
    choice = replace(choice, alternatives=alternatives(job, found, choice, parts))
    write_artifact(job.output, design_to_artifact(choice, job.provenance()))
    return choice_phrase(choice)


def choice_phrase(choice: ConfigurationDesign) -> str:
    """Says what was chosen, in a phrase."""
    deviation = 100 * float(np.median(choice.predicted_relative_std))
    text = (
        f"{len(choice.chosen)} of {counted(len(choice.configurations), 'configuration')}, {worth_phrase(choice)},"
        f" predicted deviation {deviation:.2g} % (median)"
    )
    error = {each.way: each.prediction_error for each in choice.alternatives}
    if error:
        text += f", expected prediction error {percent(error[choice.criterion])} (random {percent(error['random'])})"
    return text if choice.stability is None else f"{text}; {stability_sentence(choice.stability)}"


def phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    """Says what a design chose, in a phrase."""
    return choice_phrase(design_from_artifact(read_artifact(output, DESIGN)))


def show(output: Path, _loaded: LoadedExperiment) -> Group:
    """Lays out a design."""
    tables = design_tables(design_from_artifact(read_artifact(output, DESIGN)))
    where = "on the page, in `--json`"
    return Group(*(section_table(table.title, table.columns, table.texts, where) for table in tables))


def told(output: Path) -> dict[str, Any]:
    """Returns a design in numbers."""
    return {"design": design_numbers(design_from_artifact(read_artifact(output, DESIGN)))}
