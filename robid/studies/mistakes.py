"""The study of mistakes: its robots, what is simulated for each, and the responses of every mistake."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Attribute, Dataset, Provenance
from robid.artifacts.excitation import EXCITATION, CampaignExcitation, excitation_from_artifact
from robid.artifacts.frf import FRF, frf_from_artifact, frf_to_artifact
from robid.artifacts.provenance import canonical_hash
from robid.artifacts.store import read_artifact
from robid.errors import DataError, SettingsError
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment, load_experiment
from robid.settings.mistake_checks import changed_simulation, fit_problem, mistake_problems
from robid.settings.problems import format_field
from robid.settings.slices import to_plain
from robid.settings.study import Mistake, MistakesStudy
from robid.simulate.experiment import Experiment, simulate
from robid.stages.simulate_or_acquire import simulated_experiment, true_values
from robid.stages.slices import delay_s
from robid.studies.mistaken import mistaken_record, mistaken_robot
from robid.studies.simulated import Estimator, make_estimator, simulation_settings
from robid.studies.tasks import Content, Results, Task

SOUND = "sound"
"""Name of a robot with which nothing is wrong."""

Earlier = tuple[Results, ...]


@dataclass(frozen=True)
class Subject:
    """One of the two robots: its experiment in a run folder of its own.

    Attributes:
        name: `heavy` or `light`.
        run: Its experiment.
        sound: Seeds of its sound individuals.
    """

    name: str
    run: Run
    sound: range

    @property
    def loaded(self) -> LoadedExperiment:
        """Its experiment and robot file."""
        return self.run.loaded


@dataclass(frozen=True)
class Case:
    """One mistake, or none, with one individual.

    Attributes:
        name: Name of the mistake, or `sound`.
        mistake: What is wrong; nothing where it is a sound one.
        subject: Whose robot.
        seed: Seed of the individual.
    """

    name: str
    mistake: Mistake
    subject: Subject
    seed: int

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


@dataclass(frozen=True)
class Measured:
    """One campaign of an individual.

    Attributes:
        name: `estimation` or `validation`.
        experiment: What is simulated.
        configurations (n_conf, n_joint): In these configurations [rad].
        estimators: How the response is estimated, for each case.
        nominal: The robot as its file describes it.
        delay_s: Delay from recorded to applied torque [s].
    """

    name: str
    experiment: Experiment
    configurations: FloatArray
    estimators: Mapping[str, Estimator]
    nominal: Robot
    delay_s: float


@dataclass(frozen=True)
class Measurement:
    """An individual that is simulated once, and the cases that use its record."""

    campaigns: tuple[Measured, ...]
    cases: Mapping[str, Mistake]
    threads: int


def study_of(loaded: LoadedExperiment) -> MistakesStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, MistakesStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study


def campaigns_of(loaded: LoadedExperiment, fit: str) -> dict[str, str]:
    """Returns the names of the campaigns that a fit is fitted to and validated on."""
    chosen = loaded.experiment.fits[fit]
    if chosen.validate_on is None:
        message = "the settings' checks let a fit without validation pass"
        raise RuntimeError(message)
    return {"estimation": chosen.campaign, "validation": chosen.validate_on}


def needs(loaded: LoadedExperiment, fit: str | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    names = campaigns_of(loaded, fit or study_of(loaded).fit)
    return tuple(f"{name}/excitation.h5" for name in names.values())


def subjects(run: Run) -> dict[str, Subject]:
    """Returns the robots of the study, the light one in a folder below."""
    study = study_of(run.loaded)
    seeds = study.chosen
    found = {"heavy": Subject("heavy", run, range(seeds.first, seeds.first + seeds.heavy))}
    if study.light is not None:
        loaded = _light(run.loaded, study, study.light)
        sound = range(seeds.first, seeds.first + seeds.light)
        found["light"] = Subject("light", replace(run, loaded=loaded, folder=run.folder / "light"), sound)
    return found


def further(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the other experiments whose chains must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded)
    return tuple((one.run, needs(one.loaded, study.fit)) for name, one in subjects(run).items() if name != "heavy")


def _light(loaded: LoadedExperiment, study: MistakesStudy, name: str) -> LoadedExperiment:
    light = load_experiment(loaded.path.parent / name)
    problems = [fit_problem(light.experiment, study.fit)]
    for key, mistake in study.mistakes.items():
        if mistake.robot == "light":
            found = mistake_problems(mistake, light.experiment, study.fit, light.robot)
            problems += [f"{format_field(('study', 'mistakes', key, *field))}: {what}" for field, what in found]
    told = [problem for problem in problems if problem]
    if told:
        raise SettingsError("; ".join(told), where=str(light.path), remedy="correct the file, or the study's mistakes")
    return light


def cases(run: Run) -> list[Case]:
    """Returns every case: the sound individuals, then each mistake with the first of them."""
    study, robots = study_of(run.loaded), subjects(run)
    nothing = Mistake()
    found = [Case(SOUND, nothing, robot, seed) for robot in robots.values() for seed in robot.sound]
    seeds = range(study.chosen.first, study.chosen.first + study.chosen.mistakes)
    for name, mistake in study.mistakes.items():
        found += [Case(name, mistake, robots[mistake.robot], seed) for seed in seeds]
    return found


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each individual that is simulated, with all cases that use its record."""
    groups: dict[str, list[Case]] = {}
    for case in cases(run):
        groups.setdefault(case.simulation, []).append(case)
    fit = study_of(run.loaded).fit
    played = {
        (robot.name, name): excitation_from_artifact(
            read_artifact(robot.run.path(f"{owner}/excitation.h5"), EXCITATION)
        )
        for robot in subjects(run).values()
        for name, owner in campaigns_of(robot.loaded, fit).items()
    }
    return [Task(name, *_simulated(fit, group, run, played)) for name, group in groups.items()]


def _simulated(
    fit: str, group: list[Case], run: Run, played: Mapping[tuple[str, str], CampaignExcitation]
) -> tuple[dict[str, Any], Measurement]:
    loaded = group[0].subject.loaded
    decides: dict[str, Any] = {"cases": {case.key: _in_logs(case.mistake) for case in group}}
    measured = []
    for number, (name, owner) in enumerate(campaigns_of(loaded, fit).items()):
        content = played[group[0].subject.name, name]
        one, settings = _measured(group, name, number, loaded.experiment.campaigns[owner], content)
        decides[name] = settings
        measured.append(one)
    threads = run.workers if run.backend == "serial" else 1
    return decides, Measurement(tuple(measured), {case.key: case.mistake for case in group}, threads)


def _in_logs(mistake: Mistake) -> dict[str, Any]:
    """What of a mistake decides its response, beyond what is simulated."""
    keys = ("torque_factor", "angle_factor", "swapped", "delay_samples", "gear_ratio_factor", "friction_factor")
    return {key: to_plain(getattr(mistake, key)) for key in keys}


def _measured(
    group: list[Case], name: str, number: int, campaign: Campaign, content: CampaignExcitation
) -> tuple[Measured, dict[str, Any]]:
    case, factor = group[0], group[0].mistake.excitation_factor
    loaded = case.subject.loaded
    options = changed_simulation(campaign, case.mistake.physics, case.seed, 2 * case.seed + number)
    experiment = simulated_experiment(loaded, campaign, options, content)
    if factor != 1:
        experiment = replace(experiment, reference=factor * experiment.reference)
    estimators = {each.key: _estimator(each, campaign) for each in group}
    reference = hashlib.sha256(np.ascontiguousarray(experiment.reference).tobytes()).hexdigest()
    decides = {
        **simulation_settings(loaded, campaign),
        "source": to_plain(options),
        "reference": reference,
        "configurations": content.configurations.tolist(),
        "excited_lines": content.excitation.excited_lines.tolist(),
        "detection_lines": content.excitation.detection_lines.tolist(),
        "estimate": to_plain(campaign.estimate),
    }
    nominal, delay = loaded.robot.to_robot(campaign.payload_kg), delay_s(loaded, campaign)
    return Measured(name, experiment, content.configurations, estimators, nominal, delay), decides


def _estimator(case: Case, campaign: Campaign) -> Estimator:
    loaded = replace(case.subject.loaded, robot=mistaken_robot(case.subject.loaded.robot, case.mistake))
    return make_estimator(loaded, campaign, campaign.estimate)


def measure(one: Measurement) -> Content:
    """Simulates both campaigns of an individual, and estimates the responses of its cases; records are not kept."""
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {}
    for campaign in one.campaigns:
        for key, found in _responses(campaign, one).items():
            if isinstance(found, str):
                attributes[f"{key}/{campaign.name}/refusal"] = found
                continue
            held = frf_to_artifact(found, Provenance(stage="study"))
            datasets |= {f"{key}/{campaign.name}/{name}": values for name, values in held.datasets.items()}
            attributes |= {f"{key}/{campaign.name}/{name}": value for name, value in held.attributes.items()}
    first = one.campaigns[0]
    truth = true_values(first.nominal, first.experiment, first.configurations, first.delay_s)
    datasets["truth_names"] = Dataset(np.array(list(truth)), "1", ("truth",))
    datasets["truth"] = Dataset(np.array(list(truth.values())), "SI", ("truth",), "True values by name")
    return Content(datasets, attributes)


def _responses(campaign: Measured, one: Measurement) -> dict[str, Frf | str]:
    """The response of every case in all configurations, or why there is none."""
    parts: dict[str, list[Frf]] = {key: [] for key in one.cases}
    refusals: dict[str, str] = {}
    for index, configuration in enumerate(campaign.configurations):
        record = simulate(campaign.experiment, configuration, index, one.threads)
        for key, mistake in one.cases.items():
            estimator = campaign.estimators[key]
            changed = mistaken_record(record, mistake, campaign.configurations, index, campaign.name)
            try:
                parts[key].append(estimate_frf(changed, estimator.options, estimator.laws, estimator.delay_s))
            except DataError as error:
                refusals.setdefault(key, str(error))
    names = [str(index + 1) for index in range(len(campaign.configurations))]
    return {key: refusals[key] if key in refusals else join(found, names) for key, found in parts.items()}


def read_response(held: Artifact, case: str, campaign: str) -> Frf:
    """Returns a case's response.

    Raises:
        DataError: With what refused its record.
    """
    prefix = f"{case}/{campaign}/"
    refusal = held.attributes.get(f"{prefix}refusal")
    if refusal is not None:
        raise DataError(str(refusal), where=campaign)
    datasets = dict(_inside(held.datasets, prefix))
    return frf_from_artifact(Artifact(FRF, datasets, dict(_inside(held.attributes, prefix)), held.provenance))


def _inside(named: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    return ((name.removeprefix(prefix), value) for name, value in named.items() if name.startswith(prefix))


def read_truth(held: Artifact) -> dict[str, float]:
    """Returns the true values by name."""
    names, values = (held.datasets[key].values.tolist() for key in ("truth_names", "truth"))
    return dict(zip(names, values, strict=True))
