"""Arms and axes against what is known of them: published values of recordings, the truth of simulated robots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.design.excitation.excitation import Excitation
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.fitting import true_base_values
from robid.models.rigid.settings import rigid_fit
from robid.pipeline.configurations import configurations_of
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section, Table
from robid.robot.description import Robot
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.settings.yaml import load_yaml
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, SimulateOptions, Truth
from robid.simulate.truth import true_robot
from robid.studies.experiments import Further, run_of
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.parts import CoverageCase, RealCase, RecordedCase
from robid.studies.simulated import simulate_options
from robid.studies.study import Content, Part, Results, Task, in_chunks, recorded_part, values_of

PUBLISHED: Mapping[str, float] = {
    **{"Ia3": 0.0988, "Ia4": 0.0313, "Ia5": 0.0468, "Ia6": 0.0105, "Iam6": 0.00964, "fvm6": 0.616},
    **{"fv1": 8.05, "fv2": 5.53, "fv3": 1.97, "fv4": 1.11, "fv5": 1.86, "fv6": 0.65},
    **{"fs1": 7.14, "fs2": 8.26, "fs3": 6.34, "fs4": 2.48, "fs5": 3.03, "fs6": 0.282, "fsm6": 1.95},
}
"""Arm-side values of the recording's authors: inertias [kg m^2], viscous [N m s/rad] and Coulomb friction [N m]."""

_INERTIAS = ("Ia3", "Ia4", "Ia5", "Ia6", "Iam6", "fvm6")
_VISCOUS = ("fv1", "fv2", "fv3", "fv4", "fv5", "fv6")
_UNITS = {"Ia": "kg m^2", "fv": "N m s/rad", "fs": "N m"}


def published_rows(solution: RigidSolution, robot: Robot) -> dict[str, tuple[float, float]]:
    """Returns the published parameters, each with what a fit found of it, by their names in the literature."""
    found = arm_side(solution.estimate.found, robot)
    return {name: (value, found[name]) for name, value in PUBLISHED.items()}


def tx40_figures(solution: RigidSolution, robot: Robot) -> dict[str, float]:
    """Returns the figures of the study: how far a fit is from what was published, and what its residuals say."""
    pairs = published_rows(solution, robot)
    error = {name: 100 * abs(found / published - 1) for name, (published, found) in pairs.items()}
    return {
        "tx40.max_inertia_error_percent": max(error[name] for name in _INERTIAS),
        "tx40.max_viscous_error_percent": max(error[name] for name in _VISCOUS),
        "tx40.relative_error_percent": 100 * solution.residuals.total_error,
        "tx40.trusted": float(solution.checks.trust),
    }


def arm_side(parameters: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Returns motor inertias and friction as the literature writes them, at the axes.

    A motor's inertia `J` and friction count with its gear ratio squared, Coulomb friction with the ratio. Motor 6 turns
    with axes 5 and 6: `Iam6 = J6`, `Ia5 = J5 + J6`, `Ia6 = J6 + ` the coupled gear's own, viscous friction alike. Of
    Coulomb friction, which feels each speed by itself, `fsm6` is motor 6's and `fs6` the coupled gear's.
    """
    joints = dict(enumerate(robot.joints, start=1))
    gear, result = robot.joints[-1].name, dict[str, float]()
    for letter, kind, coupled in (
        ("Ia", "motor_inertia", "coupling_inertia"),
        ("fv", "viscous", "coupling_viscous"),
        ("fs", "coulomb", "coupling_coulomb"),
    ):
        power = 1 if letter == "fs" else 2
        own = {
            index: abs(joint.motor.gear_ratio) ** power * parameters[f"{joint.name}.{kind}"]
            for index, joint in joints.items()
            if f"{joint.name}.{kind}" in parameters
        }
        wrist = own.pop(len(joints))
        shared = 0.0 if letter == "fs" else wrist
        own[len(joints) - 1] += shared
        result |= {f"{letter}{index}": value for index, value in own.items()}
        result |= {f"{letter}6": shared + parameters[f"{gear}.{coupled}"], f"{letter}m6": wrist}
    return result


_ASKED = {"tx40.max_inertia_error_percent": Asked(upper=15.0), "tx40.max_viscous_error_percent": Asked(upper=20.0)}


def _conclude_tx40(_run: Run, _case: RecordedCase, own: Run, models: list[Artifact]) -> PartFound:

    solution = solution_from_artifact(models[0])
    robot = own.loaded.robot.to_robot()
    rows = tuple(
        (name, _UNITS[name[:2]], significant(published), significant(found), f"{100 * (found / published - 1):+.1f} %")
        for name, (published, found) in published_rows(solution, robot).items()
    )
    caption = "Arm side, as published; the wrist's sixth motor turns with axes 5 and 6."
    table = Table(("Parameter", "Unit", "Published", "Ours", "Off"), rows, caption=caption, fit="compact")
    section = Section("Real data: the TX40", solution.checks.sentence, (table,))
    return PartFound(tx40_figures(solution, robot), _ASKED, (section,))


_FITS = ("axis", "asymmetric")
_KINDS = {"inertia": "M", "mass": "M", "viscous": "Fv", "coulomb": "Fc", "torque_offset": "offset"}
_DIGITS = 6  # as they are published
_NEAR, _NEAR_OFFSET, _NEAR_ERROR = 0.01, 0.02, 0.1


def _conclude_emps(run: Run, case: RealCase, _own: Run, models: list[Artifact]) -> PartFound:
    published = load_yaml(run.loaded.path.parent / case.published).data
    plain, asymmetric = map(solution_from_artifact, models)
    estimate = plain.estimate
    named = zip(estimate.kinds, estimate.value.tolist(), strict=True)
    figures = {
        **{f"emps.{_KINDS[kind]}": value for kind, value in named if kind in _KINDS},
        "emps.condition": plain.base.unscaled_condition,
        "emps.relative_error_percent": 100 * plain.residuals.total_error,
        "emps.asymmetric_relative_error_percent": 100 * asymmetric.residuals.total_error,
    }
    theirs = {name: value for name, value in _published(published).items() if f"emps.{name}" in figures}
    columns = (
        ("Figure", lambda name: name),
        ("Published", lambda name: significant(theirs[name], _DIGITS)),
        ("Ours", lambda name: significant(figures[f"emps.{name}"], _DIGITS)),
    )
    caption = (
        "M [kg], Fv [N s/m], Fc and offset [N]; condition number of the unscaled decimated rows; norm of the residual"
        " over that of the force. Nothing is dropped near zero speed."
    )
    lead = f"A carriage on a ball screw, measured: ordinary least squares. {plain.checks.sentence}"
    shown = table(columns, theirs, caption=caption, fit="compact")
    section = Section("Real data: the EMPS axis", lead, (shown,))
    return PartFound(figures, asked_of(published), (section,))


EMPS = recorded_part("emps", "The EMPS axis", lambda _case: _FITS, _conclude_emps)


def _published(values: Mapping[str, Any]) -> dict[str, float]:
    keys = ("condition", "relative_error_percent", "asymmetric_relative_error_percent")
    return {**values["ordinary"], **{key: values[key] for key in keys}}


def asked_of(values: Mapping[str, Any]) -> dict[str, Asked]:
    """Returns how near to the published values the figures must lie."""
    asked = {}
    for name, value in _published(values).items():
        reach = _NEAR_ERROR if name.endswith("percent") else abs(value) * (_NEAR_OFFSET if name == "offset" else _NEAR)
        asked[f"emps.{name}"] = Asked(value - reach, value + reach)
    return asked


TX40 = recorded_part("tx40", "The TX40", lambda case: (case.fit,), _conclude_tx40)


_FRICTION = (".viscous", ".coulomb")


def _conclude_kr300(_run: Run, _case: CoverageCase, results: Results) -> PartFound:
    own = {name: [values_of(each) for each in results if each.attributes["joints"] == name] for name in JOINTS}
    found: dict[str, dict[str, float]] = {}
    for joints, rows in own.items():
        if not rows:
            continue
        value, truth, std, inside = (
            np.concatenate([row[key] for row in rows]) for key in ("value", "truth", "std", "inside")
        )
        friction = [at for at, name in enumerate(rows[0]["names"].tolist()) if name.endswith(_FRICTION)]
        error = np.abs(value[:, friction] / truth[:, friction] - 1)
        found[joints] = {
            "robots": float(len(value)),
            "coverage_95": float(inside.mean()),
            "rms_deviations": float(np.sqrt(np.mean(((value - truth) / std) ** 2))),
            "median_friction_error": float(np.median(error)),
            "worst_friction_error": float(error.mean(axis=0).max()),
        }
    prefixes = {"rigid": "kr300.", "elastic": "kr300.elastic."}
    figures = {f"{prefixes[name]}{key}": value for name, one in found.items() for key, value in one.items()}
    columns = (
        ("Joints", lambda name: name),
        ("Robots", lambda name: f"{found[name]['robots']:.0f}"),
        ("Intervals that hold", lambda name: percent(found[name]["coverage_95"])),
        ("Errors, in deviations", lambda name: significant(found[name]["rms_deviations"], 3)),
        ("Friction off (median)", lambda name: percent(found[name]["median_friction_error"])),
        ("(worst mean)", lambda name: percent(found[name]["worst_friction_error"])),
    )
    caption = (
        "95 % intervals of all base parameters; friction, ripple, resolver and encoder errors and torque noise are on."
        " Rigid joints are what the model assumes; the springs of elastic ones it does not know."
    )
    section = Section("Six axes: intervals against the truth", "", (table(columns, found, caption=caption),))
    return PartFound(figures, {"kr300.coverage_95": Asked(0.92, 0.98)}, (section,))


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


def _further_kr300(run: Run, case: CoverageCase) -> Further:
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
            tasks.append(Task(f"{name}_{seeds.start}", {**decides, "joints": name, "seeds": list(seeds)}, (argument,)))
    return tasks


def _identify_robots(one: Robots) -> Content:
    rows = [_identify(one, seed) for seed in one.seeds]
    names, *values = (np.array([row[index] for row in rows]) for index in range(5))
    kept = (
        ("value", "SI", "Estimates"),
        ("truth", "SI", "True values"),
        ("std", "SI", "Deviations that the fit states"),
        ("inside", "1", "Whether the interval contains the truth"),
    )
    axes, shown = ("seed", "parameter"), zip(kept, values, strict=True)
    datasets = {key: Dataset(each, unit, axes, what) for (key, unit, what), each in shown}
    datasets["names"] = Dataset(names[0], "1", ("parameter",))
    return Content(datasets, {"joints": "rigid" if not one.robot.springs else "elastic"})


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
    known = true_base_values(one.robot, true, one.options)
    truth = np.array([known[name] for name in found.names])
    # Torque constants are exact here: the interval that residuals give is the one to count.
    lower, upper = found.effective_interval
    inside = (lower <= truth) & (truth <= upper)
    std = np.sqrt(np.diag(found.covariance))
    return found.names, found.value.tolist(), truth.tolist(), std.tolist(), inside.tolist()


KR300 = Part("kr300", _conclude_kr300, kr300_tasks, _identify_robots, _further_kr300)
