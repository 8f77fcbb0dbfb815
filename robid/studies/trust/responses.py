"""The machines of the study of trust, the places in which each robot is measured, its fits, and their grades."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from robid.artifacts.artifact import Attribute
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fitting import true_values
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.validating import validate_elastic
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.robot.description import Robot
from robid.robot.nuisance import NuisanceStd
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.robot_sections import given
from robid.simulate.truth import TrueRobot
from robid.studies.experiments import Further, both_runs, changed_simulation, excitations
from robid.studies.mistakes.cases import GRADING, about_findings, refused_causes
from robid.studies.settings.trust import Individual, TrustStudy, individuals, trusted_problems
from robid.studies.simulated import (
    REFUSAL,
    kept_or_refused,
    kept_solution,
    kept_truth,
    measurements,
    played,
    read_responses,
    threads_of,
    with_truth,
)
from robid.studies.study import Content, Earlier, Results, Task, study_of

RANDOM, FRESH, DESIGNED = "random", "fresh", "designed"
"""What places are for: the fit, the reference, the fit in places that a design chose."""


@dataclass(frozen=True)
class Places:
    """A campaign that a robot is measured with, in places of its own."""

    owner: str
    campaign: Campaign
    content: CampaignExcitation


@dataclass(frozen=True)
class Machine:
    """One of the two kinds of robot, in a run folder of its own."""

    run: Run
    places: dict[str, Places]

    def places_of(self, one: Individual, use: str) -> Places:
        """Returns a campaign in the places of a robot: drawn for it, but for those that a design chose."""
        places, loaded = self.places[use], self.run.loaded
        if use == DESIGNED:
            return places
        stated, count = given(given(places.campaign.configurations).random), len(places.content.configurations)
        wanted = stated.model_copy(update={"count": count, "seed": 2 * one.seed + (use == FRESH)})
        drawn = draw_in_reach(loaded, loaded.robot.to_robot(places.campaign.payload_kg), wanted)
        return replace(places, content=replace(places.content, configurations=drawn))


def campaigns_of(loaded: LoadedExperiment, study: TrustStudy) -> dict[str, str]:
    """Returns the names of an experiment's campaigns by what they are for."""
    fit = loaded.experiment.fits[study.fit]
    named = {RANDOM: fit.campaign, FRESH: str(fit.validate_on)}
    return named if study.designed is None else {**named, DESIGNED: study.designed}


def needs(loaded: LoadedExperiment, study: TrustStudy | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    return excitations(campaigns_of(loaded, study or study_of(loaded, TrustStudy)).values())


def further(run: Run) -> Further:
    """Returns the light robot's experiment, whose chain must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded, TrustStudy)
    return tuple((one, needs(one.loaded, study)) for name, one in _runs(run, study).items() if name == "light")


def machines(run: Run) -> dict[str, Machine]:
    """Returns the two kinds of robot by name, once their chains are there."""
    study = study_of(run.loaded, TrustStudy)

    def places(one: Run) -> dict[str, Places]:
        owners, known = campaigns_of(one.loaded, study), one.loaded.experiment.campaigns
        return {use: Places(owner, known[owner], played(one, owner)) for use, owner in owners.items()}

    return {name: Machine(one, places(one)) for name, one in _runs(run, study).items()}


def _runs(run: Run, study: TrustStudy) -> dict[str, Run]:
    return both_runs(run, study.light, lambda own: trusted_problems(study, "light", own.experiment, own.robot))


_NOISE = (RANDOM, FRESH, DESIGNED)  # each has noise of its own


def simulated(run: Run) -> list[Individual]:
    """Returns the robots that are simulated."""
    return [one for one in individuals(study_of(run.loaded, TrustStudy)) if one.kind != "linear"]


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each place of each robot that is simulated."""
    study, known, found = study_of(run.loaded, TrustStudy), machines(run), list[Task]()
    for one in simulated(run):
        machine = known[one.robot]
        for use, count in uses(one, study, machine):
            places = machine.places_of(one, use)
            noise = len(_NOISE) * one.seed + _NOISE.index(use)
            options = changed_simulation(places.campaign, one.physics, one.seed, noise)
            content = replace(places.content, configurations=places.content.configurations[:count])
            name = f"{one.key}_{use}"
            found += measurements(machine.run.loaded, places.campaign, options, content, name, threads_of(run))
    return found


def uses(one: Individual, study: TrustStudy, machine: Machine) -> Iterator[tuple[str, int | None]]:
    """Yields what a robot's places are for, and how many of them are measured; None is all."""
    if one.kind == "cause":
        yield RANDOM, study.cause_places
        return
    yield RANDOM, None
    yield FRESH, None if one.referenced else study.validated_in
    if one.referenced and DESIGNED in machine.places:
        yield DESIGNED, None


def files_of(results: Results, one: Individual, use: str) -> tuple[Path, ...]:
    """Returns where the responses of a robot lie, place by place."""
    prefix = f"{one.key}_{use}_"
    found = {path.name.split(".")[0]: path for path in results.paths if path.name.startswith(prefix)}
    return tuple(found[f"{prefix}{number}"] for number in range(1, len(found) + 1))


@dataclass(frozen=True)
class Fitting:
    """A fit."""

    responses: tuple[Path, ...]
    robot: Robot
    options: ElasticOptions
    delay_s: float
    truth: TrueRobot


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the fits."""
    study, known, found = study_of(run.loaded, TrustStudy), machines(run), list[Task]()
    for one in simulated(run):
        # Those of the reference are fitted in all of their places, each on their own.
        placed = (use for use, _ in uses(one, study, known[one.robot]))
        for use in (use for use in placed if use == RANDOM or one.referenced):
            decides, fitting = make_fitting(run, known[one.robot], one, use, earlier[0])
            found.append(Task(f"{one.key}_{use}", decides, (fitting,)))
    return found


def make_fitting(
    run: Run, machine: Machine, one: Individual, use: str, responses: Results
) -> tuple[dict[str, Any], Fitting]:
    """Returns a fit with what decides its result."""
    loaded, places = machine.run.loaded, machine.places[use]
    options = elastic_fit(loaded.experiment, study_of(run.loaded, TrustStudy).fit).options()
    simulate = changed_simulation(places.campaign, one.physics, one.seed)
    experiment = simulated_experiment(loaded, places.campaign, simulate, places.content)
    delay = delay_s(loaded, places.campaign)
    files = files_of(responses, one, use)
    decides = {"responses": [path.name for path in files], "options": plain_settings(options)}
    decides |= {"settings": model_settings(loaded, places.owner), "doubts": use == RANDOM}
    nominal = loaded.robot.to_robot(places.campaign.payload_kg)
    if use != RANDOM:  # its springs are held against nothing: what predicts does not look at nuisance parameters
        nominal = certain(nominal)
    return decides, Fitting(files, nominal, options, delay, simulated_truth(experiment, delay))


def certain(robot: Robot) -> Robot:
    """Returns a robot whose file is taken for granted."""
    nothing = NuisanceStd(**{each.name: 0.0 for each in fields(NuisanceStd)})
    joints = tuple(replace(joint, nuisance_std=nothing) for joint in robot.joints)
    return replace(robot, joints=joints, nuisance_std=nothing)


def fit_individual(one: Fitting) -> Content:
    """Fits a robot, or says why it was refused; its true values lie beside."""
    content = kept_or_refused(lambda: fit_elastic(one.robot, read_responses(one.responses), one.options, one.delay_s))
    return with_truth(content, true_values(one.robot, one.truth))


def grade_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each robot that is simulated."""
    known, study, models, found = machines(run), study_of(run.loaded, TrustStudy), earlier[1].by_name, list[Task]()
    for one in simulated(run):
        fitting = make_fitting(run, known[one.robot], one, RANDOM, earlier[0])[1]
        model = models[f"{one.key}_{RANDOM}"]
        fresh = files_of(earlier[0], one, FRESH)[: study.validated_in]
        decides = {"model": model.name, "fresh": [path.name for path in fresh], "grading": GRADING}
        found.append(Task(one.key, decides, (fitting, model, fresh)))
    return found


def grade_individual(fitting: Fitting, model: Path, fresh: tuple[Path, ...]) -> Content:
    """Says what speaks against a fit and, with fresh places to validate in, which grade it gets."""
    held, frf = read_artifact(model, TASK), None
    about: dict[str, Attribute] = {}
    try:
        solution = kept_solution(held)
        frf = read_responses(fitting.responses)
        shared = fitting.options, fitting.delay_s
        found = assess_fit(fitting.robot, solution, frf, *shared).findings
        if fresh:
            new, truth = read_responses(fresh), kept_truth(held)
            grade = validate_elastic(fitting.robot, solution, new, *shared, truth, found).outcome.grade
            found, about = grade.findings, {"grade": grade.value}
    except DataError as error:
        # What was refused may not be used at all.
        causes = refused_causes(fitting.robot, frf, str(error), fitting.delay_s)
        return Content({"causes": about_findings(causes)}, {REFUSAL: str(error), "grade": 0})
    return Content(
        {f"{key}s": about_findings([getattr(one, key) for one in found]) for key in ("cause", "message")}, about
    )
