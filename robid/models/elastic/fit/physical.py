"""What places agree on, and the parameters themselves, once what the robot file may have wrong is estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.clusters.evidence import Evidence, group_places, summarise
from robid.clusters.pooling import Pooled, estimate_between, pool
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.joint import Joint, descend
from robid.models.elastic.fit.nuisance.named import Basis, Listed, Named, list_at_rest, name_doubts
from robid.models.elastic.fit.nuisance.placed import (
    SettledSprings,
    UnexcludedSpring,
    leave_room,
    settle_springs,
    unexcluded_springs,
)
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.solution import LONGEST_STEP, NamedDoubts, Spread
from robid.models.elastic.fit.uncertainty import Influence, influence, load_doubt, score_covariance

_STEPS = 10
_ARRIVED = 1e-2  # of a deviation


@dataclass(frozen=True)
class Settled:
    """What places agree on.

    Attributes:
        values (n_param,): Internal parameters, each place weighed by what noise and differences between places leave of
            its information.
        amounts (n_doubt,): Amounts of the doubts.
        pooled: How far both may be off, parameters first.
    """

    values: FloatArray
    amounts: FloatArray
    pooled: Pooled


def place_evidence(
    problem: Problem, internal: FloatArray, covariance: FloatArray, doubts: Named | None = None
) -> Evidence:
    """What each place says of the internal parameters and of doubts, around a point.

    Args:
        problem: The problem with its weights.
        internal (n_param,): The point.
        covariance (n_conf, n_param + n_doubt, n_param + n_doubt): Covariance of the scores there by what is known of
            the errors. That of another point does not do: along what places hardly see, it would differ most.
        doubts: Further columns; none when not given.

    Source:
        docs/methods, sec. 11.
    """
    error, derivative = problem.linear(internal)
    variance, middle = problem.parameters.prior_std**2, internal
    if doubts is not None:
        error, derivative = doubts.error, np.concatenate([derivative, doubts.columns], axis=-1)
        variance = np.concatenate([variance, doubts.common_std**2])
        middle = np.concatenate([internal, doubts.amounts])
    # Information and score of each configuration, summed over those of a place, whose parameters are the same. What is
    # known beforehand is one more observation, which lies at zero.
    n_conf, n_param = len(error), derivative.shape[-1]
    adjoint = problem.fully_weighted(derivative).reshape(n_conf, -1, n_param).conj().swapaxes(1, 2)
    bread = 2 * np.real(adjoint @ derivative.reshape(n_conf, -1, n_param))
    score = 2 * np.real(adjoint @ error.reshape(n_conf, -1, 1))[..., 0]
    places = group_places(problem.frf.configurations)
    each, pulls, meat = (
        np.array([values[place].sum(axis=0) for place in places]) for values in (bread, score, covariance)
    )
    return summarise(each, pulls, meat, np.diag(1 / variance), -middle / variance)


def settle(problem: Problem, internal: FloatArray, found: Influence, doubts: Named | None = None) -> Settled:
    """Weighs places by what noise and their differences leave of their information, from the minimum of a fit on.

    Without doubts, that is what predicts other places. With them, places also say what the robot file has wrong, as far
    as their data and what is known of it beforehand tell; that takes a single step, for elsewhere the parameters' own
    derivatives would no longer be those that the doubts go with.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        doubts: Further columns, linearised there; none when not given.
    """
    parameters, size = problem.parameters, internal.size
    given, least = np.full(size, np.nan), None
    if doubts is not None:
        found = _with_doubts(problem, internal, found, doubts)
        given = np.concatenate([given, doubts.place_std**2])
        least = doubts.least_shift
    best, now = np.inf, internal
    for step in range(_STEPS if doubts is None else 1):
        here = influence(problem, now) if step else found
        # Variances between places by restricted likelihood, then the step to where the places agree with these: each
        # weighed by (I^-1 + T)^-1 (docs/methods, sec. 11).
        evidence = place_evidence(problem, now, score_covariance(problem, here), doubts)
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
    assumed[:size, :size] += load_doubt(problem, internal, found.inverse, found.weighted[..., :size])
    amounts = np.zeros(0) if doubts is None else doubts.amounts + pooled.shift[size:]
    return Settled(now, amounts, replace(pooled, assumed=assumed))


def weigh_few(named: Named, found: Influence, excess: float) -> Settled:
    """Weighs places too few to see what they differ by: a single step, each with its noise and its part of the doubts.

    Args:
        named: The problem and its doubts, linearised at the minimum.
        found: The estimator linearised there.
        excess: By how much the misfit widens the covariance of noise and assumed errors; at least 1.
    """
    problem, internal, size = named.problem, named.point, named.point.size
    covariance = excess * score_covariance(problem, _with_doubts(problem, internal, found, named))
    between = np.concatenate([np.zeros(size), named.place_std**2])
    pooled = pool(place_evidence(problem, internal, covariance, named), between, named.least_shift)
    step = np.clip(pooled.shift[:size], -LONGEST_STEP, LONGEST_STEP)
    values = np.clip(internal + step, problem.parameters.lower, problem.parameters.upper)
    assumed = pooled.assumed.copy()
    assumed[:size, :size] += excess * load_doubt(problem, internal, found.inverse, found.weighted)
    return Settled(values, named.amounts + pooled.shift[size:], replace(pooled, assumed=assumed))


def _with_doubts(problem: Problem, internal: FloatArray, found: Influence, doubts: Named) -> Influence:
    """What errors pull at doubts too."""
    weighted = problem.fully_weighted(doubts.columns)
    gain = weighted / problem.residual_kind.divisor(problem.measured(internal)).conj()[..., None]
    return replace(
        found,
        gain=np.concatenate([found.gain, gain], axis=-1),
        weighted=np.concatenate([found.weighted, weighted], axis=-1),
    )


_ITERATIONS = 60
_NEAR = 1.5  # of an internal logarithm: nothing leads back to the file's values from far beyond


def shrink(problem: Problem, internal: FloatArray, found: Influence, near: Settled) -> Settled:
    """Settles places once more from where what is known beforehand counts for more.

    A model that lacks something is contradicted by the places far more than noise would make them; then a plain
    minimum lets what the data hardly tell run off for next to nothing, and the other parameters follow it. Here, the
    data count as much less as the places' differences raise the variance of a typical parameter over that by noise.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        near: What places agree on, from there on.

    Source:
        Power likelihood of a misspecified model, as in Holmes and Walker (2017), with the weight by the places.
    """
    # Half the inverse of half the Hessian is the covariance by noise. A prior that is narrower by sqrt(times) is the
    # same as data that count as much less.
    noise = 0.5 * np.diag(found.inverse)
    times = max(1.0, float(np.median(np.diag(near.pooled.assumed)[: noise.size] / noise)))
    known = replace(problem.parameters, prior_std=problem.parameters.prior_std / np.sqrt(times))
    start = np.where(known.logarithmic, np.clip(internal, -_NEAR, _NEAR), internal)
    there = optimise(replace(problem, parameters=known), start, max_iterations=_ITERATIONS).parameters
    return settle(problem, there, influence(problem, there))


_PERCENT = 100.0
_EXPLAINED = 0.5  # of the cost, where what fits best does not rest


_BEYOND = 1.5  # times what was known of doubts beforehand: of many, chance makes a tenth of it


def find_physical(
    problem: Problem, points: Sequence[FloatArray], basis: Basis, confidence: float
) -> tuple[Spread, NamedDoubts] | None:
    """Estimates parameters and doubts together, from what is known of the doubts beforehand on.

    Springs that the file lacks are put in place where the data call for them: to first order nothing can be said of a
    spring as soft as a gear. Where the robot does not rest with what fits best, only springs that explain that count.

    Args:
        problem: The fit's problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest. The
            last is the minimum.
        basis: What the fit started from, for what the robot file may have wrong.
        confidence: Level of the intervals.

    Returns:
        How far the parameters (n_param,) may be off, and what is said of the doubts, springs that were put in place
        first; None where there are no doubts, or the robot rests nowhere with what is found.
    """
    problem, basis = _allowing_for_error(problem, points[-1], basis)
    near = points if basis.rested else (np.zeros_like(points[-1]),)
    listed = list_at_rest(problem, near, basis)
    if listed is None:
        return None
    left = problem.cost(points[-1])
    alone = _descended(listed, basis, left)
    if alone is not None and alone.explains and not alone.lacks_springs:
        return _estimated(problem, alone.named, (), (), confidence)
    named = name_doubts(problem, near, basis)
    if named is None:
        return None
    found = settle_springs(problem, named.point, basis.robot, basis.options, named.doubts, named.columns)
    extended = _extended(found, basis) if found.springs else None
    if extended is None:
        named = named if alone is None else alone.named
        return _estimated(problem, named, (), (), confidence) if basis.rested else None
    if not basis.rested and found.cost > _EXPLAINED * left:
        return None
    return _with_springs(problem, found, extended, basis, confidence)


def _with_springs(
    problem: Problem, found: SettledSprings, extended: Named, basis: Basis, confidence: float
) -> tuple[Spread, NamedDoubts]:
    """The parameters of a robot with springs put in place, others that may be there as soft as these."""
    unexcluded = unexcluded_springs(found, extended)
    soft = _as_soft(extended, unexcluded)
    given = replace(basis, robot=found.robot, options=found.options)
    together = _descended(soft, given, found.cost, found.springs)
    return _estimated(problem, soft if together is None else together.named, found.springs, unexcluded, confidence)


def _allowing_for_error(problem: Problem, internal: FloatArray, basis: Basis) -> tuple[Problem, Basis]:
    """The problem with weights that allow for an error of the model, whatever those of the fit.

    Weights without one let the data outweigh all that is known beforehand: what no doubt names then takes masses and
    torque constants far off, and with them all springs by a factor that no response tells.
    """
    weights = basis.options.weights
    if weights.kind in ("inflated", "estimated") or (weights.kind == "user" and weights.off_diagonal == 0):
        return problem, basis
    options = replace(basis.options, weights=replace(weights, kind="inflated"))
    allowing, _ = make_problem(problem.frf, problem.model, problem.parameters, options, internal)
    return allowing, replace(basis, options=options)


def _estimated(
    problem: Problem, named: Named, springs: Sequence[str], unexcluded: Sequence[UnexcludedSpring], confidence: float
) -> tuple[Spread, NamedDoubts]:
    """The problem's own parameters among those of a robot with springs put in place, and others that may be there."""
    found = influence(named.problem, named.point)
    far = settle(named.problem, named.point, found, named)
    # Doubts that come out farther off than stated show that what is known of them was taken for too sure: all are
    # given as much more room, and the places are weighed once more.
    further = _how_much_further(named, far)
    if further > 1:
        far = settle(named.problem, named.point, found, _less_sure(named, further))
    told = Spread(np.concatenate([far.values, far.amounts]), *far.pooled.spread(confidence))
    rows = {doubt.name: far.values.size + number for number, doubt in enumerate(named.doubts)}
    for spring in unexcluded:
        told = leave_room(told, spring, rows[spring.name])
    doubts = _estimates(named, told, springs, confidence)
    names = named.problem.parameters.names
    own = np.array([names.index(name) for name in problem.parameters.names])
    beyond = f", which are {further:.1f} times as far off as stated" if further > _BEYOND else ""
    errors = assumed_errors(model_error=bool(problem.model_error.any()))
    rule = f"{errors}, what {len(named.places)} places differ by, and {told_doubts(named, len(springs))}{beyond}"
    return Spread(told.values[own], told.covariance[np.ix_(own, own)], told.degrees_of_freedom[own], rule), doubts


def assumed_errors(*, model_error: bool) -> str:
    """Names the errors that a covariance holds."""
    return "noise and assumed model error" if model_error else "noise"


def told_doubts(named: Named, more: int = 0) -> str:
    """Says how many doubts widen an interval, with some more than those that were named."""
    source = "what the rigid fit leaves open among " if named.rigid else ""
    return f"{source}{len(named.doubts) + more} doubts of the robot file"


def _descended(listed: Listed, given: Basis, left: float, placed: Sequence[str] = ()) -> Joint | None:
    """Where parameters and doubts fit best together.

    None where no robot rests, a rigid fit knows the masses, or doubts explain little of what is left.
    """
    try:
        joint = None if listed.rigid else descend(listed, given, placed)
    except DataError:
        return None
    return joint if joint is not None and (joint.explains or joint.cost <= _EXPLAINED * left) else None


def _how_much_further(named: Named, far: Settled) -> float:
    """How many times as far off as known beforehand the doubts are that the data tell; at least as far.

    Where all is as the file says it may be, it is 1 as far as the doubts are many. Where something is off that nobody
    named, doubts stand for it that are right, and nothing is known so well.
    """
    # What the data tell of an amount is 1 - posterior over prior variance; these sum to the effective number of amounts
    # that were estimated, each of which should have a square of about its prior variance.
    known = named.common_std**2
    told = np.maximum(1 - np.diag(far.pooled.assumed)[named.point.size :] / known, 0.0).sum()
    return float(np.sqrt(max(1.0, (far.amounts**2 / known).sum() / told))) if told >= 1 else 1.0


def _less_sure(named: Named, times: float) -> Named:
    doubts = (
        replace(each, common_std=times * each.common_std, place_std=times * each.place_std) for each in named.doubts
    )
    return replace(named, doubts=tuple(doubts))


def _as_soft(named: Named, unexcluded: Sequence[UnexcludedSpring]) -> Named:
    """The doubts, those of springs that others can stand for as large as they may be."""
    known = {spring.name: spring.std for spring in unexcluded}
    doubts = (replace(each, common_std=known.get(each.name, each.common_std)) for each in named.doubts)
    return replace(named, doubts=tuple(doubts))


def _extended(found: SettledSprings, basis: Basis) -> Named | None:
    """The doubts of the robot with springs put in place, linearised where places agree on it."""
    extra = found.robot.springs[len(basis.robot.springs) :]
    doubtful = [
        replace(other, robot=replace(other.robot, springs=(*other.robot.springs, *extra))) for other in basis.doubtful
    ]
    near = settle(found.problem, found.internal, influence(found.problem, found.internal))
    points = near.values, found.internal
    return name_doubts(found.problem, points, Basis(found.robot, found.options, doubtful))


def _estimates(named: Named, told: Spread, springs: Sequence[str], confidence: float) -> NamedDoubts:
    """What is said of the doubts; of springs put in place their compliance over that of their gear, in percent."""
    reach, size, names = told.reach(confidence), named.point.size, named.problem.parameters.names
    found = named.estimated(told.values[size:], reach[size:])
    placed, count = np.array([names.index(f"{spring}.stiffness") for spring in springs], int), len(springs)
    value, half = told.values[placed], reach[placed]
    # A logarithm of stiffness is one of compliance the other way around: its interval's ends are turned into percent.
    lower, upper = (_PERCENT * np.exp(-value + side * half) for side in (-1, 1))
    return NamedDoubts(
        names=(*(f"{spring}.compliance" for spring in springs), *found.names),
        causes=("missing_spring",) * count + found.causes,
        units=("% of its gear's compliance",) * count + found.units,
        prior_std=np.concatenate([np.full(count, np.inf), found.prior_std]),
        place_std=np.concatenate([np.zeros(count), found.place_std]),
        value=np.concatenate([_PERCENT * np.exp(-value), found.value]),
        half_width=np.concatenate([0.5 * (upper - lower), found.half_width]),
    )
