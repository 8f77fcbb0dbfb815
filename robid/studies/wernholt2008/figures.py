"""The figures of the study of parameter estimators: the models of all starts, judged, and what they have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.judge.extrema import own_resonance_errors
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.simulate.truth import true_robot
from robid.studies.settings.elastic import WernholtStudy
from robid.studies.study import study_of
from robid.studies.tasks import values_of
from robid.studies.wernholt2008.study import ALL, measured, robot_and_delay, score_options, sets


@dataclass(frozen=True)
class StartSpread:
    """Statistics of parameters over models, each parameter divided by the best model's."""

    minimum: FloatArray  # (n_param,) smallest value
    median: FloatArray  # (n_param,) median
    maximum: FloatArray  # (n_param,) largest value
    mean: FloatArray  # (n_param,) mean
    std: FloatArray  # (n_param,) standard deviation; 0 for a single model
    count: int  # Number of models


def spread(values: FloatArray, best: FloatArray) -> StartSpread:
    """Returns the statistics of models near the best one.

    Args:
        values (n_model, n_param): Their parameters.
        best (n_param,): The best model's, none of them zero.

    Source:
        Wernholt and Moberg (2008), Table 1.
    """
    relative = values / best
    return StartSpread(
        minimum=relative.min(axis=0),
        median=np.asarray(np.median(relative, axis=0)),
        maximum=relative.max(axis=0),
        mean=relative.mean(axis=0),
        std=relative.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1]),
        count=len(values),
    )


def within_factor(values: FloatArray, best: FloatArray, factor: float) -> BoolArray:
    """Tells which parameters (n_model, n_param) lie within a factor of the best model's, ends included."""
    relative = values / best
    return np.asarray((relative >= 1 / factor) & (relative <= factor))


def shares_differ(first: float, second: float, count: int) -> bool:
    """Tells whether one share of starts is larger than another by more than two standard errors.

    Args:
        first: The share that should be larger.
        second: The other.
        count: Number of starts behind each.
    """
    variance = (first * (1 - first) + second * (1 - second)) / count
    return first - second > 2 * float(np.sqrt(variance))


COST_LIMIT = 1.5
NEAR_BEST = 1.05
_SAME_MINIMUM = 1 + 1e-3
_RESONANCE_LIMIT = 0.02
_FACTOR = 2.0
_SAME_MODEL = 1e-3
_CORES = 2


@dataclass(frozen=True)
class Models:
    """The models that one estimator reached from its starts."""

    name: str  # Name of the estimator
    internal: FloatArray  # (n_start, n_param) logarithm of each parameter over the robot file's
    own_cost: FloatArray  # (n_start,) cost that it minimised
    user_cost: FloatArray  # (n_start,) logarithmic cost with user weights, divided by the best of all models
    optimal_cost: FloatArray  # (n_start,) the same with optimal weights
    evaluations: FloatArray  # (n_start,) points at which the cost was computed
    capped: BoolArray  # (n_start,) whether the iteration limit ended it
    resonances: BoolArray  # (n_start,) whether every resonance is met; not looked at, and False, above the cost limit
    configuration: int  # Index of the only configuration fitted, or `ALL`
    seconds: float  # Wall time of the fits
    processor_seconds: float  # Their processor time

    @property
    def reasonable(self) -> BoolArray:
        """Models with a cost near the best that meet every resonance (n_start,)."""
        return np.asarray((self.user_cost <= COST_LIMIT) & self.resonances)

    @property
    def order(self) -> Any:  # noqa: ANN401
        """Indices of the models by their cost with user weights."""
        return np.argsort(self.user_cost, kind="stable")


@dataclass(frozen=True)
class Found:
    """Everything that the study found."""

    problem: Problem  # Logarithmic problem with user weights in all configurations
    groups: dict[str, dict[str, Models]]  # Models of every set of starts, by group and estimator, see `StartSet`
    reference: str  # Name of the estimator whose best model the others are held against
    truth: FloatArray  # (n_param,) true internal parameters
    std: FloatArray  # (n_param,) predicted standard deviation of the best reference model's internal parameters
    best_cost: float  # Best cost with user weights
    best_optimal_cost: float  # Best cost with optimal weights
    truth_cost: float  # Cost of the truth, divided by the best
    truth_optimal_cost: float  # The same with optimal weights
    resonances: int  # Number of measured resonances that count
    uncounted: int  # Number of those that the true robot's linearisation does not have

    @property
    def near(self) -> dict[str, Models]:
        """Models from the study's own starts by its own strategy."""
        return self.groups[""]

    @property
    def as_in_paper(self) -> dict[str, Models]:
        """Models of plain descents, or, without these, those of the study's strategy."""
        return self.groups.get("plain", self.near)

    @property
    def best(self) -> FloatArray:
        """Internal parameters (n_param,) of the best reference model."""
        models = self.near[self.reference]
        return np.asarray(models.internal[models.order[0]])

    @property
    def least_determined(self) -> int:
        """Index of the spring with the largest predicted deviation."""
        spring = self.of_kind("stiffness")
        return int(np.argmax(np.where(spring, self.std, -np.inf)))

    def of_kind(self, kind: str) -> BoolArray:
        """Which parameters (n_param,) are of a kind."""
        return np.asarray(np.array(self.problem.parameters.kind_of) == kind)


def gather(run: Run, results: Sequence[Artifact]) -> Found:
    """Puts the tasks' results together and judges every model."""
    study = study_of(run.loaded, WernholtStudy)
    robot, delay = robot_and_delay(run.loaded)
    frf = measured(run)
    user, optimal = (set_up(robot, frf, options, delay)[0] for options in score_options(study))
    truth = true_internal(user, robot, run.loaded.experiment.campaigns[study.campaign])
    parts: dict[int, list[dict[str, Any]]] = {}
    per_set = -(-study.fit.starts // study.starts_per_task)
    for index, result in enumerate(results):
        values = values_of(result)
        parts.setdefault(index // per_set, []).append(values)
    kinds = sets(study)
    near = [part for index, kind in enumerate(kinds) if not kind.group for part in parts[index]]
    best = min(float(part["user_cost"].min()) for part in near)
    best_optimal = min(float(part["optimal_cost"].min()) for part in near)
    errors = own_resonance_errors(user, truth)
    judge = Judge(user, errors <= _RESONANCE_LIMIT)
    groups: dict[str, dict[str, Models]] = {}
    for index, kind in enumerate(kinds):
        groups.setdefault(kind.group, {})[kind.name] = _models(kind.name, parts[index], (best, best_optimal), judge)
    reference = groups[""][study.reference]
    return Found(
        problem=user,
        groups=groups,
        reference=study.reference,
        truth=truth,
        std=np.sqrt(np.diag(sandwich(user, reference.internal[reference.order[0]]))),
        best_cost=best,
        best_optimal_cost=best_optimal,
        truth_cost=user.cost(truth) / best,
        truth_optimal_cost=optimal.cost(truth) / best_optimal,
        resonances=int(judge.counted.sum()),
        uncounted=int((~judge.counted).sum()),
    )


def true_internal(problem: Problem, robot: Robot, campaign: Campaign) -> FloatArray:
    """Internal parameters (n_param,) of a simulated campaign's true robot."""
    source = campaign.source
    if source is None or source.simulate is None:
        message = "the settings' checks let a study without a simulated campaign pass"
        raise RuntimeError(message)
    true = true_robot(robot, source.simulate.truth)
    values = {f"{spring.name}.stiffness": spring.stiffness for spring in true.springs}
    values |= {f"{spring.name}.damping": spring.damping for spring in true.springs}
    parameters = problem.parameters
    return np.asarray(np.log([values[name] for name in parameters.names] / parameters.nominal_values()))


@dataclass
class Judge:
    """Tells whether models meet the measured resonances; those met before are not computed again."""

    problem: Problem
    counted: BoolArray

    def __post_init__(self) -> None:
        """Begins with no model."""
        self._known: dict[bytes, bool] = {}

    def meets(self, internal: FloatArray) -> bool:
        """Whether a model has every resonance that counts within the limit."""
        key = np.round(internal / _SAME_MODEL).astype(np.int64).tobytes()
        if key not in self._known:
            errors = own_resonance_errors(self.problem, internal)[self.counted]
            self._known[key] = bool((errors <= _RESONANCE_LIMIT).all())
        return self._known[key]


def _models(name: str, parts: Sequence[Mapping[str, Any]], best: tuple[float, float], judge: Judge) -> Models:
    def joined(key: str) -> Any:  # noqa: ANN401
        return np.concatenate([part[key] for part in parts])

    internal, cost = joined("internal"), joined("user_cost") / best[0]
    near = [value <= COST_LIMIT and judge.meets(one) for one, value in zip(internal, cost, strict=True)]
    return Models(
        name=name,
        internal=internal,
        own_cost=joined("cost"),
        user_cost=cost,
        optimal_cost=joined("optimal_cost") / best[1],
        evaluations=joined("evaluations"),
        capped=joined("status") == "iteration_limit",
        resonances=np.array(near),
        configuration=int(parts[0]["configuration"]),
        seconds=float(sum(part["seconds"] for part in parts)),
        processor_seconds=float(sum(part["processor_seconds"] for part in parts)),
    )


def model_figures(models: Models, found: Found) -> dict[str, float]:
    """Figures of one estimator by name, as they stand in summary.json."""
    spring = found.of_kind("stiffness")
    inside = within_factor(np.exp(models.internal), np.exp(found.best), _FACTOR)
    others = spring.copy()
    others[found.least_determined] = False
    own = models.own_cost <= _SAME_MINIMUM * models.own_cost.min()
    return {
        "reasonable": float(models.reasonable.mean()),
        "cost_within_1_5": float((models.user_cost <= COST_LIMIT).mean()),
        "springs_within_2": float(inside[:, others].all(axis=1).mean()),
        "springs_within_2_all": float(inside[:, spring].all(axis=1).mean()),
        "dampers_within_2": float(inside[:, found.of_kind("damping")].all(axis=1).mean()),
        "own_best": float(own.mean()),
        "best_cost": float(models.user_cost.min()),
        "median_cost": float(np.median(models.user_cost)),
        "best_optimal_cost": float(models.optimal_cost.min()),
        "median_optimal_cost": float(np.median(models.optimal_cost)),
        "spring_error": float(np.median(np.abs(best_of(models) - found.truth)[spring])),
        "evaluations.median": float(np.median(models.evaluations)),
        "evaluations.max": float(models.evaluations.max()),
        "cap_share": float(models.capped.mean()),
        "seconds": models.seconds / len(models.own_cost),
    }


def best_of(models: Models) -> FloatArray:
    """Internal parameters (n_param,) of an estimator's own best model."""
    return np.asarray(models.internal[np.argmin(models.own_cost)])


def summarise(found: Found) -> dict[str, float]:
    """All figures by name."""
    summary = {
        f"{name}.{key}{group and '_' + group}": value
        for group, members in found.groups.items()
        for name, one in members.items()
        for key, value in model_figures(one, found).items()
    }
    near = list(found.near.values())
    starts = sum(len(one.own_cost) for one in near)
    evaluations = np.concatenate([one.evaluations for one in near])
    summary |= {
        "fits": starts,
        f"fits{starts}_s": sum(one.seconds for one in near) / _CORES,
        f"fits{starts}_processor_s": sum(one.processor_seconds for one in near) / _CORES,
        "evaluations.median": float(np.median(evaluations)),
        "evaluations.max": float(evaluations.max()),
        "cap_share": float(np.mean(np.concatenate([one.capped for one in near]))),
        "best_over_truth": 1 / found.truth_cost,
        "best_over_truth_optimal": 1 / found.truth_optimal_cost,
        "resonances": found.resonances,
        "resonances_uncounted": found.uncounted,
        "std_least_determined": float(found.std[found.least_determined]),
    }
    alone = [one.configuration for one in near if one.configuration != ALL]
    return summary | {"best_configuration": float(alone[0] + 1)} if alone else summary
