"""The models of the study of configurations in the time domain: steps of every axis under control that each designs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import TASK
from robid.artifacts.mapping import from_datasets, to_datasets
from robid.artifacts.store import read_artifact
from robid.models.elastic.fit.fitted_robot import with_estimates
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.settings.experiment import RandomConfigurations
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.settings.sources import true_robot_of
from robid.simulate.options import Controller, SimulateOptions
from robid.stages.configurations import draw_in_reach
from robid.studies.settings.steps import StepOptions
from robid.studies.simulated import simulate_options
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task
from robid.studies.zimmermann2023.step_responses import StepResponses, step_responses
from robid.studies.zimmermann2023.study import study_of

NOMINAL = "robot file"


@dataclass(frozen=True)
class Stepping:
    """Steps of one individual under control that several models design.

    Attributes:
        robot: The robot file's, with the payload of the estimation.
        truth: The true robot, without its imperfections.
        models: Where the results of the models lie, by name.
        controller: The robot's controller.
        simulation: Imperfections of the true robot.
        configurations: Where it is stepped [rad].
        options: The steps.
    """

    robot: Robot
    truth: Robot
    models: dict[str, Path]
    controller: Controller
    simulation: SimulateOptions
    configurations: FloatArray
    options: StepOptions


def step_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual; none where the study steps no model."""
    study = study_of(run.loaded)
    if not study.stepped:
        return []
    found, names = [], list(study.models)
    for number, campaign_name in enumerate(study.estimation):
        campaign = run.loaded.experiment.campaigns[campaign_name]
        robot = run.loaded.robot.to_robot(campaign.payload_kg)
        simulation = simulate_options(campaign)
        paths = dict(zip(names, earlier[1].paths[number * len(names) :], strict=False))
        used = {name: paths[name] for name in study.stepped}
        wanted = RandomConfigurations(count=study.steps.configurations, seed=study.steps.seed)
        decides = {
            "models": {name: path.name for name, path in used.items()},
            "source": plain_settings(campaign.source),
            "steps": plain_settings(study.steps),
            "payload_kg": campaign.payload_kg,
            **robot_settings(run.loaded, "mechanics", "range", "motor_limits", "friction", "controller"),
        }
        stepping = Stepping(
            robot,
            true_robot_of(run.loaded.robot, campaign.payload_kg, simulation.truth),
            used,
            require_controller(run.loaded),
            simulation,
            draw_in_reach(run.loaded, robot, wanted),
            study.steps,
        )
        found.append(Task(f"steps_{number + 1}", decides, stepping))
    return found


def step(one: Stepping) -> Content:
    """Steps every axis in every configuration under control that each model designs, the robot file's beside."""
    models = {name: _model(one.robot, path) for name, path in one.models.items()}
    responses = step_responses(
        one.truth,
        {**models, NOMINAL: one.robot},
        one.controller,
        one.simulation,
        one.configurations,
        one.options,
    )
    return Content(*to_datasets(responses))


def read_steps(artifact: Artifact) -> StepResponses:
    """The responses of a task."""
    return from_datasets(StepResponses, artifact)


def _model(robot: Robot, path: Path) -> Robot:
    held = read_artifact(path, TASK).datasets
    names = held["names"].values.tolist()
    found, stated = (dict(zip(names, held[key].values.tolist(), strict=True)) for key in ("estimate", "nominal"))
    return with_estimates(robot, found, stated)
