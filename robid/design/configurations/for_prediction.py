"""Configurations for a model that is to predict responses elsewhere, though it lacks something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.criteria import check_different, check_finite, checked_scale
from robid.design.configurations.exchange import Exchange, best_exchange
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.plan import checked_plan
from robid.design.configurations.prediction import ExpectedError, PredictionParts
from robid.design.configurations.relaxed import Relaxed

_POOL = 600  # Candidates that exchange looks at: half of them the best slopes, the others at random
_REMEDY = "Raise count or experiments, or fix one of the named parameters in each combination."


@dataclass(frozen=True)
class PredictionPlan:
    """A choice for prediction, to be made."""

    options: DesignOptions
    error: ExpectedError
    cost: FloatArray  # (n_cand,) Cost of one experiment
    experiments: int
    budget: float

    def relaxed(self, limit: float = 1.0) -> Relaxed:
        """Optimal shares of the cost for what noise does to the prediction."""
        return self.error.relaxed(self.cost, self.budget, self.options.gap, self.options.iterations, limit)

    def choose(self, relaxed: Relaxed) -> IntArray:
        """Numbers of experiments (n_cand,) by exchange."""
        options, size = self.options, self.cost.size
        order = np.argsort(-relaxed.slopes, kind="stable")
        drawn = np.random.default_rng(options.seed).permutation(order[_POOL // 2 :])
        # Noise asks for candidates of large slopes, bias for ordinary ones.
        pool = np.sort(np.concatenate([order[: _POOL // 2], drawn[: _POOL - _POOL // 2]]))
        small = ExpectedError(self.error.parts.take(pool).compressed(), self.error.prior)
        distinct = min(options.count, self.experiments)
        counts = np.zeros(size, int)
        once = Exchange(small, distinct, distinct, False, self.cost[pool], self.budget)
        counts[pool] = best_exchange(once, np.ones(pool.size), options.restarts, options.seed)
        if options.experiments is not None:
            again = Exchange(small, self.experiments, options.count, True, self.cost[pool], self.budget)
            counts[pool] = again.improved(counts[pool])
        return counts

    def seen(self, counts: IntArray) -> FloatArray:
        """What some numbers of experiments see (n_draw, n_all, n_all), with what is known beforehand."""
        return np.asarray(self.error.prior + np.tensordot(self.error.parts.bread, counts.astype(float), (1, 0)))

    def choice_bound(self) -> float:
        """Mean square error that as many different candidates do not come below."""
        options, size = self.options, self.cost.size
        if options.experiments is not None or np.ptp(self.cost) > 0 or not 1 < options.count < size:
            return 0.0
        return self.error.bound(self.relaxed(limit=1 / options.count), self.budget)


def design_for_prediction(
    parts: PredictionParts,
    matrices: FloatArray,
    configurations: FloatArray,
    parameter_names: tuple[str, ...],
    options: DesignOptions,
    *,
    prior: FloatArray | None = None,
    cost: FloatArray | None = None,
    between: FloatArray | None = None,
) -> ConfigurationDesign:
    """Chooses configurations for the least expected error of predicted responses, by noise and by what the model lacks.

    Args:
        parts: What each candidate adds to the fit, and what is to be predicted.
        matrices (n_draw, n_conf, n_param, n_param): Information of one experiment in each candidate, as in
            `design_configurations`.
        configurations (n_conf, n_joint): The candidates' arm-side joint angles [rad].
        parameter_names: Names of the wanted parameters.
        options: Number of configurations and experiments, limits.
        prior (n_param, n_param): Information known beforehand.
        cost (n_conf,): Cost of one experiment in each candidate.
        between (n_param,): Deviation of each log-parameter between configurations; `parts` hold it too.

    Raises:
        SettingsError: As `design_configurations`.
        DataError: As `design_configurations`.

    Source:
        docs/methods, sec. 6; Box and Draper (1959).
    """
    price = np.ones(len(configurations)) if cost is None else cost
    experiments, budget = checked_plan(options, price)
    check_finite(matrices)
    known = np.zeros(matrices.shape[-2:]) if prior is None else prior
    for draw in matrices:
        checked_scale(known + draw.mean(axis=0), parameter_names, "the candidates", _REMEDY)
    check_different(matrices)
    error = ExpectedError(parts, parts.known(prior))
    plan = PredictionPlan(options, error, price, experiments, budget)
    relaxed = plan.relaxed()
    counts = plan.choose(relaxed)
    wanted = len(parameter_names)
    for bread in plan.seen(counts):
        checked_scale(bread[:wanted, :wanted], parameter_names, "the chosen configurations", _REMEDY)
    noise, bias = error.errors(counts)
    deviation = np.diagonal(error.covariance(counts), axis1=1, axis2=2).mean(axis=0)[:wanted]
    efficiency = error.bound(relaxed, budget) / (noise + bias)
    return ConfigurationDesign(
        weights=relaxed.weights,
        gap=relaxed.gap,
        criterion="prediction",
        slopes=relaxed.slopes,
        chosen=np.flatnonzero(counts),
        counts=counts,
        efficiency=efficiency,
        choice_efficiency=max(plan.choice_bound() / (noise + bias), efficiency),
        rounding_loss=float("nan"),
        # What one experiment more of each takes off the mean square error, as a share of it.
        gain=1 - error.worth(counts) / error.with_each(counts, np.arange(counts.size)),
        information=matrices.mean(axis=0),
        predicted_relative_std=np.sqrt(deviation),
        parameter_names=parameter_names,
        configurations=configurations,
        between_relative_std=None if between is None or not between.any() else between,
    )
