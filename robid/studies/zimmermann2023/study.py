"""The study of which configurations to measure: its campaigns and the responses of all of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import DESIGN, EXCITATION, design_from_artifact, excitation_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact
from robid.design.configurations.information import ConfigurationDesign
from robid.frf.estimate import estimate_frf
from robid.pipeline import Run
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.stages.simulate_or_acquire import simulated_experiment
from robid.studies.paper import paper_figures
from robid.studies.settings.study import ZimmermannStudy
from robid.studies.simulated import Estimator, make_estimator, simulate_options, simulation_settings
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task


@dataclass(frozen=True)
class Measurement:
    """One configuration of a campaign: simulated, and its response estimated."""

    experiment: SimulatedExperiment
    configuration: FloatArray
    index: int
    estimator: Estimator
    threads: int


def study_of(loaded: LoadedExperiment) -> ZimmermannStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, ZimmermannStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study


def chosen_designs(run: Run) -> dict[str, ConfigurationDesign]:
    """Returns the designs that the study's configurations come from, by name."""
    names = run.loaded.experiment.campaigns[study_of(run.loaded).estimation[0]].designs
    paths = {name: run.path(f"designs/{name}.h5") for name in names}
    return {name: design_from_artifact(read_artifact(path, DESIGN)) for name, path in paths.items()}


def campaigns(study: ZimmermannStudy) -> tuple[str, ...]:
    """Returns the campaigns of all pairs: each estimation campaign, then its validation campaign."""
    return tuple(name for pair in zip(study.estimation, study.validation, strict=True) for name in pair)


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read, once the paper's figures can be read."""
    paper_figures(study_of(loaded).paper, loaded)
    return tuple(f"{name}/excitation.h5" for name in campaigns(study_of(loaded)))


@dataclass(frozen=True)
class Pair:
    """One individual: its two campaigns, and where the responses of all configurations lie."""

    estimation: str
    validation: str
    configurations: FloatArray
    estimation_paths: tuple[Path, ...]
    validation_paths: tuple[Path, ...]


def pairs(run: Run, earlier: Earlier) -> list[Pair]:
    """Returns the pairs of campaigns with the results of the first step."""
    study = study_of(run.loaded)
    found, left = [], list(earlier[0].paths)
    for names in zip(study.estimation, study.validation, strict=True):
        content = excitation_from_artifact(read_artifact(run.path(f"{names[0]}/excitation.h5"), EXCITATION))
        count = len(content.configurations)
        found.append(Pair(*names, content.configurations, tuple(left[:count]), tuple(left[count : 2 * count])))
        left = left[2 * count :]
    return found


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each campaign and configuration."""
    return [task for name in campaigns(study_of(run.loaded)) for task in _campaign_tasks(run, name)]


def _campaign_tasks(run: Run, name: str) -> list[Task]:
    campaign = run.loaded.experiment.campaigns[name]
    path = run.path(f"{name}/excitation.h5")
    excitation = excitation_from_artifact(read_artifact(path, EXCITATION))
    experiment = simulated_experiment(run.loaded, campaign, simulate_options(campaign), excitation)
    estimator = make_estimator(run.loaded, campaign, campaign.estimate)
    reference = np.ascontiguousarray(excitation.excitation.reference)
    decides = {
        "reference": hashlib.sha256(reference.tobytes()).hexdigest(),
        "excited_lines": excitation.excitation.excited_lines.tolist(),
        "detection_lines": excitation.excitation.detection_lines.tolist(),
        "estimate": plain_settings(campaign.estimate),
        **simulation_settings(run.loaded, campaign),
    }
    threads = run.workers if run.backend == "serial" else 1
    return [
        Task(
            f"{name}_{index + 1}",
            {**decides, "configuration": index, "angles_rad": configuration.tolist()},
            Measurement(experiment, configuration, index, estimator, threads),
        )
        for index, configuration in enumerate(excitation.configurations)
    ]


def measure(one: Measurement) -> Content:
    """Simulates a configuration and estimates its response; the record is not kept."""
    record = simulate(one.experiment, one.configuration, one.index, one.threads)
    frf = estimate_frf(record, one.estimator.options, one.estimator.laws, one.estimator.delay_s)
    held = frf_to_artifact(frf, Provenance(stage="study"))
    return Content(held.datasets, held.attributes)
