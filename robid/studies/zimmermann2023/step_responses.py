"""Steps of one axis at a time: the true robot under control that each model designs, against its own prediction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np

from robid.arrays import FloatArray, Quantity, check_shape
from robid.robot.description import Robot
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.playback import with_tool_point
from robid.studies.settings.steps import StepOptions
from robid.studies.zimmermann2023.step_bench import StepBench, StepRun, StepTask, run_steps
from robid.studies.zimmermann2023.step_profile import step_profiles

_TREND = 3  # degree; the feedback's slow settling is no vibration

Map = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]


_TOOL = "model configuration axis time xyz"


@dataclass(frozen=True)
class StepResponses:
    """What the tool point and the stepped axis' motor did; arrays begin with (n_model, n_conf, n_axis)."""

    time_s: Annotated[FloatArray, Quantity("s", "time", "From the beginning of a step")]
    models: Annotated[tuple[str, ...], Quantity("1", "model", "Name of each model")]
    axes: Annotated[tuple[str, ...], Quantity("1", "axis", "Name of each stepped axis")]
    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side angles at rest")]
    move_s: Annotated[FloatArray, Quantity("s", "configuration axis", "Duration of the commanded move")]
    path: Annotated[
        FloatArray, Quantity("m", "configuration axis time xyz", "Displacement of a rigid robot's tool point")
    ]
    tool_true: Annotated[FloatArray, Quantity("m", _TOOL, "Displacement of the true tool point", compact=True)]
    tool_model: Annotated[FloatArray, Quantity("m", _TOOL, "Displacement that the model predicts", compact=True)]
    torque_true: Annotated[
        FloatArray, Quantity("N m", "model configuration axis time", "Torque of the stepped axis", compact=True)
    ]
    torque_model: Annotated[
        FloatArray, Quantity("N m", "model configuration axis time", "What the model predicts", compact=True)
    ]

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
    """Errors of one model over all configurations and axes.

    Attributes:
        tool_rms_m: Root mean square error of the predicted tool displacement [m].
        tool_max_m: Largest error of it [m].
        tool_relative: Root mean square of the error over the size of its step.
        torque_rms_nm: Root mean square error of the predicted torque of the stepped axis [N m].
        torque_max_nm: Largest error of it [N m].
        torque_relative: Root mean square error over the root mean square of the torque's change from rest.
        path_rms_m: Root mean square deviation of the true tool from the commanded path [m].
        path_max_m: Largest deviation [m].
        vibration_m: Root mean square vibration of the true tool after the moves [m].
        vibration_relative: Root mean square of the vibration over the size of its step.
    """

    tool_rms_m: float
    tool_max_m: float
    tool_relative: float
    torque_rms_nm: float
    torque_max_nm: float
    torque_relative: float
    path_rms_m: float
    path_max_m: float
    vibration_m: float
    vibration_relative: float


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
        Zimmermann et al. (2023), sec. V-E; METHODS sec. 10.
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
