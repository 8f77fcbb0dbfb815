"""Robots of one kind, each recorded along the same trajectories and identified: how often intervals hold the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.artifacts.artifact import Dataset
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.design.excitation.excitation import Excitation
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.settings import rigid_fit
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import build_rigid_model
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, SimulateOptions, Truth
from robid.simulate.truth import true_robot
from robid.stages.configurations import configurations_of
from robid.studies.elsewhere import run_of
from robid.studies.janot2009.section import study_of
from robid.studies.simulated import simulate_options
from robid.studies.tasks import Content, Task

JOINTS = ("rigid", "elastic")


@dataclass(frozen=True)
class Robots:
    """Some robots of one kind.

    Attributes:
        robot: The robot file's, with or without its springs.
        controller: Its controller.
        excitation: The trajectories.
        configuration (n_joint,): Where they begin.
        periods: Recorded periods.
        simulated: How they are simulated, seeds left open.
        truth: How they deviate from the file, seeds left open.
        options: How they are identified.
        seeds: One for each robot and its noise.
    """

    robot: Robot
    controller: Controller
    excitation: Excitation
    configuration: tuple[float, ...]
    periods: int
    simulated: SimulateOptions
    truth: Truth
    options: RigidFitOptions
    seeds: tuple[int, ...]


def further_kr300(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the arm's experiment with the trajectories that all robots play."""
    case = study_of(run.loaded).kr300
    if case is None:
        return ()
    return ((run_of(run, case.experiment, "kr300"), (f"{case.campaign}/excitation.h5",)),)


def kr300_tasks(run: Run) -> list[Task]:
    """Returns the tasks: some robots each, rigid ones, then elastic ones; none where the study leaves them out."""
    case = study_of(run.loaded).kr300
    if case is None:
        return []
    own = run_of(run, case.experiment, "kr300")
    campaign = own.loaded.experiment.campaigns[case.campaign]
    path, options = own.path(f"{case.campaign}/excitation.h5"), rigid_fit(own.loaded.experiment, case.fit).options()
    decides = {
        **robot_settings(own.loaded, "mechanics", "rigid", "friction", "controller", "timing"),
        "excitation": read_header(path).content_sha256,
        "campaign": plain_settings(campaign),
        "options": plain_settings(options),
    }
    robot, simulated = own.loaded.robot.to_robot(campaign.payload_kg), simulate_options(campaign)
    one = Robots(
        robot=robot,
        controller=require_controller(own.loaded),
        excitation=excitation_from_artifact(read_artifact(path, EXCITATION)).excitation,
        configuration=tuple(configurations_of(own.loaded, campaign, {})[0].tolist()),
        periods=campaign.periods,
        simulated=simulated,
        truth=simulated.truth,
        options=replace(options, instruments="none", physical=False, sweep=()),
        seeds=(),
    )
    tasks = []
    for name, count in zip(JOINTS, (case.seeds, case.elastic_seeds), strict=True):
        own_robot = replace(robot, springs=()) if name == "rigid" else robot
        for first in range(case.first_seed, case.first_seed + count, case.seeds_per_task):
            seeds = tuple(range(first, min(first + case.seeds_per_task, case.first_seed + count)))
            argument = replace(one, robot=own_robot, seeds=seeds)
            tasks.append(Task(f"{name}_{first}", {**decides, "joints": name, "seeds": list(seeds)}, argument))
    return tasks


def identify_robots(one: Robots) -> Content:
    """Simulates and identifies some robots."""
    rows = [_identify(one, seed) for seed in one.seeds]
    axes = ("seed", "parameter")
    names = np.array(rows[0][0])
    value, truth, std, inside = (np.array([row[index] for row in rows]) for index in range(1, 5))
    return Content(
        {
            "names": Dataset(names, "1", ("parameter",)),
            "value": Dataset(value, "SI", axes, "Estimates"),
            "truth": Dataset(truth, "SI", axes, "True values"),
            "std": Dataset(std, "SI", axes, "Deviations that the fit states"),
            "inside": Dataset(inside, "1", axes, "Whether the interval holds the truth"),
        },
        {"joints": "rigid" if not one.robot.springs else "elastic"},
    )


def _identify(one: Robots, seed: int) -> tuple[tuple[str, ...], list[float], list[float], list[float], list[bool]]:
    true = true_robot(one.robot, replace(one.truth, seed=seed))
    experiment = SimulatedExperiment(
        robot=true,
        controller=one.controller,
        options=replace(one.simulated, seed=seed),
        reference=one.excitation.reference,
        inject=one.excitation.kind,
        excited_lines=one.excitation.excited_lines,
        detection_lines=one.excitation.detection_lines,
        periods=one.periods,
    )
    record = simulate(experiment, np.array(one.configuration), 0)
    shots = shots_of(record, one.robot, late_samples=one.controller.delay_samples)
    found = fit_rigid(one.robot, shots, one.options).estimate
    base = find_base_parameters(build_rigid_model(one.robot, one.options.model), one.options.base)
    values = base.values(build_rigid_model(true, one.options.model).nominal)
    known = dict(zip(base.base_names, values.tolist(), strict=True))
    truth = np.array([known[name] for name in found.names])
    inside = (found.lower <= truth) & (truth <= found.upper)
    std = np.sqrt(np.diag(found.covariance))
    return found.names, found.value.tolist(), truth.tolist(), std.tolist(), inside.tolist()
