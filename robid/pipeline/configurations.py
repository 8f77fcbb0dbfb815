"""The configurations and lines of a campaign, by one rule for what is played, what a log holds and what is planned."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.kinds import DESIGN, design_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.lines import signal_lines
from robid.errors import SettingsError
from robid.pipeline.plans import design_inputs
from robid.pipeline.stage import counted
from robid.robot.description import Robot
from robid.robot.reach import Reach, Shapes, mirror
from robid.settings.checks.experiment import sampling_period_s
from robid.settings.experiment import Campaign, Configurations, RandomConfigurations
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import require_controller
from robid.settings.robot_sections import given

_TRIES = 100
"""Configurations that are drawn for each that is wanted before a draw gives up."""
_SHOWN = 5


def configurations_of(loaded: LoadedExperiment, campaign: Campaign, inputs: Mapping[str, Path]) -> FloatArray:
    """Returns a campaign's configurations (n_conf, n_joint) [rad, or m]; one without joints where no robot is.

    Raises:
        SettingsError: If a listed or mirrored configuration is out of reach, or too few that are drawn or on the grid
            are in reach; what was measured on a real robot is taken as it is.
    """
    if loaded.experiment.robot is None:
        return np.zeros((1, 0))
    robot = loaded.robot.to_robot(campaign.payload_kg)
    measured = campaign.source is not None and campaign.source.measured is not None
    reach = Reach(robot) if measured else reach_of(loaded, robot)
    paths = dict(zip(campaign.designs, design_inputs(campaign), strict=True))
    found = {name: design_from_artifact(read_artifact(inputs[key], DESIGN)) for name, key in paths.items()}
    designs = {name: design.configurations[design.chosen] for name, design in found.items()}
    return _resolve(given(campaign.configurations), reach, designs)


def reach_of(loaded: LoadedExperiment, robot: Robot) -> Reach:
    """Returns what keeps a robot from a configuration: joint limits, floor and shapes."""
    file = loaded.robot_path
    path = None if file is None else loaded.robot.model_path(file.parent)
    names = [joint.name for joint in loaded.robot.joints]
    return Reach(robot, loaded.robot.floor_m, None if path is None else Shapes(path, names, loaded.robot.held))


def _resolve(chosen: Configurations, reach: Reach, designs: Mapping[str, FloatArray]) -> FloatArray:
    if chosen.join is not None:
        return np.concatenate([_resolve(part, reach, designs) for part in chosen.join])
    if chosen.random is not None:
        return _drawn(chosen.random, reach)
    factors = np.where(reach.robot.prismatic, 1.0, np.deg2rad(1.0))
    if chosen.grid_rows is not None:
        axes = np.meshgrid(
            *(f * np.array(row) for f, row in zip(factors, chosen.grid_rows, strict=True)), indexing="ij"
        )
        return _checked(np.stack([axis.ravel() for axis in axes], axis=-1), reach, chosen.key)
    if chosen.list_rows is not None:
        return _checked(np.array(chosen.list_rows) * factors, reach, chosen.key)
    if chosen.mirror is not None:
        return _checked(mirror(reach.robot, designs[chosen.mirror]), reach, "mirror")
    return np.concatenate([designs[name] for name in chosen.designs])


def draw_in_reach(loaded: LoadedExperiment, robot: Robot, wanted: RandomConfigurations) -> FloatArray:
    """Draws configurations (n_conf, n_joint) in reach of a robot [rad].

    Raises:
        SettingsError: If too few of those that are drawn are in reach.
    """
    return _drawn(wanted, reach_of(loaded, robot))


def _drawn(wanted: RandomConfigurations, reach: Reach) -> FloatArray:
    """Draws one configuration after the other and keeps those in reach."""
    margin = np.where(reach.robot.prismatic, wanted.margin_m, np.deg2rad(wanted.margin_deg))
    generator = np.random.default_rng(wanted.seed)
    found = np.zeros((0, len(reach.robot.joints)))
    for _ in range(_TRIES):
        shape = (wanted.count, found.shape[1])
        rows = generator.uniform(reach.robot.lower + margin, reach.robot.upper - margin, shape)
        good = [not problem for problem in reach.problems(rows)]
        found = np.concatenate([found, rows[good]])[: wanted.count]
        if len(found) == wanted.count:
            return found
    tried = _TRIES * wanted.count
    what = f"S093 only {len(found)} of {tried} drawn configurations are in reach, {wanted.count} are wanted"
    remedy = "lower `count`, or check `floor_m` and the joint limits of the robot"
    raise SettingsError(what, where="configurations.random", remedy=remedy)


def _checked(angles: FloatArray, reach: Reach, key: str) -> FloatArray:
    found = [(index, text) for index, text in enumerate(reach.problems(angles)) if text]
    if not found:
        return angles
    listed = "\n".join(f"  configuration {index + 1}: {text}" for index, text in found[:_SHOWN])
    more = f"\n  and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    what = f"S094 {len(found)} of {counted(len(angles), 'configuration')} are out of reach\n{listed}{more}"
    remedy = "leave them out, or correct the robot file's `floor_m` and limits"
    raise SettingsError(what, where=f"configurations.{key}", remedy=remedy)


def campaign_lines(loaded: LoadedExperiment, campaign: Campaign) -> tuple[IntArray, IntArray]:
    """Returns the excited and the detection lines of a campaign.

    Raises:
        SettingsError: If its signal cannot be made, or nothing says how it is sampled.
    """
    return signal_lines(campaign.excitation, campaign_sampling_s(loaded, campaign))


def campaign_sampling_s(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Returns the sampling period of a campaign: the log's, else the controller's [s].

    Raises:
        SettingsError: If there is neither.
    """
    found = sampling_period_s(campaign, loaded.robot)
    return require_controller(loaded).sampling_period_s if found is None else found
