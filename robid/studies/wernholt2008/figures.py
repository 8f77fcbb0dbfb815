"""The models of all starts, judged, and the seven conclusions of Wernholt and Moberg (2008), sec. 7, against them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.judge.extrema import own_resonance_errors
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.simulate.truth import true_robot
from robid.studies.settings.study import EstimatorChoice, WernholtStudy
from robid.studies.simulated import ratio_interval, simulate_options
from robid.studies.study import study_of, values_of
from robid.studies.wernholt2008 import study as fits


def spread(values: FloatArray, best: FloatArray) -> dict[str, FloatArray]:
    """Returns statistics of models (n_model, n_param) near the best one, each parameter divided by the best model's.

    Source:
        Wernholt and Moberg (2008), Table 1.
    """
    relative = values / best
    std = relative.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1])
    found = {"min": relative.min(axis=0), "max": relative.max(axis=0), "mean": relative.mean(axis=0), "std": std}
    return {**found, "median": np.asarray(np.median(relative, axis=0))}


def within_factor(values: FloatArray, best: FloatArray, factor: float) -> BoolArray:
    """Tells which parameters (n_model, n_param) lie within a factor of the best model's, ends included."""
    relative = values / best
    return np.asarray((relative >= 1 / factor) & (relative <= factor))


def shares_differ(first: float, second: float, count: int) -> bool:
    """Tells whether one share of starts is larger than another by more than two standard errors."""
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
    robot, delay = fits.robot_and_delay(run.loaded)
    frf = fits.read_frf(run.path(fits.needs(run.loaded)[0]))
    user, optimal = (set_up(robot, frf, options, delay)[0] for options in fits.score_options(study))
    true = true_robot(robot, simulate_options(run.loaded.experiment.campaigns[study.campaign]).truth)
    springs, parameters = fits.true_springs(true), user.parameters
    truth = np.log([springs[name] for name in parameters.names] / parameters.nominal_values())
    per_set = -(-study.fit.starts // study.starts_per_task)
    values = [values_of(result) for result in results]
    parts = [values[at : at + per_set] for at in range(0, len(values), per_set)]
    kinds = fits.sets(study)
    near = [part for index, kind in enumerate(kinds) if not kind.group for part in parts[index]]
    best, best_optimal = (min(float(part[key].min()) for part in near) for key in ("user_cost", "optimal_cost"))
    judge = Judge(user, own_resonance_errors(user, truth) <= _RESONANCE_LIMIT)
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


@dataclass(frozen=True)
class Judge:
    """Tells whether models meet the measured resonances; those met before are not computed again."""

    problem: Problem
    counted: BoolArray
    known: dict[bytes, bool] = field(default_factory=dict)

    def meets(self, internal: FloatArray) -> bool:
        """Whether a model has every resonance that counts within the limit."""
        key = np.round(internal / _SAME_MODEL).astype(np.int64).tobytes()
        if key not in self.known:
            errors = own_resonance_errors(self.problem, internal)[self.counted]
            self.known[key] = bool((errors <= _RESONANCE_LIMIT).all())
        return self.known[key]


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
    best = models.internal[np.argmin(models.own_cost)]
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
        "spring_error": float(np.median(np.abs(best - found.truth)[spring])),
        "evaluations.median": float(np.median(models.evaluations)),
        "evaluations.max": float(models.evaluations.max()),
        "cap_share": float(models.capped.mean()),
        "seconds": models.seconds / len(models.own_cost),
    }


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
    alone = [one.configuration for one in near if one.configuration != fits.ALL]
    return summary | {"best_configuration": float(alone[0] + 1)} if alone else summary


_HONEST_FACTOR = 3.0
_LEAST_CORRELATION = 0.5
_ALIKE = 0.8
_WORTH_HAVING = 0.9  # Ratio of errors above which one is no gain over the other


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper."""

    text: str  # What the paper says
    figures: str  # What we found
    reproduced: bool | None  # Whether that bears it out; None where the study lacks an estimator that it needs
    # Whether it is sure over the individuals that it makes no gain worth having; None where none are asked
    refuted: bool | None = None

    @property
    def word(self) -> str:
        """The verdict in a word."""
        if self.reproduced is None:
            return MISSING
        if self.reproduced:
            return "yes"
        return {None: "no", False: "undecided", True: "refuted"}[self.refuted]


def claims(
    found: Found,
    choices: Mapping[str, EstimatorChoice],
    transmission: BoolArray,
    individuals: fits.Individuals | None = None,
) -> tuple[Claim, ...]:
    """Returns the seven conclusions; `transmission` (n_param,) tells which parameters are those of gearboxes.

    Those about success compare shares of reasonable models, of plain descents where the study has them, as the
    paper's: larger by more than two standard errors bears them out. Those about kinds of parameters compare the
    medians of the predicted standard deviation and of the true error of the best model: both must be larger.
    Where there are individuals, the third to the fifth conclusion are about what estimates are worth: the size of their
    errors, see `_by_errors`.
    """
    names = ("user", "optimal")
    user, optimal = (_chosen(found, choices, "lls", name) for name in names)
    plain = tuple(_chosen(found, choices, "nls", name) for name in names)
    phased, alone = _chosen(found, choices, "llsm", "user"), _chosen(found, choices, "lls", "user", "best")
    spring, damper = found.of_kind("stiffness"), found.of_kind("damping")
    gears, structure = spring & transmission, spring & ~transmission
    phase = _shares("Using phase information improves the estimate.", (user,), (phased,))
    rough = _shares("Rough user-defined weights work better than the theoretically optimal ones.", (user,), (optimal,))
    easier = _kinds("Gearbox springs are easier to estimate than arm structure springs.", found, gears, structure)
    if individuals is not None and user is not None:
        phase = _smaller(phase, individuals, user, phased)
        rough = _smaller(rough, individuals, user, optimal)
        easier = _easier(easier, individuals, user.name, found, (gears, structure))
    return (
        _shares("The LLS estimator is superior to the NLS estimator.", (user, optimal), plain),
        _shares("More than one configuration is needed.", (user,), (alone,)),
        phase,
        rough,
        easier,
        _kinds("Springs are easier to identify than dampers.", found, spring, damper),
        _honest("The theoretical uncertainties are a good indication of the parameters' quality.", found),
    )


def _chosen(
    found: Found, choices: Mapping[str, EstimatorChoice], estimator: str, weights: str, configurations: str = "all"
) -> Models | None:
    """Models of the first estimator that is made so; None where the study has none."""
    wanted = estimator, weights, configurations
    names = (name for name, one in choices.items() if (one.estimator, one.weights, one.configurations) == wanted)
    return found.as_in_paper.get(next(names, ""))


def _shares(text: str, better: tuple[Models | None, ...], worse: tuple[Models | None, ...]) -> Claim:
    first, second = ([one for one in group if one is not None] for group in (better, worse))
    if len(first) < len(better) or len(second) < len(worse):
        return Claim(text, "not studied", None)
    shares = [float(np.mean(np.concatenate([one.reasonable for one in group]))) for group in (first, second)]
    count = sum(len(one.own_cost) for one in first)
    names = [" and ".join(one.name for one in group) for group in (first, second)]
    figures = f"reasonable: {percent(shares[0])} of {names[0]}, {percent(shares[1])} of {names[1]}"
    costs = [min(float(one.user_cost.min()) for one in group) for group in (first, second)]
    figures += f"; best cost {significant(costs[0])} and {significant(costs[1])}"
    return Claim(text, figures, shares_differ(shares[0], shares[1], count))


def _kinds(text: str, found: Found, easier: BoolArray, harder: BoolArray) -> Claim:
    if not easier.any() or not harder.any():
        return Claim(text, "not studied", None)
    both = found.std, true_error(found)
    std, off = ([float(np.median(values[mask])) for mask in (easier, harder)] for values in both)
    figures = (
        f"predicted deviation {percent(std[0])} and {percent(std[1])},"
        f" true error {percent(off[0])} and {percent(off[1])} (medians)"
    )
    return Claim(text, figures, std[0] < std[1] and off[0] < off[1])


def _smaller(claim: Claim, individuals: fits.Individuals, better: Models, worse: Models | None) -> Claim:
    if worse is None:
        return claim
    names = better.name, worse.name
    errors, physical = ([values[name] for name in names] for values in (individuals.error, individuals.physical))
    alike = float(np.median([spearmanr(*rows).statistic for rows in zip(*errors, strict=True)]))
    made = ", as what the model lacks makes most of them" if alike >= _ALIKE else ""
    beside = f"rank correlation of both errors {significant(alike, 2)}{made}"
    return _by_errors(claim, errors, physical, names, beside)


def _easier(
    claim: Claim, individuals: fits.Individuals, name: str, found: Found, kinds: tuple[BoolArray, BoolArray]
) -> Claim:
    if not all(kind.any() for kind in kinds):
        return claim
    every = np.array(found.problem.parameters.names)
    own = [np.isin(individuals.names, every[kind]) for kind in kinds]
    stated = [np.nanmedian(individuals.std[name][:, mask], axis=1) for mask in own]
    errors, physical = ([values[name][:, mask] for mask in own] for values in (individuals.error, individuals.physical))
    beside = f"{name} states deviations of {_percents(stated[0])} and {_percents(stated[1])}"
    return _by_errors(claim, errors, physical, ("gears", "structure"), beside)


def _by_errors(
    claim: Claim, errors: list[FloatArray], physical: list[FloatArray], names: tuple[str, str], beside: str
) -> Claim:
    """Judges a conclusion by the errors that it says to be smaller, over those that it says to be larger.

    It is borne out when the 95 % interval of their ratio over the individuals lies below 1, refuted when it lies above
    what would be worth having; neither when it holds both. Estimates count, as in the paper; those of the springs
    themselves, with what the robot file may have wrong, stand beside.
    """
    low, high = ratio_interval(*map(fits.sizes_of, errors))
    figures = (
        f"{claim.figures}; over {len(errors[0])} individuals an error of {_compared(errors, names)}; {beside};"
        f" with what the robot file may have wrong estimated along {_compared(physical, names)}"
    )
    return Claim(claim.text, figures, high < 1, low > _WORTH_HAVING and not high < 1)


def _compared(errors: list[FloatArray], names: tuple[str, str]) -> str:
    sizes = [fits.sizes_of(each) for each in errors]
    low, high = (significant(end, 2) for end in ratio_interval(*sizes))
    return f"{_percents(sizes[0])} ({names[0]}) and {_percents(sizes[1])} ({names[1]}), {low} to {high} times as large"


def _percents(values: FloatArray) -> str:
    return percent(float(np.exp(np.log(values).mean())))


def _honest(text: str, found: Found) -> Claim:
    error = true_error(found)
    ratio = float(np.median(error / found.std))
    rank = float(spearmanr(error, found.std).statistic)
    figures = (
        f"true error over predicted deviation {significant(ratio)} (median; 0.67 if only noise made it),"
        f" rank correlation {significant(rank)}"
    )
    return Claim(text, figures, 1 / _HONEST_FACTOR <= ratio <= _HONEST_FACTOR and rank >= _LEAST_CORRELATION)


def true_error(found: Found) -> FloatArray:
    """Distance (n_param,) of the best reference model from the truth, as a logarithm."""
    return np.abs(found.best - found.truth)
