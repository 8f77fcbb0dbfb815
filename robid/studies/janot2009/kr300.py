"""Robots of six axes on the same trajectories, each identified: how often intervals hold the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.design.excitation.excitation import Excitation
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.settings import rigid_fit
from robid.pipeline.configurations import configurations_of
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section, Table
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import build_rigid_model
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, SimulateOptions, Truth
from robid.simulate.truth import true_robot
from robid.studies.experiments import Further, run_of
from robid.studies.settings.parts import CoverageCase
from robid.studies.simulated import simulate_options
from robid.studies.study import Asked, Part, PartFound
from robid.studies.tasks import Content, Results, Task, in_chunks

_FRICTION = (".viscous", ".coulomb")


def conclude_kr300(_run: Run, _case: CoverageCase, results: Results) -> PartFound:
    """Counts how often intervals held the truth, and how far friction and the rest were off."""
    figures: dict[str, float] = {}
    rows = []
    for name in JOINTS:
        own = [each for each in results if each.attributes["joints"] == name]
        if not own:
            continue
        found = _figures(own)
        prefix = "kr300." if name == "rigid" else "kr300.elastic."
        figures |= {f"{prefix}{key}": value for key, value in found.items()}
        rows.append(
            (
                name,
                f"{found['robots']:.0f}",
                percent(found["coverage_95"]),
                significant(found["rms_deviations"], 3),
                percent(found["median_friction_error"]),
                percent(found["worst_friction_error"]),
            )
        )
    heads = (
        "Joints",
        "Robots",
        "Intervals that hold",
        "Errors, in deviations",
        "Friction off (median)",
        "(worst mean)",
    )
    caption = (
        "95 % intervals of all base parameters; friction, ripple, resolver and encoder errors and torque noise are on."
        " Rigid joints are what the model assumes; the springs of elastic ones it does not know."
    )
    section = Section("Six axes: intervals against the truth", "", (Table(heads, tuple(rows), caption=caption),))
    return PartFound(figures, {"kr300.coverage_95": Asked(0.92, 0.98)}, (section,))


def _figures(results: Sequence[Artifact]) -> dict[str, float]:
    names = results[0].datasets["names"].values.tolist()
    value, truth, std, inside = (
        np.concatenate([each.datasets[key].values for each in results]) for key in ("value", "truth", "std", "inside")
    )
    friction = [index for index, name in enumerate(names) if name.endswith(_FRICTION)]
    error = np.abs(value[:, friction] / truth[:, friction] - 1)
    return {
        "robots": float(len(value)),
        "coverage_95": float(inside.mean()),
        "rms_deviations": float(np.sqrt(np.mean(((value - truth) / std) ** 2))),
        "median_friction_error": float(np.median(error)),
        "worst_friction_error": float(error.mean(axis=0).max()),
    }


JOINTS = ("rigid", "elastic")


@dataclass(frozen=True)
class Robots:
    """Some robots of one kind."""

    robot: Robot  # The robot file's, with or without its springs
    controller: Controller
    excitation: Excitation  # The trajectories
    configuration: tuple[float, ...]  # (n_joint,) where they begin
    periods: int  # Recorded periods
    simulated: SimulateOptions  # How they are simulated, seeds left open
    truth: Truth  # How they deviate from the file, seeds left open
    options: RigidFitOptions  # How they are identified
    seeds: tuple[int, ...]  # One for each robot and its noise


def further_kr300(run: Run, case: CoverageCase) -> Further:
    """Returns the arm's experiment with the trajectories that all robots play."""
    return ((run_of(run, case.experiment, "kr300"), (f"{case.campaign}/excitation.h5",)),)


def kr300_tasks(run: Run, case: CoverageCase, _earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: some robots each, rigid ones, then elastic ones."""
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
        for seeds in in_chunks(case.first_seed, count, case.seeds_per_task):
            argument = replace(one, robot=own_robot, seeds=tuple(seeds))
            tasks.append(Task(f"{name}_{seeds.start}", {**decides, "joints": name, "seeds": list(seeds)}, argument))
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


KR300 = Part("kr300", conclude_kr300, kr300_tasks, identify_robots, further_kr300)
