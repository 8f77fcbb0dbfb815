"""The responses of the study of mistakes: each individual is simulated once, and its record read with each mistake."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Attribute, Dataset, Provenance
from robid.artifacts.kinds import EXCITATION, FRF, excitation_from_artifact, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.models.elastic.truth import true_values
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.robot_parts import delay_s, plain_settings
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.stages.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.studies.changed import changed_simulation
from robid.studies.mistakes.mistaken import mistaken_record, mistaken_robot
from robid.studies.mistakes.study import Case, campaigns_of, cases, read_with, study_of, subjects
from robid.studies.settings.study import Mistake
from robid.studies.simulated import Estimator, make_estimator, simulation_settings
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task


@dataclass(frozen=True)
class Measured:
    """One campaign of an individual.

    Attributes:
        name: `estimation` or `validation`.
        experiment: What is simulated.
        configurations (n_conf, n_joint): In these configurations [rad].
        estimators: How each response is estimated.
        nominal: The robot as its file describes it.
        delay_s: Delay from recorded to applied torque [s].
    """

    name: str
    experiment: SimulatedExperiment
    configurations: FloatArray
    estimators: Mapping[str, Estimator]
    nominal: Robot
    delay_s: float


@dataclass(frozen=True)
class Measurement:
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
    read = {case.response: case for case in group}
    decides: dict[str, Any] = {"read": {name: read_with(case.mistake) for name, case in read.items()}}
    measured = []
    for number, (name, owner) in enumerate(campaigns_of(loaded, fit).items()):
        content = played[group[0].subject.name, name]
        one, settings = _measured(read, name, number, loaded.experiment.campaigns[owner], content)
        decides[name] = settings
        measured.append(one)
    threads = run.workers if run.backend == "serial" else 1
    return decides, Measurement(tuple(measured), {name: case.mistake for name, case in read.items()}, threads)


def _measured(
    read: Mapping[str, Case], name: str, number: int, campaign: Campaign, content: CampaignExcitation
) -> tuple[Measured, dict[str, Any]]:
    case = next(iter(read.values()))
    factor, loaded = case.mistake.excitation_factor, case.subject.loaded
    options = changed_simulation(campaign, case.mistake.physics, case.seed, 2 * case.seed + number)
    experiment = simulated_experiment(loaded, campaign, options, content)
    if factor != 1:
        experiment = replace(experiment, reference=factor * experiment.reference)
    estimators = {name: _estimator(case, campaign) for name, case in read.items()}
    reference = hashlib.sha256(np.ascontiguousarray(experiment.reference).tobytes()).hexdigest()
    decides = {
        **simulation_settings(loaded, campaign),
        "source": plain_settings(options),
        "reference": reference,
        "configurations": content.configurations.tolist(),
        "excited_lines": content.excitation.excited_lines.tolist(),
        "detection_lines": content.excitation.detection_lines.tolist(),
        "estimate": plain_settings(campaign.estimate),
    }
    nominal, delay = loaded.robot.to_robot(campaign.payload_kg), delay_s(loaded, campaign)
    return Measured(name, experiment, content.configurations, estimators, nominal, delay), decides


def _estimator(case: Case, campaign: Campaign) -> Estimator:
    loaded = replace(case.subject.loaded, robot=mistaken_robot(case.subject.loaded.robot, case.mistake))
    return make_estimator(loaded, campaign, campaign.estimate)


def measure(one: Measurement) -> Content:
    """Simulates both campaigns of an individual and estimates its responses; records are not kept."""
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
    truth = true_values(first.nominal, simulated_truth(first.experiment, first.delay_s))
    datasets["truth_names"] = Dataset(np.array(list(truth)), "1", ("truth",))
    datasets["truth"] = Dataset(np.array(list(truth.values())), "SI", ("truth",), "True values by name")
    return Content(datasets, attributes)


def _responses(campaign: Measured, one: Measurement) -> dict[str, Frf | str]:
    """Every response in all configurations, or why there is none."""
    parts: dict[str, list[Frf]] = {key: [] for key in one.read}
    refusals: dict[str, str] = {}
    for index, configuration in enumerate(campaign.configurations):
        record = simulate(campaign.experiment, configuration, index, one.threads)
        for key, mistake in one.read.items():
            estimator = campaign.estimators[key]
            changed = mistaken_record(record, mistake, campaign.configurations, index, campaign.name)
            try:
                parts[key].append(estimate_frf(changed, estimator.options, estimator.laws, estimator.delay_s))
            except DataError as error:
                refusals.setdefault(key, str(error))
    names = [str(index + 1) for index in range(len(campaign.configurations))]
    return {key: refusals[key] if key in refusals else join(found, names) for key, found in parts.items()}


def read_response(held: Artifact, response: str, campaign: str) -> Frf:
    """Returns one of the responses of a simulation.

    Raises:
        DataError: With what refused its record.
    """
    prefix = f"{response}/{campaign}/"
    refusal = held.attributes.get(f"{prefix}refusal")
    if refusal is not None:
        raise DataError(str(refusal), where=campaign)
    datasets = dict(_inside(held.datasets, prefix))
    return frf_from_artifact(Artifact(FRF, datasets, dict(_inside(held.attributes, prefix)), held.provenance))


def _inside(named: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    return ((name.removeprefix(prefix), value) for name, value in named.items() if name.startswith(prefix))


def read_true_values(held: Artifact) -> dict[str, float]:
    """Returns the true values by name."""
    names, values = (held.datasets[key].values.tolist() for key in ("truth_names", "truth"))
    return dict(zip(names, values, strict=True))
