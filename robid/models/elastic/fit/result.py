"""The solution of an elastic fit: its best minimum with everything that tells how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.clusters.evidence import group_clusters
from robid.models.elastic.fit.gears_alone import gears_alone
from robid.models.elastic.fit.intervals import FEWEST_CLUSTERS, Spreads, find_spreads
from robid.models.elastic.fit.model_error import ModelError, estimate_model_error
from robid.models.elastic.fit.nuisance.linear import Basis
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import ParameterMap
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import (
    LEARNT_SHARE,
    Costs,
    ElasticSolution,
    Internal,
    Resampled,
    Responses,
    Spread,
    Starts,
)
from robid.models.elastic.fit.uncertainty import (
    Influence,
    Map,
    bootstrap,
    influence,
    realization_covariance,
    realization_shifts,
)
from robid.results.estimate import Estimate, Tied, undetermined_combinations
from robid.results.levenberg import Minimum
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.spring_laws import BristleTable

_ALIKE = 2.0  # largest over smallest load
_STICKS = 3.0  # slip over swing from which bristles are as good as a spring
_OR_FIX = "or leave it out of `free`"


@dataclass(frozen=True)
class _Found:
    """What a fit found of one kind of a gear."""

    name: str
    value: float
    lower: float
    upper: float
    identified: bool


def undetermined_gears(problem: Problem, estimate: Estimate) -> tuple[str, ...]:
    """Says what of load-dependent damping and hysteresis stays open, a sentence each without its full stop."""
    effects = problem.model.effects
    if effects is None:
        return ()
    names = [name for name, kind in zip(estimate.names, estimate.kinds, strict=True) if kind == NUISANCE_KIND]
    every = problem.parameters
    told: list[str] = []
    for name, (_, spring) in zip(effects.damped_names, effects.damped.tolist(), strict=True):
        if name in names:
            unit = "mm" if every.units[every.names.index(name)] == "1/m" else "mrad"
            told += _of_damper(_found(estimate, name), 1e3 * effects.load[:, spring], unit)
    for name, bristle in zip(effects.slipping_names, effects.bristles, strict=True):
        if name in names:
            told += _of_bristles(_found(estimate, name), bristle, every.units[every.names.index(name)])
    return tuple(told)


def _found(estimate: Estimate, name: str) -> _Found:
    index = estimate.names.index(name)
    value, lower, upper = (float(each[index]) for each in (estimate.value, estimate.lower, estimate.upper))
    return _Found(name, value, lower, upper, bool(estimate.identified[index]))


def _of_damper(found: _Found, load: FloatArray, unit: str) -> Iterator[str]:
    if found.identified:
        return
    damper, least, most = found.name.replace("load_damping", "damping"), float(load.min()), float(load.max())
    reach = f"{least:.2g} to {most:.2g} {unit}"
    if most < _ALIKE * least:
        yield (
            f"{found.name} is hardly distinguished from {damper}: the gear is bent nearly alike in all configurations "
            f"({reach}): measure some that load it otherwise, {_OR_FIX}"
        )
    else:
        yield (
            f"{found.name} is hardly determined, though the gear is bent by {reach}: measure more configurations at "
            f"both ends, {_OR_FIX}"
        )


def _of_bristles(found: _Found, bristle: BristleTable, unit: str) -> Iterator[str]:
    spring = found.name.replace("hysteresis", "stiffness")
    sticking, slip = _STICKS * bristle.stiffness * bristle.swing, abs(found.value) / bristle.stiffness
    if slip > _STICKS * bristle.swing:
        yield (
            f"{found.name} is hardly distinguished from {spring}: at this swing bristles stick from {sticking:.2g} "
            f"{unit} on, and are part of the spring: excite the gear more (`rms`), {_OR_FIX}"
        )
    elif found.lower <= 0 <= found.upper:
        more = max(abs(found.lower), abs(found.upper))
        yield (
            f"{found.name} may be none: it is below {more:.2g} {unit}, or above some {sticking:.2g} {unit}, where "
            f"bristles stick at this swing and are part of the spring: excite the gear more (`rms`), {_OR_FIX}"
        )
    elif not found.identified:
        yield f"{found.name} is hardly distinguished from dampers: average more realizations, {_OR_FIX}"


_NO_REST = (
    "the springs that would fit best give way under gravity: these are on the way to them, as far as the robot rests;"
    " look for wrong data or a wrong robot file before anything else"
)
_SAME_MINIMUM = 1e-3
_NEEDLESS_FACTOR = 1e3
_MANY_DROPPED = 0.2
_POOR_MODEL = 1.5
_MANY_ABOVE = 0.25
"""Share of the elements beyond their covariance from which a model lacks something; 0.05 is expected."""


def make_solution(
    problem: Problem,
    options: ElasticOptions,
    best: Minimum,
    ends: list[Minimum],
    predicted: FloatArray,
    dropped: int,
    parallel_map: Map,
    basis: Basis | None,
) -> ElasticSolution:
    """Puts together what a fit found.

    Args:
        problem: The problem with the weights of the final fit.
        options: Its options.
        best: Its best minimum.
        ends: Where each start ended.
        predicted (n_param,): Deviations of the internal parameters, predicted before the fit.
        dropped: Response elements that the logarithm dropped.
        parallel_map: Ordered map that runs the bootstrap.
        basis: What the fit started from, for what the robot file may have wrong; nothing of that when not given.
    """
    internal = best.parameters
    modelled = problem.model_response(internal)
    excess = misfit(problem, modelled, best.cost)
    found = influence(problem, internal)
    error = estimate_model_error(problem, internal, found)
    spreads = find_spreads(problem, internal, found, excess, options.confidence, basis)
    lost = _NO_REST if basis is not None and not basis.rested else ""
    ending = best.status, "; ".join(filter(None, (lost, _advice(problem, best, dropped, excess, error))))
    estimate = _estimate(problem.parameters, internal, spreads, predicted, options, ending)
    undetermined = *estimate.undetermined, *undetermined_gears(problem, estimate)
    own, expected = problem.configuration_cost(modelled, internal), expected_cost(problem, modelled)
    return ElasticSolution(
        estimate=replace(estimate, undetermined=undetermined),
        internal=_internal(problem, internal, spreads.effective),
        costs=Costs(best.cost, own, expected, dropped, _excited(problem)),
        misfit=excess,
        starts=_starts(ends),
        responses=Responses(problem.frf.configurations, problem.frf.frequency_hz, problem.measured(internal), modelled),
        model_error=error,
        effective=spreads.between,
        doubts=spreads.nuisances,
        gears=None if basis is None else gears_alone(basis.robot, estimate),
        **_from_realizations(problem, options, internal, found, parallel_map),
    )


def _starts(ends: list[Minimum]) -> Starts:
    costs, iterations, evaluations = (
        np.array([getattr(end, name) for end in ends]) for name in ("cost", "iterations", "evaluations")
    )
    return Starts(costs, iterations, evaluations, tuple(end.status for end in ends), distinct_minima(costs))


def _estimate(
    parameters: ParameterMap,
    internal: FloatArray,
    spreads: Spreads,
    predicted: FloatArray,
    options: ElasticOptions,
    ending: tuple[str, str],
) -> Estimate:
    """The parameters at the minimum, with status and advice of the fit."""
    spread, predicting = spreads.physical, spreads.effective
    ends, near = (each.ends(options.confidence, parameters.prior_std) for each in (spread, predicting))
    relative, slopes = _relative(parameters, internal), parameters.slopes(internal)
    # Identifiable is what the prediction before the fit determines well enough, and better than what was known.
    per_internal, limit = _predicted_relative(parameters), options.identifiable_relative_std
    identifiable = (predicted * per_internal <= limit) & (predicted <= LEARNT_SHARE * parameters.prior_std)
    # Friction scales and amounts are relative errors: combinations of them with others mean nothing.
    structural = np.minimum(relative, 1.0) * (np.array(parameters.kind_of) != "friction") * ~_is_amount(parameters)
    return Estimate(
        names=parameters.names,
        kinds=parameters.kind_of,
        units=parameters.units,
        nominal=parameters.nominal_values(),
        value=parameters.values(internal),
        lower=parameters.values(ends[0]),
        upper=parameters.values(ends[1]),
        covariance=spread.covariance * np.outer(slopes, slopes),
        degrees_of_freedom=spread.degrees_of_freedom,
        confidence=options.confidence,
        interval_rule=spread.rule,
        relative_std=spread.std * relative,
        predicted_relative_std=predicted * per_internal,
        prior_relative_std=parameters.prior_std * per_internal,
        relative_half_width=spread.reach(options.confidence) * _judged_relative(parameters, internal),
        identifiable=identifiable,
        identifiable_relative_std=limit,
        undetermined=undetermined_combinations(parameters.names, spreads.assumed, structural, limit),
        status=ending[0],
        advice=ending[1],
        tied=_tied(parameters, internal, ends),
        physical_value=parameters.values(spread.values),
        effective_value=parameters.values(predicting.values),
        effective_lower=parameters.values(near[0]),
        effective_upper=parameters.values(near[1]),
    )


def _is_amount(parameters: ParameterMap) -> BoolArray:
    """Which parameters (n_param,) are amounts by which the file is off: no factor says how far they may be."""
    return np.asarray((np.array(parameters.kind_of) == NUISANCE_KIND) & (parameters.nominal_values() == 0))


def _internal(problem: Problem, internal: FloatArray, spread: Spread) -> Internal:
    # Scaled to a unit diagonal, the information's singular values do not depend on units: their ratio is a condition.
    information = problem.normal(internal).hessian
    root = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values = np.asarray(np.linalg.svd(information / np.outer(root, root), compute_uv=False))
    return Internal(internal, spread.covariance, values, spread.degrees_of_freedom)


class _Realized(TypedDict, total=False):
    realization_relative_std: FloatArray
    bootstrap: Resampled


def _from_realizations(
    problem: Problem, options: ElasticOptions, internal: FloatArray, found: Influence, parallel_map: Map
) -> _Realized:
    """What the single realizations say of the parameters' uncertainty; nothing where there are none."""
    shifts = realization_shifts(problem, found)
    if shifts is None:
        return {}
    relative, values = _relative(problem.parameters, internal), problem.parameters.values
    std = np.sqrt(np.diag(realization_covariance(found, shifts)))
    result = _Realized(realization_relative_std=std * relative)
    if options.bootstrap:
        level, count = options.confidence, options.bootstrap
        repeated = bootstrap(problem, internal, found, shifts, count, level, options.seed, parallel_map)
        result["bootstrap"] = Resampled(repeated.std * relative, values(repeated.lower), values(repeated.upper))
    return result


def _tied(parameters: ParameterMap, internal: FloatArray, ends: tuple[FloatArray, FloatArray]) -> Tied:
    rows = [parameters.elements.index(name) for name in parameters.tied]
    points = np.zeros_like(internal), internal, *ends
    at = [parameters.element_values(point)[rows] for point in points]
    return Tied(tuple(parameters.tied), tuple(parameters.tied.values()), *at)


def _relative(parameters: ParameterMap, internal: FloatArray) -> FloatArray:
    """Relative change (n_param,) of each value per unit of its internal parameter; the change itself for friction."""
    friction = np.array(parameters.kind_of) == "friction"
    size = np.where(friction, 1.0, np.maximum(np.abs(parameters.values(internal)), 1e-300))
    return np.asarray(np.abs(parameters.slopes(internal)) / size)


def _predicted_relative(parameters: ParameterMap) -> FloatArray:
    """The same at the nominal values; of what may be zero there, related to what it could be beforehand."""
    start, nominal = np.zeros(len(parameters.names)), parameters.nominal_values()
    friction = np.array(parameters.kind_of) == "friction"
    # A predicted deviation is compared with the file's value; what may be zero, with the size from which it matters.
    natural = 1.0 if parameters.natural is None else parameters.natural
    size = np.where(friction | (nominal == 0), natural, np.abs(nominal))
    kinds = np.array(parameters.kind_of)
    size = np.where(kinds == "cubic", parameters.scale * parameters.cubic_std, size)
    size = np.where(kinds == "location", parameters.scale, size)
    return np.asarray(np.abs(parameters.slopes(start)) / size)


def _judged_relative(parameters: ParameterMap, internal: FloatArray) -> FloatArray:
    """As `_relative`, but what may be zero is related to its natural scale where that is larger."""
    natural = parameters.scale * np.where(np.array(parameters.kind_of) == "cubic", parameters.cubic_std, 1.0)
    friction, kinds = np.array(parameters.kind_of) == "friction", np.array(parameters.kind_of)
    may_vanish = (parameters.nominal_values() == 0) | np.isin(kinds, ("cubic", "location"))
    size = np.maximum(np.abs(parameters.values(internal)), np.where(may_vanish, natural, 1e-300))
    return np.asarray(np.abs(parameters.slopes(internal)) / np.where(friction, 1.0, size))


def expected_cost(problem: Problem, modelled: ComplexArray) -> FloatArray:
    """Cost (n_conf,) that the measured response's covariance alone gives around the modelled response."""
    kind = problem.residual_kind
    variance = 0.5 * kind.parts * problem.frf.element_variance() / np.abs(kind.divisor(modelled)) ** 2
    # Of the residual log(G_hat / G) the variance is that of G over |G|^2; of magnitudes alone, half of it.
    counted = np.multiply(problem.weight, variance, out=np.zeros_like(variance), where=problem.weight > 0)
    return np.asarray(counted.sum(axis=(1, 2, 3)))


def misfit(problem: Problem, modelled: ComplexArray, cost: float) -> float:
    """Cost over what the response's covariance and the assumed model error give together; 0 without either."""
    kind = problem.residual_kind
    assumed = 0.5 * kind.parts * problem.model_error**2 * np.abs(kind.per_relative(modelled)) ** 2
    total = float(expected_cost(problem, modelled).sum() + (problem.weight * assumed).sum())
    return cost / total if total > 0 else 0.0


def distinct_minima(costs: FloatArray) -> IntArray:
    """Numbers the minima by cost, 0 the best; costs within 0.1 % are one minimum."""
    labels = np.zeros(costs.size, int)
    order = np.argsort(costs)
    reference, label = costs[order[0]], 0
    for index in order:
        if costs[index] > reference * (1 + _SAME_MINIMUM) + 1e-12:
            reference, label = costs[index], label + 1
        labels[index] = label
    return labels


def _excited(problem: Problem) -> int:
    """Number of elements that their lines tell of; a line that was not excited says nothing of its noise."""
    return int(np.isfinite(problem.frf.element_variance()).sum())


def _advice(problem: Problem, best: Minimum, dropped: int, excess: float, error: ModelError | None) -> str:
    parameters = problem.parameters
    advice = []
    if best.status != "converged":
        advice.append("raise `max_iterations`, add starts, or fix the parameters with the largest deviations")
    factor = np.exp(best.parameters * parameters.logarithmic)
    needless = [
        name
        for name, kind, ratio in zip(parameters.names, parameters.kind_of, factor, strict=True)
        if kind == "stiffness" and ratio > _NEEDLESS_FACTOR
    ]
    if needless:
        advice.append(f"springs that ran to infinity are not needed: {', '.join(needless)}")
    bound = parameters.at_bound(best.parameters)
    if bound:
        advice.append(f"parameters ended at a bound, where their intervals do not hold: {', '.join(bound)}")
    dropped_share = dropped / _excited(problem)
    if dropped_share > _MANY_DROPPED:
        advice.append(f"{100 * dropped_share:.0f} % of the response lies below 10 dB: excite more, or average more")
    if excess > _POOR_MODEL:
        few = len(group_clusters(problem.frf.configurations)) < FEWEST_CLUSTERS
        held_of_it = (
            "it as if it were noise"
            if few
            else "only what clusters of configurations differ by, and the nuisance parameters"
        )
        advice.append(
            f"the residual is {np.sqrt(excess):.1f} times what noise and assumed model error give: the model lacks "
            f"something, and intervals hold {held_of_it}"
        )
    level = 0.0 if error is None or error.share_above <= _MANY_ABOVE else float(np.median(error.level[error.level > 0]))
    if error is not None and level > float(np.median(problem.model_error)):
        advice.append(
            f"{100 * error.share_above:.0f} % of the response's elements miss the model by more than their covariance "
            f"explains, by {100 * level:.2g} % in the median: the intervals of weights `inflated` allow for it"
        )
    return "; ".join(advice)
