"""The robots and cases of the study of mistakes, and their responses.

Each individual is simulated once, and its record is read with each mistake.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Attribute, Dataset, canonical_hash
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.models.elastic.fitting import true_values
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.robot_sections import JointSection, given
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.studies.experiments import Further, both_runs, changed_simulation, excitations
from robid.studies.settings.mistakes import Mistake, MistakesStudy, robot_problems
from robid.studies.simulated import (
    REFUSAL,
    Estimator,
    make_estimator,
    played,
    response_content,
    response_settings,
    threads_of,
    with_truth,
)
from robid.studies.study import Content, Earlier, Task, study_of

SOUND = "sound"
"""Name of a robot with which nothing is wrong."""


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
    runs = both_runs(run, study.light, lambda own: robot_problems(study, "light", own.experiment, own.robot))
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
    return [Task(name, *_simulated(fit, group, run, contents)) for name, group in groups.items()]


def _simulated(
    fit: str, group: list[Case], run: Run, contents: Mapping[tuple[str, str], CampaignExcitation]
) -> tuple[dict[str, Any], tuple[Individual]]:
    loaded = group[0].subject.run.loaded
    read = {case.response: case for case in group}
    decides: dict[str, Any] = {"read": {name: read_with(case.mistake) for name, case in read.items()}}
    measured = []
    for number, (name, owner) in enumerate(campaigns_of(loaded, fit).items()):
        content = contents[group[0].subject.name, name]
        one, settings = _measured(read, name, number, loaded.experiment.campaigns[owner], content)
        decides[name] = settings
        measured.append(one)
    mistakes = {name: case.mistake for name, case in read.items()}
    return decides, (Individual(tuple(measured), mistakes, threads_of(run)),)


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
        for key, held in _responses(campaign, one).items():
            datasets |= {f"{key}/{campaign.name}/{name}": values for name, values in held.datasets.items()}
            attributes |= {f"{key}/{campaign.name}/{name}": value for name, value in held.attributes.items()}
    first = one.campaigns[0]
    truth = true_values(first.nominal, simulated_truth(first.experiment, first.delay_s))
    return with_truth(Content(datasets, attributes), truth)


def _responses(campaign: Measured, one: Individual) -> dict[str, Content]:
    """What is kept of every response in all configurations, or of why there is none."""
    parts: dict[str, list[Frf]] = {key: [] for key in one.read}
    refusals: dict[str, str] = {}
    for index, configuration in enumerate(campaign.configurations):
        record = simulate(campaign.experiment, configuration, index, one.threads)
        for key, mistake in one.read.items():
            changed = mistaken_record(record, mistake, campaign.configurations, index, campaign.name)
            try:
                parts[key].append(campaign.estimators[key].estimate(changed))
            except DataError as error:
                refusals.setdefault(key, str(error))
    refused = {key: Content({}, {REFUSAL: text}) for key, text in refusals.items()}
    names = [str(index + 1) for index in range(len(campaign.configurations))]
    return {key: refused.get(key) or response_content(join(found, names)) for key, found in parts.items()}
