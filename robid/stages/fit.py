"""fit: the parameters of a model from frequency responses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.model import MODEL, model_to_artifact
from robid.artifacts.store import inspect_artifact, read_artifact, write_artifact
from robid.families.elastic.settings import elastic_fit
from robid.fit.bootstrap import bootstrap_tasks
from robid.fit.elastic import fit_elastic
from robid.fit.solution import Solution
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, robot_settings
from robid.settings.slices import to_plain
from robid.stages.stage import Graded, Job, Plan, Stage, counted
from robid.validation.assessment import assess_fit


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(experiment.fits)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    fit = loaded.experiment.fits[owner]
    plain = {key: value for key, value in to_plain(fit).items() if key != "validate_on"}
    settings = {f"fits.{owner}": plain, **model_settings(loaded, fit.campaign)}
    return Plan((f"fits/{owner}/model.h5",), settings, frf_inputs(fit))


def frf_inputs(fit: FitSettings) -> dict[str, str]:
    """Returns where the responses of a fit lie; the first one's name is its kind."""
    further = {f"frf_{name}": f"{name}/frf.h5" for name in fit.campaigns[1:]}
    return {"frf": f"{fit.campaign}/frf.h5", **further}


def read_frf(fit: FitSettings, inputs: Mapping[str, Path]) -> Frf:
    """Reads the response that a fit is fitted to, in its configurations."""
    frfs = [frf_from_artifact(read_artifact(inputs[name], FRF)) for name in frf_inputs(fit)]
    return chosen_frf(fit, frfs)


def chosen_frf(fit: FitSettings, frfs: Sequence[Frf]) -> Frf:
    """Joins the responses of a fit's campaigns and selects its configurations."""
    frf = frfs[0] if len(frfs) == 1 else join(frfs, fit.campaigns)
    return frf if fit.configurations is None else frf.select(fit.configurations)


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the elastic model of a campaign is made of; the delay of a log is none."""
    used = loaded.experiment.campaigns[campaign]
    parts = robot_settings(loaded, "mechanics", "inertia_std", "sensors")
    settings = {f"campaigns.{campaign}.payload_kg": used.payload_kg, **parts}
    settings["delay_s"] = delay_s(loaded, used)
    return settings


def _run(job: Job) -> str:
    fit = elastic_fit(job.loaded.experiment, job.owner)
    campaign = job.loaded.experiment.campaigns[fit.campaign]
    frf = read_frf(fit, job.inputs)
    robot = job.loaded.robot.to_robot(campaign.payload_kg)
    job.progress.expect(fit.starts + bootstrap_tasks(fit.bootstrap), "tasks" if fit.bootstrap else "starts")

    def told(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        return job.map(function, tasks, lambda _index, _result: job.progress.advance())

    solution = fit_elastic(robot, frf, fit.options(), delay_s(job.loaded, campaign), told)
    grade = assess_fit(robot, solution, frf, fit.options(), delay_s(job.loaded, campaign))
    write_artifact(job.output, model_to_artifact(solution, job.provenance(STAGE.name, fit.seed), grade))
    return figures(solution)


def graded(path: Path) -> Graded | None:
    """Reads the grade that an artifact holds."""
    attributes = inspect_artifact(path)["attributes"]
    if "grade/value" not in attributes:
        return None
    return Graded(int(attributes["grade/value"]), str(attributes["grade/sentence"]))


def _grade(loaded: LoadedExperiment, owner: str, output: Path) -> Graded | None:
    """Where a fit is validated, the validation owns the grade."""
    return graded(output) if loaded.experiment.fits[owner].validate_on is None else None


def with_torque_unit(unit: str, torque_unit: str) -> str:
    """Writes a unit with what stands for N m where the torque constant is unknown."""
    if torque_unit == "N m":
        return unit
    return unit.replace("kg m^2", "N m s^2/rad").replace("N m", torque_unit)


def figures(solution: Solution) -> str:
    """Says how the fit ended, in a phrase."""
    best = int(np.sum(solution.start_minimum == 0))
    identifiable = f"{int(np.sum(solution.identifiable))} of {counted(len(solution.names), 'parameter')} identifiable"
    known = int(np.sum(solution.known_beforehand))
    identifiable += f" ({known} more known beforehand)" if known else ""
    expected = float(solution.expected_cost.sum())
    ratio = f", {solution.configuration_cost.sum() / expected:.3g} times what noise alone gives" if expected > 0 else ""
    used = solution.start_evaluations
    effort = f", {np.median(used):.0f} evaluations each, at most {used.max()}" if used.size else ""
    if solution.cap_share:
        effort += f", {solution.cap_share:.0%} at the iteration limit"
    return (
        f"{solution.status}, {identifiable},"
        f" cost {solution.cost:.4g}{ratio},"
        f" {best} of {counted(len(solution.start_cost), 'start')} at the best minimum{effort}"
    )


def _problem(output: Path) -> str:
    attributes = inspect_artifact(output)["attributes"]
    if attributes["status"] == "converged":
        return ""
    return f"the fit has not converged ({attributes['status']}): {attributes['advice']}"


STAGE = Stage(
    "fit",
    "Fits a model to frequency responses.",
    "fit",
    MODEL,
    _owners,
    _plan,
    _run,
    _problem,
    grade=_grade,
)
