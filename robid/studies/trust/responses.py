"""The responses of the study of trust: each robot in each of its places, one task each; records are not kept."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.kinds import FRF, TASK, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.joined import join
from robid.pipeline import Run
from robid.settings.robot_parts import plain_settings
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.stages.simulate_or_acquire import simulated_experiment
from robid.studies.changed import changed_simulation
from robid.studies.settings.trust import TrustStudy
from robid.studies.simulated import Estimator, make_estimator, simulation_settings
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Results, Task
from robid.studies.trust.individuals import Individual, individuals
from robid.studies.trust.study import DESIGNED, FRESH, RANDOM, Machine, Places, machines, study_of

REFUSAL = "refusal"
"""Attribute that says why a place has no response, or a robot no fit."""

_NOISE = (RANDOM, FRESH, DESIGNED)  # each has noise of its own


@dataclass(frozen=True)
class Measurement:
    """One robot in one place.

    Attributes:
        experiment: What is simulated.
        configuration (n_joint,): There [rad, or m].
        index: Number of the place, which seeds the noise.
        estimator: How the response is estimated.
        threads: Threads of the simulation.
    """

    experiment: SimulatedExperiment
    configuration: FloatArray
    index: int
    estimator: Estimator
    threads: int


def simulated(run: Run) -> list[Individual]:
    """Returns the robots that are simulated."""
    return [one for one in individuals(study_of(run.loaded)) if one.kind != "linear"]


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each place of each robot that is simulated."""
    study, known = study_of(run.loaded), machines(run)
    threads = run.workers if run.backend == "serial" else 1
    found: list[Task] = []
    for one in simulated(run):
        machine = known[one.robot]
        for use, count in uses(one, study, machine):
            found += _tasks(one, machine, machine.places_of(one, use), count, threads)
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


def _tasks(one: Individual, machine: Machine, places: Places, count: int | None, threads: int) -> Iterator[Task]:
    campaign, loaded = places.campaign, machine.loaded
    options = changed_simulation(campaign, one.physics, one.seed, len(_NOISE) * one.seed + _NOISE.index(places.use))
    experiment = simulated_experiment(loaded, campaign, options, places.content)
    estimator = make_estimator(loaded, campaign, campaign.estimate)
    reference = hashlib.sha256(np.ascontiguousarray(experiment.reference).tobytes()).hexdigest()
    decides: dict[str, Any] = {
        **simulation_settings(loaded, campaign),
        "source": plain_settings(options),
        "reference": reference,
        "excited_lines": experiment.excited_lines.tolist(),
        "detection_lines": experiment.detection_lines.tolist(),
        "estimate": plain_settings(campaign.estimate),
    }
    for index, configuration in enumerate(places.content.configurations[:count]):
        name = response_name(one, places.use, index)
        argument = Measurement(experiment, configuration, index, estimator, threads)
        yield Task(name, {**decides, "index": index, "configuration": configuration.tolist()}, argument)


def response_name(one: Individual, use: str, index: int) -> str:
    """Returns the name of a place's task."""
    return f"{one.key}_{use}_{index + 1}"


def measure(one: Measurement) -> Content:
    """Simulates a robot in one place and estimates its response, or says why there is none."""
    try:
        record = simulate(one.experiment, one.configuration, one.index, one.threads)
        frf = estimate_frf(record, one.estimator.options, one.estimator.laws, one.estimator.delay_s)
    except DataError as error:
        return Content({}, {REFUSAL: str(error)})
    held = frf_to_artifact(frf, Provenance(stage="study"))
    return Content(held.datasets, held.attributes)


def files_of(results: Results, one: Individual, use: str) -> tuple[Path, ...]:
    """Returns where the responses of a robot lie, place by place."""
    prefix = response_name(one, use, 0).removesuffix("1")
    found = {path.name.split(".")[0]: path for path in results.paths if path.name.startswith(prefix)}
    return tuple(found[response_name(one, use, index)] for index in range(len(found)))


def read_responses(paths: Sequence[Path]) -> Frf:
    """Reads the responses of some places as one; those that were refused are left out.

    Raises:
        DataError: If none is left.
    """
    held = [read_artifact(path, TASK) for path in paths]
    parts = [
        frf_from_artifact(Artifact(FRF, each.datasets, each.attributes, each.provenance))
        for each in held
        if REFUSAL not in each.attributes
    ]
    if not parts:
        raise DataError(str(held[0].attributes[REFUSAL]), where="all places")
    return join(parts, [str(index + 1) for index in range(len(parts))])
