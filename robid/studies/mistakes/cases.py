"""The robots and cases of the study of mistakes: responses, fits, and what each fit is worth.

Each individual is simulated once, and its record is read with each mistake. Fits are graded by the truth and as given.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Attribute, Dataset, canonical_hash
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.fitting import true_values
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.grading import telling_shares
from robid.models.elastic.judge.validating import Validation, validate_elastic
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.results.finding import CAUSES
from robid.results.plausible.findings import data_findings
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.robot_sections import JointSection, given
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.studies.experiments import Further, both_runs, changed_simulation, excitations
from robid.studies.settings.defects import Mistake, MistakesStudy, mistaken_problems
from robid.studies.simulated import (
    REFUSAL,
    Estimator,
    kept_or_refused,
    kept_solution,
    kept_truth,
    make_estimator,
    played,
    response_content,
    response_from,
    response_settings,
    threads_of,
    with_truth,
)
from robid.studies.study import Content, Earlier, Task, study_of

SOUND = "sound"  # Name of a robot with which nothing is wrong


@dataclass(frozen=True)
class Subject:
    """One of the two robots: its experiment in a run folder of its own."""

    name: str
    run: Run
    sound: range


@dataclass(frozen=True)
class Case:
    """One mistake, or none, with one individual."""

    name: str  # Name of the mistake, or `sound`
    mistake: Mistake  # What is wrong; nothing where it is a sound one
    subject: Subject  # Whose robot
    seed: int  # Seed of the individual

    @property
    def key(self) -> str:
        """A name that no other case has."""
        return f"{self.name}_{self.subject.name}_{self.seed}"

    @property
    def simulation(self) -> str:
        """Name of what is simulated for it, shared with the cases that reuse the record."""
        physics = self.mistake.physics
        of = f"physics_{canonical_hash(physics)[:8]}" if physics else SOUND
        return f"{of}_{self.subject.name}_{self.seed}"

    @property
    def response(self) -> str:
        """Name of its response among those of one simulation, shared with the cases that read the record alike."""
        return f"response_{canonical_hash(read_with(self.mistake))[:8]}"


def campaigns_of(loaded: LoadedExperiment, fit: str) -> dict[str, str]:
    """Returns the names of the campaigns that a fit is fitted to and validated on."""
    chosen = loaded.experiment.fits[fit]
    return {"estimation": chosen.campaign, "validation": given(chosen.validate_on)}


def needs(loaded: LoadedExperiment, fit: str | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    if fit is None and not study_of(loaded, MistakesStudy).makes_mistakes:
        return ()
    return excitations(campaigns_of(loaded, fit or study_of(loaded, MistakesStudy).fit).values())


def subjects(run: Run) -> dict[str, Subject]:
    """Returns the robots of the study, the light one in a folder below."""
    study = study_of(run.loaded, MistakesStudy)
    first, counts = study.chosen.first, {"heavy": study.chosen.heavy, "light": study.chosen.light}
    runs = both_runs(run, study.light, lambda own: mistaken_problems(study, "light", own.experiment, own.robot))
    return {name: Subject(name, own, range(first, first + counts[name])) for name, own in runs.items()}


def further(run: Run) -> Further:
    """Returns the other experiments whose chains must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded, MistakesStudy)
    if not study.makes_mistakes:
        return ()
    return tuple((one.run, needs(one.run.loaded, study.fit)) for name, one in subjects(run).items() if name != "heavy")


def cases(run: Run) -> list[Case]:
    """Returns every case: the sound individuals, then each mistake with the first of them."""
    study = study_of(run.loaded, MistakesStudy)
    if not study.makes_mistakes:
        return []
    robots = subjects(run)
    found = [Case(SOUND, Mistake(), robot, seed) for robot in robots.values() for seed in robot.sound]
    seeds = range(study.chosen.first, study.chosen.first + study.chosen.mistakes)
    for name, mistake in study.mistakes.items():
        found += [Case(name, mistake, robots[mistake.robot], seed) for seed in seeds]
    return found


def read_with(mistake: Mistake) -> dict[str, Any]:
    """Returns what of a mistake decides its response beyond what is simulated."""
    keys = ("torque_factor", "angle_factor", "swapped", "delay_samples", "gear_ratio_factor", "friction_factor")
    return {key: plain_settings(getattr(mistake, key)) for key in keys}


def mistaken_record(record: Record, mistake: Mistake, configurations: FloatArray, index: int, campaign: str) -> Record:
    """Returns the record of one configuration as it is read with a mistake in its mapping.

    Of all configurations (n_conf, n_joint) [rad] two are swapped in the campaign `estimation` alone.
    """
    torque = np.array([mistake.torque_factor.get(name, 1.0) for name in record.input_names])
    angle = np.array([mistake.angle_factor.get(name, 1.0) for name in record.output_names])
    if mistake.swapped is not None and campaign == "estimation":
        told = dict(zip(mistake.swapped, reversed(mistake.swapped), strict=True)).get(index, index)
        record = replace(record, configurations=configurations[told : told + 1])
    # The same steady state (n_conf, n_real, n_exp, n_period, n_sample, n_out), read later.
    shape = record.outputs.shape
    late = np.roll(record.outputs.reshape(*shape[:3], -1, shape[-1]), mistake.delay_samples, axis=3).reshape(shape)
    offset = record.output_offset * angle
    return replace(record, inputs=record.inputs * torque, outputs=late * angle, output_offset=offset)


def mistaken_robot(robot: RobotFile, mistake: Mistake) -> RobotFile:
    """Returns a robot file with a mistake in it."""

    def mistaken(joint: JointSection) -> JointSection:
        stated = given(joint.motor)
        turned, law = stated.with_ratio(mistake.gear_ratio_factor.get(joint.name, 1.0)), stated.friction
        levels = {key: getattr(law, key) * mistake.friction_factor for key in ("coulomb_nm", "static_nm")}
        motor = turned.model_copy(update={"friction": law.model_copy(update=levels)})
        gear = None if f"gear_{joint.name}" in mistake.without_springs else joint.gear
        return joint.model_copy(update={"motor": motor, "gear": gear})

    springs = tuple(spring for spring in robot.springs if spring.name not in mistake.without_springs)
    return robot.model_copy(update={"joints": tuple(map(mistaken, robot.joints)), "springs": springs})


def mistaken_truth(truth: Mapping[str, float], mistake: Mistake) -> dict[str, float]:
    """Returns true values as they relate to the robot file that is read: levels of friction are relative to its own."""
    factor = mistake.friction_factor
    return {name: (1 + value) / factor - 1 if name.endswith(".level") else value for name, value in truth.items()}


@dataclass(frozen=True)
class Measured:
    """One campaign of an individual."""

    name: str  # `estimation` or `validation`
    experiment: SimulatedExperiment  # What is simulated
    configurations: FloatArray  # (n_conf, n_joint) in these configurations [rad]
    estimators: Mapping[str, Estimator]  # How each response is estimated
    nominal: Robot  # The robot as its file describes it
    delay_s: float  # Delay from recorded to applied torque [s]


@dataclass(frozen=True)
class Individual:
    """An individual that is simulated once, and the mistakes with which its record is read, by response."""

    campaigns: tuple[Measured, ...]
    read: Mapping[str, Mistake]
    threads: int


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each individual that is simulated, with all cases that use its record."""
    groups: dict[str, list[Case]] = {}
    for case in cases(run):
        groups.setdefault(case.simulation, []).append(case)
    if not groups:
        return []
    fit = study_of(run.loaded, MistakesStudy).fit
    contents = {
        (robot.name, name): played(robot.run, owner)
        for robot in subjects(run).values()
        for name, owner in campaigns_of(robot.run.loaded, fit).items()
    }
    found = []
    for name, group in groups.items():
        loaded, read = group[0].subject.run.loaded, {case.response: case for case in group}
        decides: dict[str, Any] = {"read": {key: read_with(case.mistake) for key, case in read.items()}}
        measured = []
        for number, (campaign, owner) in enumerate(campaigns_of(loaded, fit).items()):
            content = contents[group[0].subject.name, campaign]
            one, settings = _measured(read, campaign, number, loaded.experiment.campaigns[owner], content)
            decides[campaign] = settings
            measured.append(one)
        mistakes = {key: case.mistake for key, case in read.items()}
        found.append(Task(name, decides, (Individual(tuple(measured), mistakes, threads_of(run)),)))
    return found


def _measured(
    read: Mapping[str, Case], name: str, number: int, campaign: Campaign, content: CampaignExcitation
) -> tuple[Measured, dict[str, Any]]:
    case = next(iter(read.values()))
    factor, loaded = case.mistake.excitation_factor, case.subject.run.loaded
    options = changed_simulation(campaign, case.mistake.physics, case.seed, 2 * case.seed + number)
    experiment = simulated_experiment(loaded, campaign, options, content)
    if factor != 1:
        experiment = replace(experiment, reference=factor * experiment.reference)
    estimators = {}
    for key, each in read.items():
        mistaken = replace(loaded, robot=mistaken_robot(loaded.robot, each.mistake))
        estimators[key] = make_estimator(mistaken, campaign, campaign.estimate)
    settings = response_settings(loaded, campaign, options, experiment)
    decides = {**settings, "configurations": content.configurations.tolist()}
    nominal, delay = loaded.robot.to_robot(campaign.payload_kg), delay_s(loaded, campaign)
    return Measured(name, experiment, content.configurations, estimators, nominal, delay), decides


def measure_all(one: Individual) -> Content:
    """Simulates both campaigns of an individual and estimates its responses; records are not kept."""
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {}
    for campaign in one.campaigns:
        parts: dict[str, list[Frf]] = {key: [] for key in one.read}
        refused: dict[str, Content] = {}
        for index, configuration in enumerate(campaign.configurations):
            record = simulate(campaign.experiment, configuration, index, one.threads)
            for key, mistake in one.read.items():
                changed = mistaken_record(record, mistake, campaign.configurations, index, campaign.name)
                try:
                    parts[key].append(campaign.estimators[key].estimate(changed))
                except DataError as error:
                    refused.setdefault(key, Content({}, {REFUSAL: str(error)}))
        names = [str(index + 1) for index in range(len(campaign.configurations))]
        for key, found in parts.items():
            held = refused.get(key) or response_content(join(found, names))
            datasets |= {f"{key}/{campaign.name}/{name}": values for name, values in held.datasets.items()}
            attributes |= {f"{key}/{campaign.name}/{name}": value for name, value in held.attributes.items()}
    first = one.campaigns[0]
    truth = true_values(first.nominal, simulated_truth(first.experiment, first.delay_s))
    return with_truth(Content(datasets, attributes), truth)


GRADING = 5  # Raised when the rules of the grade change, so that the cases are graded anew

GRADES = ("do not use", "predicts", "trust")  # Grades in words, by their value

COVERED = 0.9
HALF_WIDTHS = 3.0
SPRING_ERROR = 0.2


@dataclass(frozen=True)
class Against:
    """A fit against the truth."""

    spring_error: float  # Largest relative error of an identified spring; NaN where none is known
    half_widths: float  # Largest error of one over half its interval, both logarithmic; NaN where none is known
    coverage: float  # Share of the identified parameters whose interval holds the truth; NaN where none is known
    holds: bool  # Whether the validation passes

    @property
    def grade(self) -> int:
        """The grade that it deserves."""
        if not self.holds or self.spring_error > SPRING_ERROR:
            return 0
        covered = math.isnan(self.coverage) or self.coverage >= COVERED
        return 2 if covered and not self.half_widths > HALF_WIDTHS else 1


def against_truth(solution: ElasticSolution, validation: Validation, truth: dict[str, float]) -> Against:
    """Compares a fit and its validation with the truth."""
    estimate = solution.estimate
    known = np.array([name in truth for name in estimate.names]) & estimate.identified
    true = np.array([truth.get(name, np.nan) for name in estimate.names])
    covered = (estimate.lower <= true) & (true <= estimate.upper)
    springs = known & np.array([kind == "stiffness" for kind in estimate.kinds])
    found, lower, upper = (each[springs] / true[springs] for each in (estimate.value, estimate.lower, estimate.upper))
    widths = np.abs(np.log(found)) / np.maximum(0.5 * np.log(upper / lower), 1e-300)
    return Against(
        spring_error=float(np.abs(found - 1).max()) if springs.any() else math.nan,
        half_widths=float(widths.max()) if springs.any() else math.nan,
        coverage=float(covered[known].mean()) if known.any() else math.nan,
        holds=validation.outcome.ok,
    )


def about_findings(values: Sequence[Any], kind: type = str) -> Dataset:
    """Returns what a task keeps of each finding that speaks against a fit."""
    return Dataset(np.array(values, dtype=kind), "1", ("doubt",))


def refused_causes(robot: Robot, frf: Frf | None, text: str, delay_s: float = 0.0) -> tuple[str, ...]:
    """Returns the causes that the tool names where it refuses data, by its text and the response, in their order."""
    seen = () if frf is None else tuple(finding.cause for finding in data_findings(robot, frf, delay_s))
    named = sorted((text.find(words), cause) for cause, words in CAUSES.items() if words in text)
    return tuple(dict.fromkeys((*seen, *(cause for _, cause in named))))


@dataclass(frozen=True)
class Fitting:
    """The fit of a case."""

    responses: Path
    response: str
    robots: tuple[Robot, Robot]
    options: ElasticOptions
    delay_s: float


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the fit of each case."""
    responses = earlier[0].by_name
    fits = ((case, *_fitting(run, case, responses[case.simulation])) for case in cases(run))
    return [Task(case.key, decides, (fitting,)) for case, decides, fitting in fits]


def case_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the judgement of each case."""
    found, responses = [], earlier[0].by_name
    for case, model in zip(cases(run), earlier[1].paths, strict=True):
        _, fitting = _fitting(run, case, responses[case.simulation])
        named, cause = {"case": case.name, "robot": case.subject.name}, case.mistake.cause or ""
        about: dict[str, Attribute] = {**named, "seed": case.seed, "cause": cause}
        decides = {"model": model.name, "grading": GRADING, **about}
        found.append(Task(case.key, decides, (fitting, model, case.mistake, about)))
    return found


def _fitting(run: Run, case: Case, responses: Path) -> tuple[dict[str, Any], Fitting]:
    loaded = case.subject.run.loaded
    loaded = replace(loaded, robot=mistaken_robot(loaded.robot, case.mistake))
    fit = study_of(run.loaded, MistakesStudy).fit
    options = elastic_fit(loaded.experiment, fit).options()
    names = campaigns_of(loaded, fit).values()
    own, new = (loaded.experiment.campaigns[name] for name in names)
    robots = loaded.robot.to_robot(own.payload_kg), loaded.robot.to_robot(new.payload_kg)
    settings = [model_settings(loaded, name) for name in names]
    decides = {"responses": responses.name, "response": case.response, "options": plain_settings(options)}
    return {**decides, "settings": settings}, Fitting(responses, case.response, robots, options, delay_s(loaded, own))


def fit_case(one: Fitting) -> Content:
    """Fits a case, or says why it was refused."""
    frf = partial(_response, read_artifact(one.responses, TASK), one, "estimation")
    return kept_or_refused(lambda: fit_elastic(one.robots[0], frf(), one.options, one.delay_s))


def _response(held: Artifact, one: Fitting, campaign: str) -> Frf:
    return response_from(held, f"{one.response}/{campaign}/")


def judge_case(fitting: Fitting, model: Path, mistake: Mistake, about: dict[str, Attribute]) -> Content:
    """Validates and grades a case, and holds it against the truth."""
    held, responses = read_artifact(model, TASK), read_artifact(fitting.responses, TASK)
    truth = mistaken_truth(kept_truth(responses), mistake)
    frf: Frf | None = None
    try:
        frf = _response(responses, fitting, "estimation")
        solution = kept_solution(held)
        new = _response(responses, fitting, "validation")
        findings = assess_fit(fitting.robots[0], solution, frf, fitting.options, fitting.delay_s).findings
        validation = validate_elastic(
            fitting.robots[1], solution, new, fitting.options, fitting.delay_s, truth, findings
        )
    except DataError as error:
        # Nothing may be used of what was refused, which no truth contradicts.
        causes = refused_causes(fitting.robots[0], frf, str(error), fitting.delay_s)
        return Content({"causes": about_findings(causes)}, {**about, "refusal": str(error), "given": 0, "right": 0})
    return _content(about, solution, validation, against_truth(solution, validation, truth))


def _content(about: dict[str, Attribute], solution: ElasticSolution, validation: Validation, truth: Against) -> Content:
    error, grade = solution.model_error, validation.outcome.grade
    shares = dict.fromkeys(("share_above", "share_correlated", "telling_above", "telling_correlated"), float("nan"))
    if error is not None:
        shares = dict(zip(shares, (error.share_above, error.share_correlated, *telling_shares(error)), strict=True))
    keys = ("cost_ratio", "motor_error_db", "motor_error_deg", "median_error_db", "worst_error_db")
    attributes: dict[str, Attribute] = {
        **about,
        **shares,
        **{key: getattr(validation, key) for key in keys},
        "given": grade.value,
        "right": truth.grade,
        "holds": truth.holds,
        "worst_spring_error": truth.spring_error,
        "worst_half_widths": truth.half_widths,
        "coverage": truth.coverage,
        "status": solution.estimate.status,
        "misfit": solution.misfit,
        "reasons": "; ".join(grade.reasons),
        "resonance_shift": float("nan") if validation.resonance_shift is None else validation.resonance_shift,
        "validation_ok": validation.outcome.ok,
    }
    kept: dict[str, tuple[str, type]] = {"causes": ("cause", str), "messages": ("message", str)}
    kept |= {"decisive": ("decisive", bool), "strength": ("strength", float)}
    datasets = {
        **{name: about_findings([getattr(one, key) for one in grade.findings], of) for name, (key, of) in kept.items()},
        "error_db": Dataset(validation.error_db, "dB", ("configuration", "motor"), "Median of the own responses"),
        "cost": Dataset(validation.cost, "1", ("configuration",), "Validation cost"),
        "expected_cost": Dataset(validation.expected_cost, "1", ("configuration",), "By the covariance alone"),
        "elements": Dataset(validation.elements, "1", ("configuration",), "Response elements with weight"),
    }
    return Content(datasets, attributes)
