"""Springs that a robot file lacks and the data call for: put in place one by one, and fitted along."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_places
from robid.errors import DataError
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.models.elastic.fit.doubts.extension import (
    carry_over,
    extend_options,
    extend_problem,
    freeze_friction,
    problem_at,
)
from robid.models.elastic.fit.doubts.springs import Compliance
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.strategy import make_strategy
from robid.robot.description import Robot, Spring

_MOST = 6
_TELLING = 0.1  # of the cost that other doubts leave
_AGREEING = 0.75  # of the places
_RIGID = 20.0  # times the gear: as good as not there
_SHARED = 2.0  # times a gear that stood for two springs in series
_RAN_AWAY = 1.0  # of an internal parameter: further than a file is off
_FIRST_STEPS, _STEPS, _KEPT, _LAST_STEPS = 8, 25, 4, 5


@dataclass(frozen=True)
class SettledSprings:
    """A fit's problem with the springs in place that its data call for.

    Attributes:
        problem: The problem; stiffness and damping of each spring are among its parameters.
        internal (n_param,): Its minimum, nearly.
        robot: The robot with the springs, after its own; `list_doubts` of it no longer lists them.
        options: Options with which they are free.
        springs: Names of the springs.
    """

    problem: Problem
    internal: FloatArray
    robot: Robot
    options: ElasticOptions
    springs: tuple[str, ...] = ()

    @property
    def cost(self) -> float:
        """Cost at the minimum."""
        return self.problem.cost(self.internal)


def settle_springs(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    doubts: Sequence[DoubtColumn],
    columns: ComplexArray,
) -> SettledSprings:
    """Puts springs in place whose lack leaves more than noise and model error; the others stay doubts.

    A column says nothing of a spring as soft as a gear, so each is tried, and each pair of a joint: put in place and
    fitted along for some steps. What leaves least, after all other doubts have followed, stays where that saves a
    telling share of the cost in most places; then the next.

    Args:
        problem: The fit's problem.
        internal (n_param,): Its minimum.
        robot: The robot that the doubts were listed for.
        options: Options of the fit.
        doubts: All doubts.
        columns (n_conf, n_freq, n_out, n_in, n_doubt): What `doubt_columns` found for them there.

    Returns:
        The problem at its new minimum; the same as before where no spring is called for.
    """
    missing = np.array([isinstance(doubt.direction, Compliance) for doubt in doubts], bool)
    beside = columns[..., ~missing], np.array([doubt.common_std for doubt in doubts])[~missing]
    listed = [doubt.direction.spring for doubt in doubts if isinstance(doubt.direction, Compliance)]
    now = before = SettledSprings(problem, internal, robot, options)
    left = listed
    cost, expected = cost_beside(now, *beside), expected_cost(problem)
    while left and len(now.springs) < _MOST and cost > expected:
        trials = [(trial, cost_beside(trial, *beside)) for trial in _best_trials(now, left)]
        called = [each for each in trials if each[1] < (1 - _TELLING) * cost and _agree(now, each[0])]
        if not called:
            break
        now = _anew(min(called, key=lambda each: each[1])[0])
        cost = cost_beside(now, *beside)
        left = [spring for spring in left if spring.name not in now.springs]
    return _rested(_pruned(before, now, listed, beside)) if now.springs else now


def _pruned(
    before: SettledSprings,
    found: SettledSprings,
    listed: Sequence[Spring],
    beside: tuple[ComplexArray, FloatArray],
) -> SettledSprings:
    """The fit without those springs of pairs that no longer matter since others are in place."""
    cost = cost_beside(found, *beside)
    for name in found.springs:
        rest = [spring for spring in listed if spring.name in found.springs and spring.name != name]
        fewer = _put_in_place(before, rest, found) if rest else None
        left = np.inf if fewer is None else cost_beside(fewer, *beside)
        if fewer is not None and (1 - _TELLING) * left <= cost:
            found, cost = fewer, left
    return found


def expected_cost(problem: Problem) -> float:
    """Cost of a right model whose errors are those that the weights assume."""
    return 0.5 * problem.residual_kind.parts * float((problem.weight > 0).sum())


def cost_beside(now: SettledSprings, columns: ComplexArray, std: FloatArray) -> float:
    """Returns the cost that parameters and other doubts, with what is known of them, leave after one linear step.

    Args:
        now: The fit.
        columns (n_conf, n_freq, n_out, n_in, n_doubt): The other doubts' columns.
        std (n_doubt,): Their deviations.
    """
    error, derivative = now.problem.linear(now.internal)
    every = np.concatenate([derivative, columns], axis=-1)
    rows = now.problem.rows(every).reshape(-1, every.shape[-1])
    left = now.problem.rows(error).ravel()
    precision = 0.5 / np.concatenate([now.problem.parameters.prior_std, std]) ** 2
    pull = np.concatenate([precision[: now.internal.size] * now.internal, np.zeros(std.size)])
    normal, slope = rows.T @ rows + np.diag(precision), rows.T @ left - pull
    scale = np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    step = np.linalg.lstsq(normal / np.outer(scale, scale), slope / scale, rcond=1e-13)[0] / scale
    return float(((left - rows @ step) ** 2).sum())


def _best_trials(now: SettledSprings, springs: Sequence[Spring]) -> list[SettledSprings]:
    """The few springs, or pairs of a joint, that fit best in place; none that is as good as rigid."""
    pairs = [pair for pair in combinations(springs, 2) if pair[0].joint == pair[1].joint]
    candidates = [*((spring,) for spring in springs), *pairs]
    begun = [trial for each in candidates if (trial := _put_in_place(now, each)) is not None]
    begun.sort(key=lambda trial: trial.cost)
    ends = [_descended(trial, _STEPS) for trial in begun[:_KEPT]]
    ends.sort(key=lambda trial: trial.cost)
    return [end for end in ends if _stiffest(end, end.springs[len(now.springs) :]) < _RIGID]


def _put_in_place(
    now: SettledSprings, springs: Sequence[Spring], near: SettledSprings | None = None
) -> SettledSprings | None:
    """The fit some steps on with further springs, from near another one; None where the robot does not rest so."""
    robot = replace(now.robot, springs=(*now.robot.springs, *springs))
    options = extend_options(now.options, robot, springs, holding=False)
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
    return SettledSprings(problem, np.concatenate([best, starts[0][count:]]), robot, options, names)


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


def _descended(now: SettledSprings, steps: int) -> SettledSprings:
    return replace(now, internal=optimise(now.problem, now.internal, max_iterations=steps).parameters)


def _anew(now: SettledSprings) -> SettledSprings:
    """The same springs, the others fitted from the robot file's values on where that ends lower.

    What a fit without them ran away with does not come back by itself.
    """
    names = now.problem.parameters.names
    kept = np.array([name.split(".")[0] in now.springs for name in names])
    start = np.where(kept | ~now.problem.parameters.logarithmic, now.internal, 0.0)
    end = make_strategy(now.problem, now.robot, now.options).descend(start, straight_too=True)
    return replace(now, internal=end.parameters) if end.cost < now.cost else now


def _stiffest(now: SettledSprings, springs: Sequence[str]) -> float:
    """Largest stiffness of some springs over what each was listed with, its gear's."""
    at = [now.problem.parameters.names.index(f"{name}.stiffness") for name in springs]
    return float(np.exp(np.clip(now.internal[at], -50.0, 50.0)).max())


def _agree(before: SettledSprings, after: SettledSprings) -> bool:
    """Whether a spring helps in most places."""
    costs = [each.problem.configuration_cost(each.problem.model_response(each.internal), each.internal)
             for each in (before, after)]  # fmt: skip
    places = group_places(before.problem.frf.configurations)
    helped = [costs[1][place].sum() < costs[0][place].sum() for place in places]
    return float(np.mean(helped)) >= _AGREEING


def _rested(now: SettledSprings) -> SettledSprings:
    """The same where the robot rests with the springs found."""
    values = now.problem.parameters.parameters(now.internal)
    try:
        problem = problem_at(now.problem, values, now.robot, now.options)
    except DataError:
        return now
    return _descended(replace(now, problem=problem), _LAST_STEPS)
