"""report: one page from all artifacts of a run, and its numbers as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.pipeline.stage import Job, Plan, Stage, measured_campaigns
from robid.settings.robot_parts import delay_s, robot_settings

if TYPE_CHECKING:
    from robid.settings.experiment import Experiment
    from robid.settings.load import LoadedExperiment

NAME = "report"


def report_stage(chain: tuple[Stage, ...]) -> Stage:
    """Returns the stage that reports what these stages have made."""
    return Stage(
        NAME,
        "Puts everything on one page, and its numbers into summary.json.",
        "experiment",
        None,
        _owners,
        lambda loaded, owner: _plan(loaded, owner, chain),
        lambda job: _run(job, chain),
        takes_what_is_there=True,
    )


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return (experiment.name,)


def _plan(loaded: LoadedExperiment, owner: str, chain: tuple[Stage, ...]) -> Plan:
    from robid.settings.robot import assumed_names

    experiment, robot = loaded.experiment, loaded.robot
    settings = {
        "name": owner,
        "robot.name": robot.name,
        "robot.notes": list(robot.notes),
        "robot.assumed": list(assumed_names(robot)),
        "fits": loaded.plain["fits"],
        **robot_settings(loaded, "mechanics"),
    }
    for name in measured_campaigns(experiment):
        campaign = experiment.campaigns[name]
        settings[f"campaigns.{name}"] = {"payload_kg": campaign.payload_kg, "delay_s": delay_s(loaded, campaign)}
    inputs = {
        path: path
        for stage in chain
        for name in stage.owners(experiment)
        if not stage.on_request(loaded, name)
        for path in stage.plan(loaded, name).outputs
    }
    return Plan(("report.html", "summary.json"), settings, inputs)


def _run(job: Job, chain: tuple[Stage, ...]) -> str:
    from robid.pipeline.report import run

    return run(job, chain)
