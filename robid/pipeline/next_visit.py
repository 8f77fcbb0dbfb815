"""The configuration to visit next after a fit, by assumed errors about what the fit has found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.clusters.evidence import group_clusters
from robid.design.configurations.candidates import choose_parameters
from robid.design.configurations.comparison import Alternative, NextVisit, next_visits
from robid.design.configurations.prediction import ExpectedError, with_further
from robid.models.elastic.files import solution_from_artifact
from robid.pipeline.configurations import configurations_of
from robid.pipeline.design_information import between_std
from robid.pipeline.design_outputs import predicted_there
from robid.pipeline.design_prediction import gather_prediction
from robid.pipeline.design_tasks import tasks_at
from robid.pipeline.plans import about_options
from robid.pipeline.stage import Job
from robid.settings.load import LoadedExperiment


@dataclass(frozen=True)
class Proposal:
    """What a fit's configurations give, and which candidate helps most beside them."""

    now: Alternative
    best: tuple[NextVisit, ...]  # By purpose, where one helps; indices are those of the candidates
    candidates: FloatArray  # (n_cand, n_joint) [rad, or m]


def following(loaded: LoadedExperiment, design: str, fit: str) -> LoadedExperiment:
    """The experiment whose design goes on from a fit: derivatives at its values, its scatter between configurations."""
    # What one more visit brings is asked before it is measured: its errors can only be assumed.
    own = replace(loaded.experiment.designs[design], prior=fit, information="assumed", draws=1)
    designs = {**loaded.experiment.designs, design: own}
    return replace(loaded, experiment=loaded.experiment.model_copy(update={"designs": designs}))


def propose_visit(job: Job, visited: FloatArray) -> Proposal:
    """Finds what helps most beside the configurations (n_visit, n_joint) of the fit that the design goes on from.

    Predictions are those in all candidates.
    """
    experiment = job.loaded.experiment
    design = experiment.designs[job.owner]
    candidates = configurations_of(job.loaded, experiment.campaigns[design.campaign], job.inputs)
    about = about_options(experiment, design)
    robot = job.loaded.robot.to_robot(experiment.campaigns[design.campaign].payload_kg)
    names = choose_parameters(robot, about.free, about.along(), about.fixed).names
    solution = solution_from_artifact(read_artifact(job.inputs["model"], MODEL))
    if solution.effective is not None:
        design = replace(design, between=design.prior)
    between = between_std(job, design, names)
    counts, others = _visits(candidates, visited)
    error = gather_prediction(job, tasks_at(job, candidates), between)
    error = predicted_there(job, error, between, candidates)
    if len(others):
        # Responses to predict stay those of the candidates alone.
        error = with_further(error, gather_prediction(job, tasks_at(job, others), between))
    now, best = next_visits(ExpectedError(error, error.known(None)), counts, len(names), len(candidates))
    return Proposal(now, best, candidates)


def _visits(candidates: FloatArray, visited: FloatArray) -> tuple[IntArray, FloatArray]:
    """Visits of each candidate and of others (n_cand + n_other,), and these others (n_other, n_joint)."""
    clusters = group_clusters(np.concatenate([candidates, visited]))
    size = len(candidates)
    counts, others = np.zeros(size, int), []
    for cluster in clusters:
        visits = sum(index >= size for index in cluster)
        if cluster[0] < size:
            counts[cluster[0]] = visits
        else:
            others.append((visited[cluster[0] - size], visits))
    further = np.array([place for place, _ in others]).reshape(-1, candidates.shape[1])
    return np.concatenate([counts, np.array([visits for _, visits in others], int)]), further
