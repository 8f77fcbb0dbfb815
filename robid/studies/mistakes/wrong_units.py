"""Robots whose logs are read: each individual is simulated once, its logs are read with each mistake."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Dataset
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.results import MODEL, VALIDATION, grade_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.errors import DataError, SettingsError
from robid.fleet.row import Told
from robid.models.known import load_experiment
from robid.pipeline.graph import Run, run_all
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.results.scale import read_scale
from robid.settings.experiment import Campaign, Source
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings, require_controller
from robid.settings.sources import Acquire
from robid.settings.yaml import FieldPath
from robid.simulate.experiment import simulate
from robid.studies.experiments import (
    Further,
    Problems,
    changed_simulation,
    excitations,
    fit_problem,
    physics_problems,
    run_of,
)
from robid.studies.mistakes import unit_logs
from robid.studies.mistakes.cases import campaigns_of
from robid.studies.settings.defects import MistakesStudy, Rough, UnitMistake, UnitRobot
from robid.studies.study import Content, Earlier, Task, study_of


@dataclass(frozen=True)
class UnitSubject:
    """One of the robots: its experiment in a run folder of its own."""

    name: str
    run: Run
    settings: UnitRobot

    @property
    def campaigns(self) -> dict[str, str]:
        """Names of the campaigns that its fit is fitted to and validated on."""
        return campaigns_of(self.run.loaded, self.settings.fit)


@dataclass(frozen=True)
class Individual:
    """One true robot, whose logs are read."""

    robot: str
    seed: int  # Seed of its truth and its noise
    number: int  # Which of its robot's it is, from 0
    rough: bool  # Whether its logs are sound and its robot file is rough; else its logs are read in wrong units

    @property
    def key(self) -> str:
        """A name that no other has."""
        return f"{self.robot}_{'rough' if self.rough else 'units'}_{self.seed}"

    def physics(self, settings: UnitRobot) -> Mapping[str, Any]:
        """Returns what is simulated otherwise than its campaigns say."""
        return settings.variants[self.number % len(settings.variants)].model_dump()

    def joint(self, n_joint: int) -> int:
        """Returns the joint of a mistake of one joint alone."""
        return self.seed % n_joint


def unit_subjects(run: Run) -> dict[str, UnitSubject]:
    """Returns the robots whose logs are read, each in a folder below."""
    study = study_of(run.loaded, MistakesStudy)
    if study.units is None or not study.reads_units:
        return {}
    found = {}
    for name, settings in study.units.chosen.items():
        problems = partial(_problems, study, name, settings)
        found[name] = UnitSubject(name, run_of(run, settings.experiment, f"units/{name}", problems), settings)
    return found


def needed_by_units(run: Run) -> Further:
    """Returns the experiments of the robots, with the outputs of their chains that the tasks read."""
    return tuple((one.run, excitations(one.campaigns.values())) for one in unit_subjects(run).values())


def _problems(study: MistakesStudy, name: str, settings: UnitRobot, loaded: LoadedExperiment) -> Problems:
    place: FieldPath = ("study", "units", "robots", name)
    problem = fit_problem(loaded.experiment, settings.fit)
    if problem:
        yield (*place, "fit"), problem
        return
    campaigns = [loaded.experiment.campaigns[one] for one in campaigns_of(loaded, settings.fit).values()]
    mistakes = {} if study.units is None else study.units.mistakes
    read = {signal for one in mistakes.values() for signal in one.log.get(name, settings.log)} | set(settings.log)
    arms = {f"{joint.name}.arm" for joint in loaded.robot.joints}
    if "arm" in read and any(not arms <= set(campaign.outputs) for campaign in campaigns):
        yield (*place, "log"), f"S390 the campaigns' `outputs` lack {', '.join(sorted(arms))}"
    for index, variant in enumerate(settings.variants):
        found = physics_problems(campaigns[0], variant.model_dump(), None)
        yield from (((*place, "variants", index, *field), message) for field, message in found)


ROUGH = "rough"  # Name of the case in which nothing is wrong but the robot file


@dataclass(frozen=True)
class Reading:
    """An individual, and the mistakes with which its logs are read."""

    of: Individual
    experiment: Path
    settings: UnitRobot
    played: Mapping[str, Path]
    mistakes: Mapping[str, UnitMistake]
    rough: Rough


def unit_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each individual."""
    study, subjects, found = study_of(run.loaded, MistakesStudy), unit_subjects(run), list[Task]()
    if study.units is None:
        return found
    seeds = study.chosen
    counts = itertools.product(subjects, ((False, seeds.units), (True, seeds.rough)))
    # For each robot those whose logs are read in wrong units, then those of rough files.
    individuals = (
        Individual(robot, seeds.first + number, number, rough)
        for robot, (rough, count) in counts
        for number in range(count)
    )
    for one in individuals:
        subject = subjects[one.robot]
        played = {name: subject.run.path(f"{owner}/excitation.h5") for name, owner in subject.campaigns.items()}
        mistakes = {} if one.rough else study.units.mistakes
        loaded = subject.run.loaded
        decides: dict[str, Any] = {
            "experiment": {key: value for key, value in loaded.plain.items() if key != "execution"},
            "settings": plain_settings(subject.settings),
            "individual": plain_settings(one),
            # What decides how logs are read; not what a mistake is to be called.
            "mistakes": {
                name: {
                    **{key: plain[key] for key in ("scale", "one_joint", "stamps")},
                    "log": plain["log"].get(one.robot),
                }
                for name, plain in plain_settings(mistakes).items()
            },
            "rough": plain_settings(study.units.rough) if one.rough else None,
            "played": {name: read_header(path, EXCITATION).content_sha256 for name, path in played.items()},
        }
        reading = Reading(one, loaded.path, subject.settings, played, mistakes, study.units.rough)
        found.append(Task(one.key, decides, (reading,)))
    return found


def read_individual(reading: Reading) -> Content:
    """Simulates an individual and reads its logs with each mistake, or soundly with a rough robot file."""
    loaded = load_experiment(reading.experiment)
    logs = dict(_logs(reading, loaded))
    stated = {"torque_constant_nm_a": reading.settings.torque_constant_nm_a}
    joints = tuple(
        joint.model_copy(update={"motor": joint.motor and joint.motor.model_copy(update=stated)})
        for joint in loaded.robot.joints
    )
    loaded = replace(loaded, robot=loaded.robot.model_copy(update={"joints": joints}))
    if reading.of.rough:
        factors = unit_logs.rough_torque_constants(len(loaded.robot.joints), reading.rough, reading.of.seed)
        torque = read_scale("torque x 1000")
        logs = {name: unit_logs.mistaken_log(log, torque, factors) for name, log in logs.items()}
        rough = replace(loaded, robot=unit_logs.rough_robot(loaded.robot, reading.rough, reading.of.seed))
        said = {ROUGH: _chain(reading, rough, logs, None)}
    else:
        said = {name: _chain(reading, loaded, logs, mistake) for name, mistake in reading.mistakes.items()}
    rows = [{"case": name, **one.texts()} for name, one in said.items()]
    datasets = {key: Dataset(np.array([row[key] for row in rows], dtype=str), "1", ("case",)) for key in rows[0]}
    return Content(datasets, {"robot": reading.of.robot, "seed": reading.of.seed, "rough": reading.of.rough})


def _logs(reading: Reading, loaded: LoadedExperiment) -> Iterator[tuple[str, unit_logs.Log]]:
    seed, physics = reading.of.seed, reading.of.physics(reading.settings)
    joints = [joint.name for joint in loaded.robot.joints]
    for number, (name, owner) in enumerate(campaigns_of(loaded, reading.settings.fit).items()):
        campaign = loaded.experiment.campaigns[owner]
        content = excitation_from_artifact(read_artifact(reading.played[name], EXCITATION))
        options = changed_simulation(campaign, physics, seed, 2 * seed + number)
        experiment = simulated_experiment(loaded, campaign, options, content)
        log: unit_logs.Log = {}
        for index, configuration in enumerate(content.configurations):
            log |= unit_logs.log_of(simulate(experiment, configuration, index, 1), joints, index)
        yield owner, log


def _chain(
    reading: Reading, loaded: LoadedExperiment, logs: Mapping[str, unit_logs.Log], mistake: UnitMistake | None
) -> unit_logs.Said:
    fit = reading.settings.fit
    with tempfile.TemporaryDirectory() as folder:
        read = _as_read(reading, loaded, logs, mistake, Path(folder))
        told = Told()
        try:
            run_all(Run(read, Path(folder), "serial", 1), told.of, lambda _: None, [f"fits/{fit}/validation.h5"])
        except (DataError, SettingsError) as error:
            return unit_logs.Said((), (), str(error).replace(f"{folder}/", ""))
        made = Path(folder) / "fits" / fit
        # A fit that has not converged is validated nowhere: its own grade is all that is said.
        held = next(
            read_artifact(made / name, kind)
            for name, kind in (("validation.h5", VALIDATION), ("model.h5", MODEL))
            if (made / name).exists()
        )
    findings = grade_from_artifact(held).findings
    return unit_logs.Said(tuple(finding.cause for finding in findings), findings[0].scales if findings else (), "")


def _as_read(
    reading: Reading,
    loaded: LoadedExperiment,
    logs: Mapping[str, unit_logs.Log],
    mistake: UnitMistake | None,
    folder: Path,
) -> LoadedExperiment:
    settings, joints = reading.settings, [joint.name for joint in loaded.robot.joints]
    signals = settings.log if mistake is None else mistake.log.get(reading.of.robot, settings.log)
    stretch, campaigns = 1.0, {}
    factors: FloatArray = np.ones(len(joints))
    scale = None if mistake is None else read_scale(mistake.scale)
    if mistake is not None and scale is not None:
        ratios = np.array([abs(joint.plain_motor.gear_ratio) for joint in loaded.robot.joints])
        sizes = unit_logs.Sizes(ratios, settings.counts_per_turn / (2 * np.pi), settings.torque_constant_nm_a)
        factors = sizes.factors(scale)
        if mistake.one_joint:
            factors = np.where(np.arange(len(ratios)) == reading.of.joint(len(ratios)), factors, 1.0)
        if scale.channel == "time" and not mistake.stamps:
            stretch, scale = float(factors[0]), None
    for name, log in logs.items():
        path = folder / f"{name}.mat"
        unit_logs.write_log(path, log if scale is None else unit_logs.mistaken_log(log, scale, factors))
        period_s = stretch * require_controller(loaded).sampling_period_s
        stamped = mistake is None or mistake.stamps
        campaign = loaded.experiment.campaigns[name]
        options = {"time": unit_logs.stamps() if stamped else None, "one_shot": campaign.is_trajectory}
        acquire = unit_logs.mapping_of(path, joints, signals, period_s, options)
        read = reading_campaign(campaign, acquire, stretch)
        if "angle" not in signals:
            # Friction follows the motors' angles: without these it cannot be subtracted.
            read = read.model_copy(update={"estimate": replace(read.estimate, compensation="none")})
        campaigns[name] = read
    experiment = loaded.experiment.model_copy(update={"campaigns": campaigns, "designs": {}, "study": None})
    return replace(loaded, experiment=experiment)


def reading_campaign(campaign: Campaign, acquire: Acquire, stretch: float) -> Campaign:
    """Returns a campaign that reads logs; with all times that it states stretched, where its clock's unit is wrong."""
    source = Source(acquire=acquire)
    excitation: Any = campaign.excitation
    if campaign.is_trajectory:
        return Campaign(source=source, realizations=campaign.realizations, payload_kg=campaign.payload_kg)
    if stretch != 1 and excitation is not None:
        # Times [s] are longer, and frequencies [Hz] are lower, by the factor.
        stated = {field.name: getattr(excitation, field.name) for field in fields(excitation)}
        excitation = replace(
            excitation,
            **{
                name: value * stretch**power
                for name, value in stated.items()
                for suffix, power in (("_s", 1), ("_hz", -1))
                if name.endswith(suffix) and isinstance(value, int | float)
            },
        )
    return campaign.model_copy(update={"source": source, "excitation": excitation, "outputs": ("motors",)})
