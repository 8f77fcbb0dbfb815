"""Springs that a robot file lacks: those that the data call for are put in place, others need not be excluded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_clusters
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.effects import Compliance, Nuisance
from robid.models.elastic.fit.nuisance.linear import LinearNuisances
from robid.models.elastic.fit.nuisance.moves import stiffened
from robid.models.elastic.fit.nuisance.off_robot import (
    carry_over,
    extend_options,
    extend_problem,
    fix_options,
    freeze_friction,
    problem_at,
)
from robid.models.elastic.fit.optimizers import make_strategy, optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import Spread
from robid.robot.description import Robot, Spring

_MOST = 6
_TELLING = 0.1  # of the cost that other nuisances leave
_AGREEING = 0.75  # of the clusters
_RIGID = 20.0  # times the gear: as good as not there
_SHARED = 2.0  # times a gear that stood for two springs in series
_RAN_AWAY = 1.0  # of an internal parameter: further than a file is off
_FIRST_STEPS, _STEPS, _KEPT, _LAST_STEPS = 8, 25, 4, 5
_HALF_MEAN, _HALF_VARIANCE = np.sqrt(2 / np.pi), 1 - 2 / np.pi  # of half a normal distribution
_PERCENT = 100.0
_EXCLUDED = 1.05  # of the cost: half of what calls for a spring


@dataclass(frozen=True)
class AddedSprings:
    """A fit's problem with the springs in place that its data call for."""

    problem: Problem  # The problem; stiffness and damping of each spring are among its parameters
    internal: FloatArray  # (n_param,) Its minimum, nearly
    robot: Robot  # The robot with the springs, after its own; `list_nuisances` of it no longer lists them
    options: ElasticOptions  # Options with which they are free
    springs: tuple[str, ...] = ()  # Names of the springs

    @property
    def cost(self) -> float:
        """Cost at the minimum."""
        return self.problem.cost(self.internal)


def add_missing_springs(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    nuisances: Sequence[Nuisance],
    columns: ComplexArray,
) -> AddedSprings:
    """Puts springs in place whose lack leaves more than noise and model error; the others stay nuisances.

    A column says nothing of a spring as soft as a gear, so each is tried, and each pair of a joint: put in place and
    fitted along for some steps. What leaves least, after all other nuisances have followed, stays where that saves a
    telling share of the cost in most clusters; then the next.

    Args:
        problem: The fit's problem.
        internal (n_param,): Its minimum.
        robot: The robot that the nuisances were listed for.
        options: Options of the fit.
        nuisances: All nuisances.
        columns (n_conf, n_freq, n_out, n_in, n_nuisance): What `nuisance_columns` found for them there.

    Returns:
        The problem at its new minimum; the same as before where no spring is called for.
    """
    missing = np.array([isinstance(nuisance.effect, Compliance) for nuisance in nuisances], bool)
    beside = columns[..., ~missing], np.array([nuisance.common_std for nuisance in nuisances])[~missing]
    springs = [nuisance.effect.spring for nuisance in nuisances if isinstance(nuisance.effect, Compliance)]
    now = before = AddedSprings(problem, internal, robot, options)
    left = springs
    cost, expected = cost_beside(now, *beside), expected_cost(problem)
    while left and len(now.springs) < _MOST and cost > expected:
        trials = [(trial, cost_beside(trial, *beside)) for trial in _best_trials(now, left)]
        called = [each for each in trials if each[1] < (1 - _TELLING) * cost and _agree(now, each[0])]
        if not called:
            break
        now = _anew(min(called, key=lambda each: each[1])[0])
        cost = cost_beside(now, *beside)
        left = [spring for spring in left if spring.name not in now.springs]
    return _rested(_pruned(before, now, springs, beside)) if now.springs else now


def _pruned(
    before: AddedSprings, found: AddedSprings, springs: Sequence[Spring], beside: tuple[ComplexArray, FloatArray]
) -> AddedSprings:
    """The fit without those springs of pairs that no longer matter since others are in place."""
    cost = cost_beside(found, *beside)
    for name in found.springs:
        rest = [spring for spring in springs if spring.name in found.springs and spring.name != name]
        fewer = _put_in_place(before, rest, found) if rest else None
        left = np.inf if fewer is None else cost_beside(fewer, *beside)
        if fewer is not None and (1 - _TELLING) * left <= cost:
            found, cost = fewer, left
    return found


def expected_cost(problem: Problem) -> float:
    """Cost of a right model whose errors are those that the weights assume."""
    return 0.5 * problem.residual_kind.parts * float((problem.weight > 0).sum())


def cost_beside(now: AddedSprings, columns: ComplexArray, std: FloatArray) -> float:
    """Returns the cost that parameters and other nuisances, with what is known of them, leave after one linear step.

    Args:
        now: The fit.
        columns (n_conf, n_freq, n_out, n_in, n_nuisance): The other nuisances' columns.
        std (n_nuisance,): Their deviations.
    """
    error, derivative = now.problem.linear(now.internal)
    every = np.concatenate([derivative, columns], axis=-1)
    rows = now.problem.rows(every).reshape(-1, every.shape[-1])
    left = now.problem.rows(error).ravel()
    # A ridge regression of what is left on all columns, scaled to a unit diagonal, since amounts and parameters differ
    # by decades.
    precision = 0.5 / np.concatenate([now.problem.parameters.prior_std, std]) ** 2
    pull = np.concatenate([precision[: now.internal.size] * now.internal, np.zeros(std.size)])
    normal, slope = rows.T @ rows + np.diag(precision), rows.T @ left - pull
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    step = np.linalg.lstsq(normal / np.outer(scale, scale), slope / scale, rcond=1e-13)[0] / scale
    return float(((left - rows @ step) ** 2).sum())


def _best_trials(now: AddedSprings, springs: Sequence[Spring]) -> list[AddedSprings]:
    """The few springs, or pairs of a joint, that fit best in place; none that is as good as rigid."""
    pairs = [pair for pair in combinations(springs, 2) if pair[0].joint == pair[1].joint]
    candidates = [*((spring,) for spring in springs), *pairs]
    begun = [trial for each in candidates if (trial := _put_in_place(now, each)) is not None]
    begun.sort(key=lambda trial: trial.cost)
    ends = [_descended(trial, _STEPS) for trial in begun[:_KEPT]]
    ends.sort(key=lambda trial: trial.cost)
    return [end for end in ends if _stiffest(end, end.springs[len(now.springs) :]) < _RIGID]


def _put_in_place(
    now: AddedSprings, springs: Sequence[Spring], near: AddedSprings | None = None
) -> AddedSprings | None:
    """The fit some steps on with further springs, from near another one; None where the robot does not rest so."""
    robot = replace(now.robot, springs=(*now.robot.springs, *springs))
    options = extend_options(now.options, robot, springs, fixing=False)
    try:
        problem = extend_problem(now.problem, now.internal, robot, options)
    except DataError:
        return None
    begin = near or now
    starts = list(_starts(problem, carry_over(problem, begin.problem, begin.internal), robot, springs))
    still, count = freeze_friction(problem, starts[0]), starts[0].size - problem.parameters.n_friction
    ends = [optimise(still, start[:count], max_iterations=_FIRST_STEPS) for start in starts]
    best = min(ends, key=lambda end: end.cost).parameters
    names = (*now.springs, *(spring.name for spring in springs))
    return AddedSprings(problem, np.concatenate([best, starts[0][count:]]), robot, options, names)


def _starts(problem: Problem, start: FloatArray, robot: Robot, springs: Sequence[Spring]) -> Iterator[FloatArray]:
    """Where springs start: stiff beside the values so far, those near the file's, or the gear that stood for both."""
    names = np.array(problem.parameters.names)
    own = np.isin(names, [f"{spring.name}.{kind}" for spring in springs for kind in ("stiffness", "damping")])
    yield start + np.log(_SHARED) * own * (start == 0)
    nearer = np.where(problem.parameters.logarithmic, np.clip(start, -_RAN_AWAY, _RAN_AWAY), start)
    if (nearer != start).any():
        yield nearer
    joints = {spring.joint for spring in springs}
    gears = [each.name for each in robot.springs if each.joint in joints and each.place == "transmission"]
    yield start + np.log(_SHARED) * np.isin(names, [f"{gear}.stiffness" for gear in gears])


def _descended(now: AddedSprings, steps: int) -> AddedSprings:
    return replace(now, internal=optimise(now.problem, now.internal, max_iterations=steps).parameters)


def _anew(now: AddedSprings) -> AddedSprings:
    """The same springs, the others fitted from the robot file's values on where that ends lower.

    What a fit without them ran away with does not come back by itself.
    """
    names = now.problem.parameters.names
    kept = np.array([name.split(".")[0] in now.springs for name in names])
    start = np.where(kept | ~now.problem.parameters.logarithmic, now.internal, 0.0)
    end = make_strategy(now.problem, now.robot, now.options).descend(start, straight_too=True)
    return replace(now, internal=end.parameters) if end.cost < now.cost else now


def _stiffest(now: AddedSprings, springs: Sequence[str]) -> float:
    """Largest stiffness of some springs over what each was listed with, its gear's."""
    at = [now.problem.parameters.names.index(f"{name}.stiffness") for name in springs]
    return float(np.exp(np.clip(now.internal[at], -50.0, 50.0)).max())


def _agree(before: AddedSprings, after: AddedSprings) -> bool:
    """Whether a spring helps in most clusters."""
    costs = [each.problem.configuration_cost(each.problem.model_response(each.internal), each.internal)
             for each in (before, after)]  # fmt: skip
    clusters = group_clusters(before.problem.frf.configurations)
    helped = [costs[1][cluster].sum() < costs[0][cluster].sum() for cluster in clusters]
    return float(np.mean(helped)) >= _AGREEING


def _rested(now: AddedSprings) -> AddedSprings:
    """The same where the robot rests with the springs found."""
    values = now.problem.parameters.parameters(now.internal)
    try:
        problem = problem_at(now.problem, values, now.robot, now.options)
    except DataError:
        return now
    return _descended(replace(now, problem=problem), _LAST_STEPS)


@dataclass(frozen=True)
class UnexcludedSpring:
    """A spring that the data neither call for nor exclude."""

    name: str  # Name of its nuisance
    std: float  # Compliance that it may well have, in percent of its gear's
    shift: FloatArray  # (n_param,) What a spring of this compliance does to the internal parameters


def unexcluded_springs(found: AddedSprings, linear: LinearNuisances) -> tuple[UnexcludedSpring, ...]:
    """Tries for each spring still missing whether it could be there, as soft as those that were put in place.

    One that others can stand for costs next to nothing, whatever its compliance: it does not save the share that a
    spring must save to be called for, and still it may be there.
    """
    placed = [found.problem.parameters.names.index(f"{spring}.stiffness") for spring in found.springs]
    # A spring's stiffness is a logarithm over its gear's: exp(-x) is its compliance over that of the gear.
    softness = _PERCENT * np.exp(-np.maximum(found.internal[placed], 0.0))
    std = float(np.sqrt(np.mean(softness**2)))
    missing = np.array([isinstance(nuisance.effect, Compliance) for nuisance in linear.nuisances], bool)
    beside = linear.columns[..., ~missing], linear.common_std[~missing]
    most = _EXCLUDED * cost_beside(found, *beside)
    unexcluded = []
    for nuisance in linear.nuisances:
        if isinstance(nuisance.effect, Compliance):
            there = _with_one(found, stiffened(nuisance.effect.spring, _PERCENT / std))
            if there is not None and cost_beside(there, *beside) <= most:
                unexcluded.append(UnexcludedSpring(nuisance.name, std, there.internal - found.internal))
    return tuple(unexcluded)


def _with_one(found: AddedSprings, spring: Spring) -> AddedSprings | None:
    """The fit with one spring more, which stays as it is; None where the robot does not rest so."""
    robot = replace(found.robot, springs=(*found.robot.springs, spring))
    options = fix_options(found.options, found.robot, spring)
    try:
        problem = extend_problem(found.problem, found.internal, robot, options)
    except DataError:
        return None
    start = carry_over(problem, found.problem, found.internal)
    count = start.size - problem.parameters.n_friction
    still = optimise(freeze_friction(problem, start), start[:count], max_iterations=_FIRST_STEPS)
    near = np.concatenate([still.parameters, start[count:]])
    return AddedSprings(problem, optimise(problem, near, max_iterations=_STEPS).parameters, robot, options)


def leave_room(estimate: Spread, spring: UnexcludedSpring, row: int) -> Spread:
    """Mixes what the data say of a spring's compliance, to equal parts, with what was known of it beforehand.

    Where others can stand for it, an error that no nuisance names moves what the data say by many of their deviations.

    Args:
        estimate: Parameters and nuisances, this one estimated along.
        spring: The spring.
        row: Its index among them.

    Returns:
        Mean and covariance of the mixture: beforehand, the compliance is half of a normal distribution. Degrees of
        freedom are Satterthwaite's, what is added having infinitely many.
    """
    direction = np.zeros(estimate.values.size)
    direction[: spring.shift.size], direction[row] = spring.shift / spring.std, 1.0
    apart = _HALF_MEAN * spring.std - estimate.values[row]
    own = np.diag(estimate.covariance)
    # Of a mixture of equal parts, the mean is the middle of both means, the variance the mean of both and a quarter of
    # their squared distance. It is added along what the spring does to all parameters.
    added = 0.5 * (_HALF_VARIANCE * spring.std**2 - own[row]) + 0.25 * apart**2
    covariance = estimate.covariance + max(added, 0.0) * np.outer(direction, direction)
    grown = np.divide(np.diag(covariance), own, out=np.ones_like(own), where=own > 0)
    return Spread(estimate.values + 0.5 * apart * direction, covariance, estimate.degrees_of_freedom * grown**2)
