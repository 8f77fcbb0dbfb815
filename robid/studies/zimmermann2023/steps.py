"""Steps of one axis at a time: the true robot under control that each model designs, against its own prediction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from robid.arrays import FloatArray, Quantity, check_shape
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import TASK, from_datasets, to_datasets
from robid.artifacts.store import read_artifact
from robid.models.elastic.fit.fitted_robot import with_estimates
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.experiment import RandomConfigurations
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.settings.sources import true_robot_of
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.playback import with_tool_point
from robid.studies.settings.elastic import StepOptions, ZimmermannStudy
from robid.studies.simulated import simulate_options
from robid.studies.study import Earlier, study_of
from robid.studies.tasks import Content, Task
from robid.studies.zimmermann2023.step_bench import StepBench, StepRun, StepTask, run_steps, step_profiles

_MOVED, _STEPPED = "model configuration axis time xyz", "model configuration axis time"
_TREND = 3  # degree; the feedback's slow settling is no vibration

Map = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]


@dataclass(frozen=True)
class StepResponses:
    """What the tool point and the stepped axis' motor did; arrays begin with (n_model, n_conf, n_axis)."""

    time_s: Annotated[FloatArray, Quantity("s", "time", "Time from the beginning of the step")]
    models: Annotated[tuple[str, ...], Quantity("1", "model", "Name of each model")]
    axes: Annotated[tuple[str, ...], Quantity("1", "axis", "Name of each stepped axis")]
    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side angles at rest")]
    move_s: Annotated[FloatArray, Quantity("s", "configuration axis", "How long the commanded move lasts")]
    path: Annotated[
        FloatArray, Quantity("m", "configuration axis time xyz", "Displacement of the tool point of a rigid robot")
    ]
    tool_true: Annotated[FloatArray, Quantity("m", _MOVED, "Displacement of the true tool point", compact=True)]
    tool_model: Annotated[FloatArray, Quantity("m", _MOVED, "What the model predicts", compact=True)]
    torque_true: Annotated[FloatArray, Quantity("N m", _STEPPED, "Torque of the stepped axis", compact=True)]
    torque_model: Annotated[FloatArray, Quantity("N m", _STEPPED, "What the model predicts", compact=True)]

    @property
    def size_m(self) -> FloatArray:
        """How far each step (n_conf, n_axis) moves the tool point [m]."""
        return np.asarray(np.linalg.norm(self.path[..., -1, :], axis=-1))

    @property
    def tool_error_m(self) -> FloatArray:
        """Distance (n_model, n_conf, n_axis, n_time) of the predicted from the true tool point [m]."""
        return np.asarray(np.linalg.norm(self.tool_true - self.tool_model, axis=-1))

    @property
    def path_error_m(self) -> FloatArray:
        """Distance (n_model, n_conf, n_axis, n_time) of the true tool point from the commanded path in time [m]."""
        return np.asarray(np.linalg.norm(self.tool_true - self.path, axis=-1))

    @property
    def torque_error_nm(self) -> FloatArray:
        """Predicted less true torque (n_model, n_conf, n_axis, n_time) [N m]."""
        return np.asarray(self.torque_model - self.torque_true)

    @property
    def vibration_m(self) -> FloatArray:
        """Root mean square vibration (n_model, n_conf, n_axis) of the true tool point after the move [m]."""
        result = np.empty(self.tool_true.shape[:3])
        for configuration, axis in np.ndindex(self.move_s.shape):
            after = self.time_s >= self.move_s[configuration, axis]
            shown = self.tool_true[:, configuration, axis, after]
            basis = np.linalg.qr(np.vander(self.time_s[after], _TREND + 1))[0]
            left = shown - basis @ (basis.T @ shown)
            result[:, configuration, axis] = np.sqrt((left**2).sum(axis=-1).mean(axis=-1))
        return result


@dataclass(frozen=True)
class StepFigures:
    """Errors of one model over all configurations and axes."""

    tool_rms_m: float  # Root mean square error of the predicted tool displacement [m]
    tool_max_m: float  # Largest error of it [m]
    tool_relative: float  # Root mean square of the error over the size of its step
    torque_rms_nm: float  # Root mean square error of the predicted torque of the stepped axis [N m]
    torque_max_nm: float  # Largest error of it [N m]
    torque_relative: float  # Root mean square error over the root mean square of the torque's change from rest
    path_rms_m: float  # Root mean square deviation of the true tool from the commanded path [m]
    path_max_m: float  # Largest deviation [m]
    vibration_m: float  # Root mean square vibration of the true tool after the moves [m]
    vibration_relative: float  # Root mean square of the vibration over the size of its step


def step_responses(
    true: Robot,
    models: Mapping[str, Robot],
    controller: Controller,
    simulation: SimulateOptions,
    configurations: FloatArray,
    options: StepOptions,
    tool_m: FloatArray | None = None,
    parallel_map: Map | None = None,
) -> StepResponses:
    """Steps every axis in turn in every configuration, on the true robot and on the models.

    Each model turns the commanded motion, the same for all, into motor motion and feed-forward torque by inverting
    its flexible joints: gravity, inertia, viscous and, where the simulated robot has it, Coulomb friction. The true
    robot and the model itself then run under this feed-forward and the same feedback.

    Args:
        true: The true robot, without the imperfections.
        models: The identified robots by name; springs, dampers and friction are their own.
        controller: The robot's controller.
        simulation: Imperfections of the true robot, steps per sample and seed of the noise.
        configurations (n_conf, n_joint): Arm-side angles that the encoders show at rest [rad].
        options: The steps.
        tool_m (3,): Tool point in the last joint's frame; the payload's centre of mass by default [m].
        parallel_map: Ordered map that runs the configurations.

    Returns:
        Responses of all models.

    Raises:
        SettingsError: If a step outlasts the time that is compared, or a motor cannot hold the robot at rest.
        DataError: If a robot finds no equilibrium or a simulation blows up.

    Source:
        Zimmermann et al. (2023), sec. V-E; docs/methods, sec. 10.
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(true.joints))
    point = true.payload.com_m if tool_m is None else tool_m
    robots = {name: with_tool_point(robot, point) for name, robot in models.items()}
    robot = with_tool_point(true, point)
    profiles = step_profiles(robot, controller, simulation, configurations, options)
    bench = StepBench(robot, robots, controller, simulation, options.duration_s)
    tasks = [StepTask(index, *pair) for index, pair in enumerate(zip(configurations, profiles, strict=True))]
    run = partial(run_steps, bench)
    parts: list[StepRun] = parallel_map(run, tasks) if parallel_map else [run(task) for task in tasks]
    return StepResponses(
        time_s=bench.time_s,
        models=tuple(models),
        axes=tuple(joint.name for joint in true.joints),
        configurations=configurations,
        move_s=np.array([[profile.duration_s for profile in row] for row in profiles]),
        path=np.array([part.path for part in parts]),
        tool_true=np.stack([part.tool[0] for part in parts], axis=1),
        tool_model=np.stack([part.tool[1] for part in parts], axis=1),
        torque_true=np.stack([part.torque[0] for part in parts], axis=1),
        torque_model=np.stack([part.torque[1] for part in parts], axis=1),
    )


def step_figures(responses: StepResponses) -> dict[str, StepFigures]:
    """Sums up the errors of every model over configurations and axes."""
    size = responses.size_m
    tool, path, torque = responses.tool_error_m, responses.path_error_m, responses.torque_error_nm
    moved = responses.torque_true - responses.torque_true[..., :1]
    vibration = responses.vibration_m
    return {
        name: StepFigures(
            tool_rms_m=_rms(tool[index]),
            tool_max_m=float(tool[index].max()),
            tool_relative=_rms(tool[index] / size[..., None]),
            torque_rms_nm=_rms(torque[index]),
            torque_max_nm=float(np.abs(torque[index]).max()),
            torque_relative=_rms(torque[index]) / _rms(moved[index]),
            path_rms_m=_rms(path[index]),
            path_max_m=float(path[index].max()),
            vibration_m=_rms(vibration[index]),
            vibration_relative=_rms(vibration[index] / size),
        )
        for index, name in enumerate(responses.models)
    }


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


NOMINAL = "robot file"


@dataclass(frozen=True)
class Stepping:
    """Steps of one individual under control that several models design."""

    robot: Robot  # The robot file's, with the payload of the estimation
    truth: Robot  # The true robot, without its imperfections
    models: dict[str, Path]  # Where the results of the models lie, by name
    controller: Controller  # The robot's controller
    simulation: SimulateOptions  # Imperfections of the true robot
    configurations: FloatArray  # Where it is stepped [rad]
    options: StepOptions


def step_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual; none where the study steps no model."""
    study = study_of(run.loaded, ZimmermannStudy)
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
