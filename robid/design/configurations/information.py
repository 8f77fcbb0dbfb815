"""The choice of configurations by their information, its certificate, and whether it would come out the same again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, Quantity, check_shape
from robid.design.configurations.comparison import Alternative
from robid.design.configurations.criteria import (
    check_different,
    check_finite,
    check_spread,
    checked_scale,
    is_regular,
)
from robid.design.configurations.options import DesignOptions, OutputName
from robid.design.configurations.plan import ConfigurationPlan, checked_plan, choose_counts
from robid.design.configurations.relaxed import Relaxed
from robid.design.configurations.visits import FittedInformation, Visits, make_visits, merged
from robid.signals.quantities import joint_unit

_FIX = "Fix or tie one of the named parameters in each combination, or offer configurations that excite it."
_TIGHTENED = 4  # How often the bound on a fit with its own weights is made tight at the weights found so far

_WEIGHTS = "Optimal weights: shares of the experiments, or of the cost"
_SLOPES = "What more weight brings; 1 for candidates that have weight"
_GAIN = "What one experiment more adds to log det of the information"
_MATRICES = "candidate parameter parameter"
_PROMISED = "Relative standard deviation that the choice promises"
_BETWEEN = "Deviation between configurations that was allowed for"


@dataclass(frozen=True)
class ConfigurationDesign:
    """The chosen configurations with what they promise."""

    # Optimal weights of the candidates, sum 1: shares of the experiments, or of the cost. Where parameters differ
    # between configurations and none is repeated, no share is larger than that of one visit
    weights: Annotated[FloatArray, Quantity("1", "candidate", _WEIGHTS)]
    # Certificate of the weights: no others are worth more than `1 + gap` times as much; for `d` without prior
    # `(max tr(M^-1 H_i) - n) / n`
    gap: float
    criterion: str  # What was made the most of: `d`, `a`, `e` or `prediction`
    slopes: Annotated[FloatArray, Quantity("1", "candidate", _SLOPES)]
    chosen: Annotated[IntArray, Quantity("1", "configuration", "Indices of the chosen candidates")]
    counts: Annotated[IntArray, Quantity("1", "candidate", "Experiments in each candidate")]
    # Worth of the chosen numbers over the certified bound on any weights, 0 to 1; what is missing is also the price of
    # few configurations and whole numbers
    efficiency: float
    # The same over the certified bound on choices of as many different candidates, with equal effort, or with repeats
    # or costs with all the effort in each; `efficiency` where that is tighter
    choice_efficiency: float
    rounding_loss: float  # Share of the worth that whole numbers cost, against optimal weights of the chosen ones
    # What one experiment more of each candidate adds to `log det` of the information known beforehand; where that alone
    # does not determine all parameters, of it and the chosen ones together
    gain: Annotated[FloatArray, Quantity("1", "candidate", _GAIN)]
    # As they are there, mean over the draws
    information: Annotated[FloatArray, Quantity("1", _MATRICES, "Information about the log-parameters")]
    predicted_relative_std: Annotated[FloatArray, Quantity("1", "parameter", _PROMISED)]
    # Parameters that the design is for, as `gear_2.stiffness`
    parameter_names: Annotated[tuple[str, ...], Quantity("1", "parameter")]
    configurations: Annotated[FloatArray, Quantity("{joint}", "candidate joint", "The candidates' arm-side joints")]
    # None where they cost the same
    cost_s: Annotated[FloatArray | None, Quantity("s", "candidate", "Time of one visit: experiments and way")] = None
    # Whether the choice would come out the same; None without other information to choose by
    stability: Stability | None = None
    joint_units: Annotated[tuple[str, ...] | None, Quantity("1", "joint", "Units of the joints' positions")] = None
    between_relative_std: Annotated[FloatArray | None, Quantity("1", "parameter", _BETWEEN)] = None
    predict: OutputName = "response"  # What the model is to predict
    # What as many configurations would give by each criterion and at random; empty where it was not computed
    alternatives: Annotated[tuple[Alternative, ...], Quantity("1", "way")] = ()

    @property
    def own_units(self) -> dict[str, str]:
        """Units that its joints decide."""
        return {"joint": joint_unit(self.joint_units)}

    @property
    def told(self) -> FloatArray:
        """What the visits to each chosen configuration tell of each parameter (n_chosen, n_param), others known."""
        return np.diagonal(self.visits.of(self.chosen, self.counts[self.chosen])[0, :, 0], axis1=1, axis2=2)

    @property
    def visits(self) -> Visits:
        """What visits to each candidate tell, by optimal weights."""
        apart = np.zeros(len(self.parameter_names)) if self.between_relative_std is None else self.between_relative_std
        return make_visits(self.information[None, :, None], apart**2)


@dataclass(frozen=True)
class Stability:
    """Choices by other information than the one that was used, see `robid.design.configurations.information`."""

    source: str  # Where that comes from: `realizations` (each half of them) or `draws` (each one alone)
    kept: Annotated[FloatArray, Quantity("1", "trial", "Share of the choice that other data or parameters choose too")]
    efficiency: Annotated[FloatArray, Quantity("1", "trial", "Efficiency of that choice by what it did not use")]
    chosen_often: Annotated[FloatArray, Quantity("1", "candidate", "Share of the trials that choose each candidate")]


def information(jacobian: FloatArray | ComplexArray, variance: FloatArray) -> FloatArray:
    """Information (n_conf, n_param, n_param) of residuals: `J' V^-1 J`, of complex ones `2 Re(J^H V^-1 J)`.

    The derivatives by the log-parameters are (n_conf, ..., n_param); the variances, `E|r|^2` of circular complex
    residuals, broadcast to (n_conf, ...).

    Source:
        Zimmermann et al. (2023), eq. 4.
    """
    scaled = jacobian / np.sqrt(np.broadcast_to(variance, jacobian.shape[:-1]))[..., None]
    rows = scaled.reshape(len(scaled), -1, scaled.shape[-1])
    if np.iscomplexobj(rows):
        # Real and imaginary part are independent with half of E|r|^2 each.
        rows = np.sqrt(2) * np.concatenate([rows.real, rows.imag], axis=1)
    return np.asarray(rows.swapaxes(1, 2) @ rows)


def design_configurations(
    matrices: FloatArray,
    configurations: FloatArray,
    parameter_names: tuple[str, ...],
    options: DesignOptions,
    *,
    prior: FloatArray | None = None,
    cost: FloatArray | None = None,
    fitted: FittedInformation | None = None,
    between: FloatArray | None = None,
) -> ConfigurationDesign:
    """Chooses configurations by what they tell about the parameters.

    The planned number of experiments N (or the budget, where candidates have costs) decides how much the prior
    counts: the weights are those of `H_0 / N + sum w_i H_i`.

    Args:
        matrices (n_conf, n_param, n_param): Information of one experiment in each candidate about the log-parameters,
            or (n_draw, n_conf, n_param, n_param) under draws of the parameters.
        configurations (n_conf, n_joint): The candidates' arm-side joint angles [rad].
        parameter_names: Names of the parameters.
        options: Criterion, number of configurations and experiments, limits.
        prior (n_param, n_param): Information known beforehand, such as the inverse covariance of an earlier fit.
        cost (n_conf,): Cost of one experiment in each candidate.
        fitted: The choice is made for a fit with its own weights. Such information does not add over candidates:
            exchange maximises it, and its efficiency is against a bound on optimal weights of the same responses.
            `matrices` are then only what each candidate tells alone.
        between (n_param,): Deviation of each log-parameter between configurations, by what the model lacks; none when
            not given. No number of visits to one configuration tells more than it allows.

    Raises:
        SettingsError: If there are fewer candidates than configurations to choose, or more of these than experiments,
            or the budget does not pay them.
        DataError: If the information is not finite, all candidates are alike, or they together, or the chosen ones,
            leave a combination of parameters unseen.

    Source:
        docs/methods, sec. 6 and 11; Zimmermann et al. (2023), eq. 4-6.
    """
    n_conf, n_param = len(configurations), len(parameter_names)
    draws = matrices if matrices.ndim == 4 else matrices[None]
    check_shape("matrices", draws, "n_draw n_conf n_param n_param", n_conf=n_conf, n_param=n_param)
    price = np.ones(n_conf) if cost is None else cost
    known = np.zeros((n_param, n_param)) if prior is None else prior
    experiments, budget = checked_plan(options, price)
    check_finite(draws)
    for draw in draws:
        checked_scale(known + draw.mean(axis=0), parameter_names, "the candidates", _FIX)
    check_different(draws)
    apart = np.zeros(n_param) if between is None else between
    # (I^-1 + T)^-1 in place of a visit's information, with T what clusters differ by (docs/methods, sec. 11).
    visits = make_visits(draws[:, :, None], apart**2)
    # D is the same in any scale of the parameters: over their own information numbers stay near one.
    scale = np.sqrt(np.diag(known + visits.once[-1, :, 0].mean(axis=0)))
    if options.criterion != "d":
        # The other criteria depend on the parameters' scale: that of the log-parameters stays.
        scale = np.full(n_param, scale.mean())
        for draw in draws:
            check_spread(known + draw.mean(axis=0), options.of_information)
    plan = _plan(visits, known, scale, fitted, options, price, experiments, budget)
    if fitted is not None:
        every = np.ones(n_conf, int)
        for seen in plan.seen(every):
            checked_scale(seen, parameter_names, "the candidates, by the weights of the fit,", _FIX)
    relaxed = plan.relaxed()
    shared = _shares(plan, relaxed)
    counts = choose_counts(plan, shared)
    chosen = np.flatnonzero(counts)
    _check_chosen(plan, counts, parameter_names)
    found, own = plan.worth(counts), plan.shared_out(counts)
    # Predicted variances of log-parameters: the diagonal of the inverse total, mean over the draws.
    deviation = np.diagonal(np.linalg.inv(plan.totals(counts)), axis1=1, axis2=2).mean(axis=0)
    beforehand = is_regular(known / np.outer(scale, scale))
    return ConfigurationDesign(
        weights=shared.weights,
        gap=shared.gap,
        criterion=options.criterion,
        slopes=shared.slopes,
        chosen=chosen,
        counts=counts,
        efficiency=found / plan.bound(relaxed),
        choice_efficiency=_choice_efficiency(plan, found, found / plan.bound(relaxed)),
        rounding_loss=1 - found / plan.bound(own),
        gain=_gain(plan, np.zeros_like(counts) if beforehand else counts),
        information=draws.mean(axis=0),
        predicted_relative_std=np.sqrt(deviation) / scale,
        parameter_names=parameter_names,
        configurations=configurations,
        between_relative_std=apart if apart.any() else None,
    )


def promised_deviations(
    matrices: FloatArray, prior: FloatArray | None, between: FloatArray
) -> Callable[[IntArray], FloatArray]:
    """What numbers of experiments (n_conf,) promise: relative deviations (n_param,), mean variance over the draws.

    Information, prior and between are those of `design_configurations`.
    """
    visits = make_visits(matrices[:, :, None], between**2)
    known = np.zeros(matrices.shape[-2:]) if prior is None else prior

    def deviations(counts: IntArray) -> FloatArray:
        total = known + visits.total(counts)[:, 0]
        if not all(is_regular(each) for each in total):
            return np.full(len(between), np.inf)
        return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(total), axis1=1, axis2=2).mean(axis=0)))

    return deviations


def _plan(
    visits: Visits,
    known: FloatArray,
    scale: FloatArray,
    fitted: FittedInformation | None,
    options: DesignOptions,
    price: FloatArray,
    experiments: int,
    budget: float,
) -> ConfigurationPlan:
    known = known / (scale[:, None] * scale)
    if fitted is None:
        visits = visits.scaled(scale)
        return ConfigurationPlan(options, visits.once[:, :, 0], visits, known, known[None], price, experiments, budget)
    own = fitted.scaled(scale)
    # What is estimated along is the same in all configurations.
    apart = np.concatenate([visits.between * scale**2, np.zeros(len(own.precision) - scale.size)])
    parts = make_visits(own.parts(), apart)
    own = replace(own, best=make_visits(own.best[:, :, None], apart).once[:, :, 0])
    # The bound holds for any visits and is tight at these: made tight where the last weights were, it falls.
    tight = np.full(price.size, budget / price.sum())
    lowest = np.inf
    for _ in range(_TIGHTENED):
        # Matrices that add and never fall short of what the fit makes of their sum.
        bound, beside = own.bound(known, tight)
        plan = ConfigurationPlan(options, bound, parts, beside, own.base(known), price, experiments, budget)
        relaxed = plan.relaxed()
        if plan.bound(relaxed) >= lowest:
            break
        best, lowest, tight = plan, plan.bound(relaxed), budget * relaxed.weights / price
    return best


def _shares(plan: ConfigurationPlan, relaxed: Relaxed) -> Relaxed:
    """Optimal weights without further visits to one configuration, which would tell less than the first."""
    options = plan.options
    once = options.experiments is None and np.ptp(plan.cost) == 0 and 1 < options.count < plan.cost.size
    return plan.relaxed(limit=1 / options.count) if once and plan.visits.between.any() else relaxed


def _gain(plan: ConfigurationPlan, counts: IntArray) -> FloatArray:
    here, more = plan.sums(counts), plan.visits.more(np.arange(counts.size), counts)
    # log det with one visit more, less that without.
    before = np.linalg.slogdet(merged(here, plan.wanted))[1]
    after = np.linalg.slogdet(merged(here[:, None] + more, plan.wanted))[1]
    return np.asarray((after - before[:, None]).mean(axis=0))


def _check_chosen(plan: ConfigurationPlan, counts: IntArray, names: tuple[str, ...]) -> None:
    options = plan.options
    by, remedy = f"the best {options.count} configurations", "Raise count."
    if options.experiments is not None:
        by = f"the best {options.experiments} experiments in at most {options.count} configurations"
        remedy = "Raise experiments or count."
    for total in plan.seen(counts):
        checked_scale(total, names, by, remedy)


def _choice_efficiency(plan: ConfigurationPlan, found: float, efficiency: float) -> float:
    """Efficiency against the bound on different candidates with equal effort, where it is tighter."""
    options = plan.options
    if options.experiments is not None or np.ptp(plan.cost) > 0 or options.count == 1:
        if not plan.visits.between.any() or plan.visits.alone.shape[2] > 1:
            return efficiency
        return max(found / plan.most(), efficiency)
    if options.count == plan.cost.size:
        everything = np.ones(plan.cost.size, int)
        return found / plan.worth(everything)
    return max(found / plan.bound(plan.relaxed(limit=1 / options.count)), efficiency)
