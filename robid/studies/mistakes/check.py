"""What must hold between a study of mistakes and the experiment around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import ValidationError

from robid.results.doubt import CAUSES
from robid.settings.checks.campaigns import check_truth
from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.changed import changed_simulation
from robid.studies.settings.study import Mistake, MistakesStudy


def check_mistakes(experiment: Experiment, robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of mistakes."""
    study = experiment.study
    if not isinstance(study, MistakesStudy):
        return
    message = fit_problem(experiment, study.fit)
    if message:
        yield ("study", "fit"), message
    for name, mistake in study.mistakes.items():
        field = ("study", "mistakes", name)
        if mistake.cause is not None and mistake.cause not in CAUSES:
            yield (*field, "cause"), f"there is no cause `{mistake.cause}`; {suggest(mistake.cause, CAUSES)}"
        if mistake.robot == "light" and study.light is None:
            yield (*field, "robot"), "the study has no `light` robot"
        if mistake.robot == "heavy":
            found = mistake_problems(mistake, experiment, study.fit, robot)
            yield from (((*field, *place), message) for place, message in found)
    yield from _check_units(study)
    judge, choose = study.seeds.judge, study.seeds.choose
    first, last = sorted((judge, choose), key=lambda seeds: seeds.first)
    if first.end(units=study.units is not None) > last.first:
        yield ("study", "seeds"), "the seeds of `judge` and `choose` overlap"


def _check_units(study: MistakesStudy) -> Iterator[tuple[FieldPath, str]]:
    """Yields robots that a mistake of units names and that are not there."""
    if study.units is None:
        if study.only == "units":
            yield ("study", "only"), "the study has no `units`"
        return
    robots = study.units.robots
    yield from _unknown(("study", "units", "only"), study.units.only or (), "robot", list(robots))
    for name, mistake in study.units.mistakes.items():
        for key in ("log", "same"):
            field = ("study", "units", "mistakes", name, key)
            yield from _unknown(field, list(getattr(mistake, key)), "robot", list(robots))


def fit_problem(experiment: Experiment, name: str) -> str:
    """Says why a fit cannot be studied: it is not there, or its robot's truth is not known."""
    fit = experiment.fits.get(name)
    if fit is None:
        return f"there is no fit `{name}`; {suggest(name, experiment.fits)}"
    if fit.validate_on is None or len(fit.campaigns) > 1 or fit.configurations is not None:
        return f"fit `{name}` needs one campaign with all its configurations, and one to `validate_on`"
    sources = (experiment.campaigns[each].source for each in (fit.campaign, fit.validate_on))
    if any(source is None or source.simulate is None for source in sources):
        return f"a campaign of fit `{name}` is not simulated, so its true robot is not known"
    return ""


def mistake_problems(
    mistake: Mistake, experiment: Experiment, fit: str, robot: RobotFile | None
) -> Iterator[tuple[FieldPath, str]]:
    """Yields what a mistake names that its robot or the simulation does not have."""
    if not fit_problem(experiment, fit):
        yield from _check_physics(experiment.campaigns[experiment.fits[fit].campaign], mistake, robot)
    if robot is None:
        return
    joints, springs = [joint.name for joint in robot.joints], [spring.name for spring in robot.all_springs]
    for key in ("torque_factor", "angle_factor", "gear_ratio_factor"):
        yield from _unknown((key,), list(getattr(mistake, key)), "joint", joints)
    for index, name in enumerate(mistake.without_springs):
        yield from _unknown(("without_springs", index), [name], "spring", springs)


def _unknown(
    field: FieldPath, names: Sequence[str], kind: str, known: Sequence[str]
) -> Iterator[tuple[FieldPath, str]]:
    yield from ((field, f"there is no {kind} `{name}`; {suggest(name, known)}") for name in names if name not in known)


def _check_physics(campaign: Campaign, mistake: Mistake, robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    try:
        changed = changed_simulation(campaign, mistake.physics)
    except ValidationError as error:
        yield from (((*each["loc"][1:3],), each["msg"]) for each in error.errors())
        return
    if robot is not None:
        yield from check_truth((), campaign, changed, robot)
