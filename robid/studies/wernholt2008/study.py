"""Models of springs and dampers from many starts, scored with the same cost, and estimates of individuals."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.frf.frf import Frf
from robid.frf.residual import EstimatorKind
from robid.models.elastic.fit.fitting import draw_starts, fit_elastic, set_up
from robid.models.elastic.fit.optimizers import make_strategy
from robid.models.elastic.fit.options import ElasticOptions, WeightsKind
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.settings import model_settings
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.sources import true_robot_of
from robid.studies.experiments import paper_figures
from robid.studies.settings.study import WernholtStudy
from robid.studies.simulated import simulate_options, stated_std
from robid.studies.study import Content, Earlier, Task, in_chunks, study_of, values_of

_NOTHING_KNOWN = 1e9
ALL = -1  # Stands for all configurations where one is named by its index


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read, once the paper's figures can be read."""
    paper_figures(loaded)
    study = study_of(loaded, WernholtStudy)
    return tuple(f"{name}/frf.h5" for name in (study.campaign, *study.individuals))


def read_frf(path: Path) -> Frf:
    """Reads responses."""
    return frf_from_artifact(read_artifact(path, FRF))


def robot_and_delay(loaded: LoadedExperiment) -> tuple[Robot, float]:
    """Returns the robot file's robot with the campaign's payload, and its nominal delay [s]."""
    campaign = loaded.experiment.campaigns[study_of(loaded, WernholtStudy).campaign]
    return loaded.robot.to_robot(campaign.payload_kg), delay_s(loaded, campaign)


def score_options(study: WernholtStudy) -> tuple[ElasticOptions, ElasticOptions]:
    """Returns the options of the costs that judge: logarithmic, user-defined and optimal weights, data alone."""
    shared = replace(study.fit, prior_decades=_NOTHING_KNOWN)
    return with_estimator(shared, "lls", "user"), with_estimator(shared, "lls", "optimal")


def with_estimator(options: ElasticOptions, estimator: EstimatorKind, weights: WeightsKind) -> ElasticOptions:
    """Returns the options with another estimator and kind of weights."""
    return replace(options, estimator=estimator, weights=replace(options.weights, kind=weights))


@dataclass(frozen=True)
class StartSet:
    """All starts of one estimator."""

    group: str  # "" for the starts and the strategy of the study, `<n>dec` for wider ones, `plain` for plain descents
    name: str  # Name of the estimator
    alone: bool  # Whether only the best configuration is fitted
    # Options of the fit; `starts` counts the robot file's values too, which are no start here
    options: ElasticOptions


def sets(study: WernholtStudy) -> list[StartSet]:
    """Returns the sets of starts in the order of their tasks."""
    every, wide = tuple(study.estimators), f"{study.wide_decades:g}dec".replace(".", "_")
    shared = replace(study.fit, starts=study.fit.starts + 1)
    groups = [("", every, shared), (wide, study.wide, replace(shared, start_decades=study.wide_decades))]
    if study.plain:
        groups.append(("plain", every, replace(shared, strategy="plain")))
    return [
        StartSet(group, name, one.configurations == "best", with_estimator(options, one.estimator, one.weights))
        for group, names, options in groups
        for name, one in ((name, study.estimators[name]) for name in names)
    ]


def best_configuration(robot: Robot, frf: Frf, options: ElasticOptions, delay: float) -> int:
    """Returns the configuration whose response alone predicts the smallest covariance, by its determinant."""
    alone = (set_up(robot, frf.select([index]), options, delay)[0] for index in range(len(frf.configurations)))
    covariances = (sandwich(problem, np.zeros(len(problem.parameters.names))) for problem in alone)
    return int(np.argmin([np.linalg.slogdet(covariance)[1] for covariance in covariances]))


def tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns the tasks: the starts of every set in chunks."""
    study = study_of(run.loaded, WernholtStudy)
    robot, delay = robot_and_delay(run.loaded)
    path = run.path(needs(run.loaded)[0])
    decides = {"frf": read_header(path, FRF).content_sha256, **model_settings(run.loaded, study.campaign)}
    best = ALL
    if any(one.alone for one in sets(study)):
        best = best_configuration(robot, read_frf(path), with_estimator(study.fit, "lls", "user"), delay)
    found, judging = [], score_options(study)
    for one in sets(study):
        alone = best if one.alone else ALL
        for number, chunk in enumerate(in_chunks(1, one.options.starts - 1, study.starts_per_task), 1):
            starts = tuple(chunk)
            arguments = robot, path, alone, one.options, judging, starts, delay
            place = {"options": plain_settings(one.options), "scores": plain_settings(judging), "starts": starts}
            label = "_".join(part for part in (one.name, one.group, str(number)) if part)
            found.append(Task(label, {**decides, **place, "configuration": alone}, arguments))
    return found


def fit_chunk(
    robot: Robot,
    path: Path,
    configuration: int,
    options: ElasticOptions,
    judging: tuple[ElasticOptions, ElasticOptions],
    chosen: tuple[int, ...],
    delay_s: float,
) -> Content:
    """Fits from some starts of one estimator, counted from 1, and scores the models by the costs of `judging`.

    Responses lie at `path`; the only configuration that is fitted is named by its index, else `ALL` are.
    """
    frf = read_frf(path)
    used = frf if configuration == ALL else frf.select([configuration])
    clock, processor = time.perf_counter(), time.process_time()
    problem = set_up(robot, used, options, delay_s)[0]
    strategy, starts = make_strategy(problem, robot, options), draw_starts(problem.parameters, options)
    ends = [strategy.descend(starts[index]) for index in chosen]
    seconds, processor = time.perf_counter() - clock, time.process_time() - processor
    internal = np.array([end.parameters for end in ends])
    judges = (set_up(robot, frf, each, delay_s)[0] for each in judging)
    user, optimal = (np.array([judge.cost(one) for one in internal]) for judge in judges)
    start = ("start",)
    datasets = {
        "internal": Dataset(internal, "1", ("start", "parameter"), "Logarithm of each parameter over the robot file's"),
        "cost": Dataset(np.array([end.cost for end in ends]), "1", start, "Cost that was minimised"),
        "evaluations": Dataset(np.array([end.evaluations for end in ends]), "1", start),
        "status": Dataset(np.array([end.status for end in ends]), "1", start),
        "user_cost": Dataset(user, "1", start, "Logarithmic cost with user weights, all configurations"),
        "optimal_cost": Dataset(optimal, "1", start, "The same with optimal weights"),
        "configuration": Dataset(np.array(configuration), "1", (), "Index of the only one fitted, or -1"),
        "seconds": Dataset(np.array(seconds), "s", (), "Wall time of these fits"),
        "processor_seconds": Dataset(np.array(processor), "s", (), "Processor time of these fits"),
    }
    return Content(datasets)


def true_springs(robot: Robot) -> dict[str, float]:
    """Returns stiffness and damping of a robot's springs by the names of their parameters."""
    keys = ("stiffness", "damping")
    return {f"{spring.name}.{key}": float(getattr(spring, key)) for key in keys for spring in robot.springs}


_RESULT = 3  # Version of what a result holds


@dataclass(frozen=True)
class Individuals:
    """What all estimators make of the individuals."""

    names: tuple[str, ...]  # Names of the parameters
    error: dict[str, FloatArray]  # Logarithm of estimate over truth (n_individual, n_param) by estimator
    # The same of the middles of the intervals, where what the robot file may have wrong is estimated along
    physical: dict[str, FloatArray]
    # Deviation of each logarithm that the fit's interval states (n_individual, n_param) by estimator
    std: dict[str, FloatArray]
    inside: dict[str, BoolArray]  # Whether that interval holds the truth (n_individual, n_param) by estimator
    # Cost over what noise and the assumed model error give (n_individual,) by estimator
    misfit: dict[str, FloatArray]


def sizes_of(error: FloatArray) -> FloatArray:
    """Size of errors (n_individual, n_param) of each individual, the median: a few parameters are hardly determined."""
    return np.asarray(np.median(np.abs(error), axis=1))


def estimators_of(study: WernholtStudy) -> list[str]:
    """Returns the estimators that are held against the individuals."""
    every = [name for name, one in study.estimators.items() if one.configurations == "all"]
    return list(study.individual_estimators) or every


def individual_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each individual and estimator."""
    study = study_of(run.loaded, WernholtStudy)
    found = []
    for campaign_name in study.individuals:
        campaign = run.loaded.experiment.campaigns[campaign_name]
        robot = run.loaded.robot.to_robot(campaign.payload_kg)
        simulated = simulate_options(campaign)
        truth = true_robot_of(run.loaded.robot, campaign.payload_kg, simulated.truth)
        path, delay = run.path(f"{campaign_name}/frf.h5"), delay_s(run.loaded, campaign)
        decides = {
            "frf": read_header(path, FRF).content_sha256,
            "source": plain_settings(campaign.source),
            "result": _RESULT,
            **model_settings(run.loaded, campaign_name),
        }
        for name in estimators_of(study):
            shared, choice = replace(study.fit, starts=study.individual_starts), study.estimators[name]
            options = with_estimator(shared, choice.estimator, choice.weights)
            arguments = robot, truth, path, options, delay
            found.append(Task(f"{name}_{campaign_name}", {**decides, "options": plain_settings(options)}, arguments))
    return found


def fit_individual(robot: Robot, truth: Robot, path: Path, options: ElasticOptions, delay_s: float) -> Content:
    """Fits one individual to the responses at `path` and holds its springs and dampers against the true robot's."""
    solution = fit_elastic(robot, read_frf(path), options, delay_s)
    estimate = solution.estimate
    true = true_springs(truth)
    known = [index for index, name in enumerate(estimate.names) if name in true]
    names = [estimate.names[index] for index in known]
    values = np.array([true[name] for name in names])
    lower, upper = estimate.lower[known], estimate.upper[known]
    error, physical = (np.log(each[known] / values) for each in (estimate.value, estimate.middle))
    std, inside = stated_std(lower, upper, estimate.confidence), (lower <= values) & (values <= upper)
    parameter = ("parameter",)
    datasets = {
        "names": Dataset(np.array(names), "1", parameter),
        "error": Dataset(error, "1", parameter, "Logarithm of the estimate over the truth"),
        "physical": Dataset(physical, "1", parameter, "Logarithm of the interval's middle over the truth"),
        "std": Dataset(std, "1", parameter, "Deviation that the fit's interval states"),
        "inside": Dataset(inside, "1", parameter, "Whether that interval contains the truth"),
        "misfit": Dataset(np.array(solution.misfit), "1", (), "Cost over what noise and the assumed model error give"),
    }
    return Content(datasets, {"status": estimate.status})


def gather_individuals(study: WernholtStudy, results: Sequence[Artifact]) -> Individuals | None:
    """Puts the individuals' results together; None where the study has none."""
    if not results:
        return None
    rows, estimators = [values_of(result) for result in results], estimators_of(study)
    error, physical, std, inside, misfit = (
        {name: np.array([row[key] for row in rows[at :: len(estimators)]]) for at, name in enumerate(estimators)}
        for key in ("error", "physical", "std", "inside", "misfit")
    )
    return Individuals(tuple(rows[0]["names"].tolist()), error, physical, std, inside, misfit)
