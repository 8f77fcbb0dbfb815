"""What clusters agree on, and the parameters themselves, once what the robot file may have wrong is estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.clusters.evidence import Evidence, group_clusters, summarise
from robid.clusters.pooling import Pooled, estimate_between, pool
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.joint import Joint, descend
from robid.models.elastic.fit.nuisance.linear import Basis, LinearNuisances, NuisanceSet, list_at_rest, list_linearised
from robid.models.elastic.fit.nuisance.missing_springs import (
    AddedSprings,
    UnexcludedSpring,
    add_missing_springs,
    leave_room,
    unexcluded_springs,
)
from robid.models.elastic.fit.nuisance.shares import following_rotors
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.solution import LONGEST_STEP, NuisanceEstimates, Spread
from robid.models.elastic.fit.uncertainty import Influence, cubic_covariance, influence, score_covariance

_STEPS = 10
_ARRIVED = 1e-2  # of a deviation


@dataclass(frozen=True)
class ClusterEstimate:
    """What clusters agree on."""

    # (n_param,) Internal parameters, each cluster weighed by what noise and differences between them leave of its
    # information
    values: FloatArray
    amounts: FloatArray  # (n_nuisance,) Amounts of the nuisances
    pooled: Pooled  # How far both may be off, parameters first


def cluster_evidence(
    problem: Problem, internal: FloatArray, covariance: FloatArray, nuisances: LinearNuisances | None = None
) -> Evidence:
    """What each cluster says of the internal parameters and of nuisances, around a point.

    Args:
        problem: The problem with its weights.
        internal (n_param,): The point.
        covariance (n_conf, n_param + n_nuisance, n_param + n_nuisance): Covariance of the scores there by what is
            known of the errors. That of another point does not do: along what clusters hardly see it differs most.
        nuisances: Further columns; none when not given.

    Source:
        docs/methods, sec. 11.
    """
    error, derivative = problem.linear(internal)
    variance, middle = problem.parameters.prior_std**2, internal
    if nuisances is not None:
        error, names = nuisances.error, problem.parameters.names
        derivative = following_rotors(derivative, names, nuisances.nuisances, nuisances.columns, nuisances.each)
        derivative = np.concatenate([derivative, nuisances.columns], axis=-1)
        variance = np.concatenate([variance, nuisances.common_std**2])
        middle = np.concatenate([internal, nuisances.amounts])
    # Information and score of each configuration, summed over a cluster, whose parameters are the same. What is
    # known beforehand is one more observation, which lies at zero.
    n_conf, n_param = len(error), derivative.shape[-1]
    adjoint = problem.fully_weighted(derivative).reshape(n_conf, -1, n_param).conj().swapaxes(1, 2)
    bread = 2 * np.real(adjoint @ derivative.reshape(n_conf, -1, n_param))
    score = 2 * np.real(adjoint @ error.reshape(n_conf, -1, 1))[..., 0]
    clusters = group_clusters(problem.frf.configurations)
    each, pulls, meat = (
        np.array([values[cluster].sum(axis=0) for cluster in clusters]) for values in (bread, score, covariance)
    )
    return summarise(each, pulls, meat, np.diag(1 / variance), -middle / variance)


def weigh_clusters(
    problem: Problem, internal: FloatArray, found: Influence, nuisances: LinearNuisances | None = None
) -> ClusterEstimate:
    """Weighs clusters by what noise and their differences leave of their information, from the minimum of a fit on.

    Without nuisances, that is what predicts other clusters. With them, they also say what is wrong in the robot file;
    that takes a single step: elsewhere the parameters' derivatives would not be those that the nuisances go with.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        nuisances: Further columns, linearised there; none when not given.
    """
    parameters, size = problem.parameters, internal.size
    given, least = np.full(size, np.nan), None
    if nuisances is not None:
        found = _with_nuisances(problem, internal, found, nuisances)
        given = np.concatenate([given, nuisances.cluster_std**2])
        least = nuisances.least_shift
    best, now = np.inf, internal
    for step in range(_STEPS if nuisances is None else 1):
        here = influence(problem, now) if step else found
        # Variances between clusters by restricted likelihood, then the step to where they agree with these: each
        # weighed by (I^-1 + T)^-1 (docs/methods, sec. 11).
        evidence = cluster_evidence(problem, now, score_covariance(problem, here), nuisances)
        there = pool(evidence, estimate_between(evidence, given).variance, least)
        std = np.sqrt(np.maximum(np.diag(there.covariance), np.diag(there.assumed))[:size])
        known = std <= LONGEST_STEP
        shift = np.abs(known * there.shift[:size])
        if shift.max() >= best:
            break  # where nothing is linear, steps lead nowhere: the last one that was shorter counts
        moved = now + known * np.clip(there.shift[:size], -LONGEST_STEP, LONGEST_STEP)
        best, pooled, now = shift.max(), there, np.clip(moved, parameters.lower, parameters.upper)
        if (shift <= _ARRIVED * std).all():
            break
    assumed = pooled.assumed.copy()
    assumed[:size, :size] += cubic_covariance(problem, internal, found.inverse, found.weighted[..., :size])
    amounts = np.zeros(0) if nuisances is None else nuisances.amounts + pooled.shift[size:]
    return ClusterEstimate(now, amounts, replace(pooled, assumed=assumed))


def weigh_few(linear: LinearNuisances, found: Influence, excess: float) -> ClusterEstimate:
    """Weighs clusters too few to see what they differ by: a single step, each with its noise and its nuisances.

    Args:
        linear: The problem and its nuisances, linearised at the minimum.
        found: The estimator linearised there.
        excess: By how much the misfit widens the covariance of noise and assumed errors; at least 1.
    """
    problem, internal, size = linear.problem, linear.point, linear.point.size
    covariance = excess * score_covariance(problem, _with_nuisances(problem, internal, found, linear))
    between = np.concatenate([np.zeros(size), linear.cluster_std**2])
    pooled = pool(cluster_evidence(problem, internal, covariance, linear), between, linear.least_shift)
    step = np.clip(pooled.shift[:size], -LONGEST_STEP, LONGEST_STEP)
    values = np.clip(internal + step, problem.parameters.lower, problem.parameters.upper)
    assumed = pooled.assumed.copy()
    assumed[:size, :size] += excess * cubic_covariance(problem, internal, found.inverse, found.weighted)
    return ClusterEstimate(values, linear.amounts + pooled.shift[size:], replace(pooled, assumed=assumed))


def _with_nuisances(problem: Problem, internal: FloatArray, found: Influence, nuisances: LinearNuisances) -> Influence:
    """What errors pull at nuisances too."""
    weighted = problem.fully_weighted(nuisances.columns)
    gain = weighted / problem.residual_kind.divisor(problem.measured(internal)).conj()[..., None]
    return replace(
        found,
        gain=np.concatenate([found.gain, gain], axis=-1),
        weighted=np.concatenate([found.weighted, weighted], axis=-1),
    )


_ITERATIONS = 60
_NEAR = 1.5  # of an internal logarithm: nothing leads back to the file's values from far beyond


def shrink(problem: Problem, internal: FloatArray, found: Influence, near: ClusterEstimate) -> ClusterEstimate:
    """Weighs clusters once more from where what is known beforehand counts for more.

    A model that lacks something is contradicted by the clusters far more than noise would make them; then a plain
    minimum lets what the data hardly determine run off for next to nothing, and the other parameters follow. Here, the
    data count as much less as the clusters' differences raise the variance of a typical parameter over that by noise.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        near: What clusters agree on, from there on.

    Source:
        Power likelihood of a misspecified model, as in Holmes and Walker (2017), with the weight by the clusters.
    """
    # Half the inverse of half the Hessian is the covariance by noise. A prior that is narrower by sqrt(times) is the
    # same as data that count as much less.
    noise = 0.5 * np.diag(found.inverse)
    times = max(1.0, float(np.median(np.diag(near.pooled.assumed)[: noise.size] / noise)))
    known = replace(problem.parameters, prior_std=problem.parameters.prior_std / np.sqrt(times))
    start = np.where(known.logarithmic, np.clip(internal, -_NEAR, _NEAR), internal)
    there = optimise(replace(problem, parameters=known), start, max_iterations=_ITERATIONS).parameters
    return weigh_clusters(problem, there, influence(problem, there))


_PERCENT = 100.0
_EXPLAINED = 0.5  # of the cost, where what fits best does not rest


_BEYOND = 1.5  # times what was known of nuisances beforehand: of many, chance makes a tenth of it


def find_physical(
    problem: Problem, points: Sequence[FloatArray], basis: Basis, confidence: float
) -> tuple[Spread, NuisanceEstimates] | None:
    """Estimates parameters and nuisances together, from what is known of the nuisances beforehand on.

    Springs that the file lacks are put in place where the data call for them: to first order nothing can be said of a
    spring as soft as a gear. Where the robot does not rest with what fits best, only springs that explain that count.

    Args:
        problem: The fit's problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest. The
            last is the minimum.
        basis: What the fit started from, for what the robot file may have wrong.
        confidence: Level of the intervals.

    Returns:
        How far the parameters (n_param,) may be off, and what is said of the nuisances, springs that were put in place
        first; None where there are no nuisances, or the robot rests nowhere with what is found.
    """
    problem, basis = _allowing_for_error(problem, points[-1], basis)
    near = points if basis.rested else (np.zeros_like(points[-1]),)
    at_rest = list_at_rest(problem, near, basis)
    if at_rest is None:
        return None
    left = problem.cost(points[-1])
    alone = _descended(at_rest, basis, left)
    if alone is not None and alone.explains and not alone.lacks_springs:
        return _estimated(problem, alone.linear, (), (), confidence)
    linear = list_linearised(problem, near, basis)
    if linear is None:
        return None
    found = add_missing_springs(problem, linear.point, basis.robot, basis.options, linear.nuisances, linear.columns)
    extended = _extended(found, basis) if found.springs else None
    if extended is None:
        linear = linear if alone is None else alone.linear
        return _estimated(problem, linear, (), (), confidence) if basis.rested else None
    if not basis.rested and found.cost > _EXPLAINED * left:
        return None
    return _with_springs(problem, found, extended, basis, confidence)


def _with_springs(
    problem: Problem, found: AddedSprings, extended: LinearNuisances, basis: Basis, confidence: float
) -> tuple[Spread, NuisanceEstimates]:
    """The parameters of a robot with springs put in place, others that may be there as soft as these."""
    unexcluded = unexcluded_springs(found, extended)
    soft = _as_soft(extended, unexcluded)
    given = replace(basis, robot=found.robot, options=found.options)
    together = _descended(soft, given, found.cost, found.springs)
    return _estimated(problem, soft if together is None else together.linear, found.springs, unexcluded, confidence)


def _allowing_for_error(problem: Problem, internal: FloatArray, basis: Basis) -> tuple[Problem, Basis]:
    """The problem with weights that allow for an error of the model, whatever those of the fit.

    Weights without one let the data outweigh all that is known beforehand: what no nuisance names then takes masses and
    torque constants far off, and with them all springs by a factor that no response determines.
    """
    weights = basis.options.weights
    if weights.kind in ("inflated", "estimated") or (weights.kind == "user" and weights.off_diagonal == 0):
        return problem, basis
    options = replace(basis.options, weights=replace(weights, kind="inflated"))
    allowing, _ = make_problem(problem.frf, problem.model, problem.parameters, options, internal)
    return allowing, replace(basis, options=options)


def _estimated(
    problem: Problem,
    linear: LinearNuisances,
    springs: Sequence[str],
    unexcluded: Sequence[UnexcludedSpring],
    confidence: float,
) -> tuple[Spread, NuisanceEstimates]:
    """The problem's own parameters among those of a robot with springs put in place, and others that may be there."""
    found = influence(linear.problem, linear.point)
    far = weigh_clusters(linear.problem, linear.point, found, linear)
    # Nuisances that come out farther off than stated show that what is known of them was taken for too sure: all are
    # given as much more room, and the clusters are weighed once more.
    further = _how_much_further(linear, far)
    if further > 1:
        far = weigh_clusters(linear.problem, linear.point, found, _less_sure(linear, further))
    together = Spread(np.concatenate([far.values, far.amounts]), *far.pooled.spread(confidence))
    rows = {nuisance.name: far.values.size + number for number, nuisance in enumerate(linear.nuisances)}
    for spring in unexcluded:
        together = leave_room(together, spring, rows[spring.name])
    names = linear.problem.parameters.names
    own = np.array([names.index(name) for name in problem.parameters.names])
    nuisances = _estimates(linear, together, springs, own, confidence)
    beyond = f", which are {further:.1f} times as far off as stated" if further > _BEYOND else ""
    errors = assumed_errors(model_error=bool(problem.model_error.any()))
    differing = f"what {len(linear.clusters)} clusters of configurations differ by"
    rule = f"{errors}, {differing}, and {count_nuisances(linear, len(springs))}{beyond}"
    return Spread(
        together.values[own], together.covariance[np.ix_(own, own)], together.degrees_of_freedom[own], rule
    ), nuisances


def assumed_errors(*, model_error: bool) -> str:
    """Names the errors that a covariance holds."""
    return "noise and assumed model error" if model_error else "noise"


def count_nuisances(linear: LinearNuisances, more: int = 0) -> str:
    """Says how many nuisances widen an interval, with some more than those given."""
    source = "what the rigid fit leaves open among " if linear.rigid else ""
    return f"{source}{len(linear.nuisances) + more} nuisance parameters of the robot file"


def _descended(start: NuisanceSet, given: Basis, left: float, placed: Sequence[str] = ()) -> Joint | None:
    """Where parameters and nuisances fit best together.

    None where no robot rests, a rigid fit knows the masses, or nuisances explain little of what is left.
    """
    try:
        joint = None if start.rigid else descend(start, given, placed)
    except DataError:
        return None
    return joint if joint is not None and (joint.explains or joint.cost <= _EXPLAINED * left) else None


def _how_much_further(linear: LinearNuisances, far: ClusterEstimate) -> float:
    """How many times as far off as known beforehand the nuisances are that the data determine; at least as far.

    Where all is as the file says it may be, it is 1 as far as nuisances are many. Where something is off that nobody
    named, nuisances stand for it that are right, and nothing is known so well.
    """
    # What the data say of an amount is 1 - posterior over prior variance; these sum to the effective number of amounts
    # that were estimated, each of which should have a square of about its prior variance.
    known = linear.common_std**2
    determined = np.maximum(1 - np.diag(far.pooled.assumed)[linear.point.size :] / known, 0.0).sum()
    return float(np.sqrt(max(1.0, (far.amounts**2 / known).sum() / determined))) if determined >= 1 else 1.0


def _less_sure(linear: LinearNuisances, times: float) -> LinearNuisances:
    nuisances = (
        replace(each, common_std=times * each.common_std, cluster_std=times * each.cluster_std)
        for each in linear.nuisances
    )
    return replace(linear, nuisances=tuple(nuisances))


def _as_soft(linear: LinearNuisances, unexcluded: Sequence[UnexcludedSpring]) -> LinearNuisances:
    """The nuisances, those of springs that others can stand for as large as they may be."""
    known = {spring.name: spring.std for spring in unexcluded}
    nuisances = (replace(each, common_std=known.get(each.name, each.common_std)) for each in linear.nuisances)
    return replace(linear, nuisances=tuple(nuisances))


def _extended(found: AddedSprings, basis: Basis) -> LinearNuisances | None:
    """The nuisances of the robot with springs put in place, linearised where clusters agree on it."""
    extra = found.robot.springs[len(basis.robot.springs) :]
    perturbed = [
        replace(other, robot=replace(other.robot, springs=(*other.robot.springs, *extra))) for other in basis.perturbed
    ]
    near = weigh_clusters(found.problem, found.internal, influence(found.problem, found.internal))
    points = near.values, found.internal
    return list_linearised(found.problem, points, Basis(found.robot, found.options, perturbed))


def _estimates(
    linear: LinearNuisances, together: Spread, springs: Sequence[str], own: IntArray, confidence: float
) -> NuisanceEstimates:
    """What is said of the nuisances; of springs put in place their compliance over that of their gear, in percent.

    What they move are the problem's `own` (n_param,) parameters; what springs put in place move is not linear.
    """
    reach, size, names = together.reach(confidence), linear.point.size, linear.problem.parameters.names
    found = linear.estimated(together.values[size:], reach[size:], together.covariance)
    placed, count = np.array([names.index(f"{spring}.stiffness") for spring in springs], int), len(springs)
    value, half = together.values[placed], reach[placed]
    # A logarithm of stiffness is one of compliance the other way around: its interval's ends are turned into percent.
    lower, upper = (_PERCENT * np.exp(-value + side * half) for side in (-1, 1))
    return NuisanceEstimates(
        names=(*(f"{spring}.compliance" for spring in springs), *found.names),
        causes=("missing_spring",) * count + found.causes,
        units=("% of its gear's compliance",) * count + found.units,
        prior_std=np.concatenate([np.full(count, np.inf), found.prior_std]),
        place_std=np.concatenate([np.zeros(count), found.place_std]),
        value=np.concatenate([_PERCENT * np.exp(-value), found.value]),
        half_width=np.concatenate([0.5 * (upper - lower), found.half_width]),
        moves=np.hstack([np.zeros((len(own), count)), np.asarray(found.moves)[own]]),
    )
