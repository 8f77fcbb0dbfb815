"""The parameters themselves: what a fit says of them once what the robot file may have wrong is estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.fit.elastic.doubts.column import RobotMove
from robid.fit.elastic.doubts.refit import SettledSprings, settle_springs
from robid.fit.elastic.doubts.unseen import Told, UnseenSpring, leave_room, unseen_springs
from robid.fit.elastic.effective import Settled, settle
from robid.fit.elastic.named import Named, Suspicion, linearise, move, name_doubts
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.solution import NamedDoubts
from robid.fit.elastic.uncertainty import influence

_PERCENT = 100.0
_MOVES = 8
_SHARES = (1.0, 0.5, 0.25, 0.1)
_RISES = 1
_SAME = 0.01  # of the cost
_EXPLAINED = 0.5  # of the cost, where what fits best does not rest


@dataclass(frozen=True)
class Physical:
    """The parameters themselves.

    Attributes:
        values (n_param,): Internal parameters of the fit.
        covariance (n_param, n_param): Their covariance, without any quantile.
        degrees_of_freedom (n_param,): What the quantile of each interval follows.
        doubts: What places say of the doubts, springs that were put in place first.
        rigid: Whether a rigid fit says how far masses may be off.
    """

    values: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    doubts: NamedDoubts
    rigid: bool


def find_physical(
    problem: Problem, points: Sequence[FloatArray], suspicion: Suspicion, confidence: float
) -> Physical | None:
    """Estimates parameters and doubts together, from what is known of the doubts beforehand on.

    Springs that the file lacks are put in place where the data call for them: to first order nothing can be said of a
    spring as soft as a gear. Where the robot does not rest with what fits best, only springs that explain that count.

    Args:
        problem: The fit's problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest. The
            last is the minimum.
        suspicion: What the robot file may have wrong.
        confidence: Level of the intervals.

    Returns:
        The parameters; None where there are no doubts, or the robot rests nowhere with what is found.
    """
    named = name_doubts(problem, points if suspicion.rested else (np.zeros_like(points[-1]),), suspicion)
    if named is None:
        return None
    robot, options = suspicion.robot, suspicion.options
    found = settle_springs(problem, named.point, robot, options, named.doubts, named.columns)
    extended = _extended(found, suspicion) if found.springs else None
    if extended is None:
        return _estimated(problem, named, suspicion, (), (), confidence) if suspicion.rested else None
    if not suspicion.rested and found.cost > _EXPLAINED * problem.cost(points[-1]):
        return None
    unseen = unseen_springs(found, extended)
    given = replace(suspicion, robot=found.robot, options=found.options)
    return _estimated(problem, _as_soft(extended, unseen), given, found.springs, unseen, confidence)


def _estimated(
    problem: Problem,
    named: Named,
    given: Suspicion,
    springs: Sequence[str],
    unseen: Sequence[UnseenSpring],
    confidence: float,
) -> Physical:
    """The problem's own parameters among those of a robot with springs put in place, and others that may be there."""
    named, far = _settled(named, given)
    told = Told(np.concatenate([far.values, far.amounts]), *far.pooled.spread(confidence))
    rows = {doubt.name: far.values.size + number for number, doubt in enumerate(named.doubts)}
    for spring in unseen:
        told = leave_room(told, spring, rows[spring.name])
    names = named.problem.parameters.names
    own = np.array([names.index(name) for name in problem.parameters.names])
    return Physical(
        values=told.values[own],
        covariance=told.covariance[np.ix_(own, own)],
        degrees_of_freedom=told.degrees_of_freedom[own],
        doubts=_estimates(named, told, springs, confidence),
        rigid=named.rigid,
    )


def _as_soft(named: Named, unseen: Sequence[UnseenSpring]) -> Named:
    """The doubts, those of springs that others can stand for as large as they may be."""
    known = {spring.name: spring.std for spring in unseen}
    doubts = (replace(each, common_std=known.get(each.name, each.common_std)) for each in named.doubts)
    return replace(named, doubts=tuple(doubts))


def _settled(named: Named, given: Suspicion) -> tuple[Named, Settled]:
    """Parameters and doubts that places agree on; robots follow their doubts as far as the cost falls with them."""
    far = settle(named.problem, named.point, influence(named.problem, named.point), named)
    best = now = _At(named, far, _cost(named, named.problem, named.point, named.amounts))
    rises = 0
    for _ in range(0 if named.rigid else _MOVES):
        if _is_linear(now, given) or rises > _RISES:
            break
        ahead = _ahead(now, given)
        if ahead is None:
            break
        now = ahead
        best, rises = (now, 0) if now.cost < best.cost else (best, rises + 1)
    return best.named, best.far


@dataclass(frozen=True)
class _At:
    """Doubts at a robot that is off by them, what places agree on from there, and the cost there."""

    named: Named
    far: Settled
    cost: float


def _is_linear(now: _At, given: Suspicion) -> bool:
    """Whether the cost where places agree is what was foreseen."""
    named, far = now.named, now.far
    error, derivative = named.problem.linear(named.point)
    step = derivative @ (far.values - named.point) + named.columns @ (far.amounts - named.amounts)
    foreseen = float((np.abs(named.problem.weighted(error - step)) ** 2).sum())
    foreseen += _known(named, named.problem, far.values, far.amounts)
    try:
        there = move(named.problem, named.doubts, far.values, far.amounts, given)
    except DataError:
        return False
    return abs(_cost(named, there.problem, far.values, far.amounts) - foreseen) < _SAME * foreseen


def _ahead(now: _At, given: Suspicion) -> _At | None:
    """Goes the way to what places agree on, or a part of it on which the cost falls; all of it where none does."""
    named, found = now.named, []
    for share in _SHARES:
        point = named.point + share * (now.far.values - named.point)
        amounts = named.amounts + share * (now.far.amounts - named.amounts)
        try:
            there = move(named.problem, named.doubts, point, amounts, given)
        except DataError:
            continue
        found.append((there, _cost(named, there.problem, point, amounts)))
        if found[-1][1] < now.cost:
            break
    if not found:
        return None
    chosen, cost = found[-1] if found[-1][1] < now.cost else found[0]
    try:
        after = linearise(named.doubts, chosen, given)
    except DataError:
        return None
    return _At(after, settle(after.problem, after.point, influence(after.problem, after.point), after), cost)


def _cost(named: Named, problem: Problem, point: FloatArray, amounts: FloatArray) -> float:
    """Cost with doubts that are no move of a robot as columns, and with what is known of all beforehand."""
    model = problem.residual(point, problem.model_response(point))
    columns = amounts * np.array([not isinstance(doubt.direction, RobotMove) for doubt in named.doubts])
    left = problem.weighted(model - named.columns @ columns)
    return float((np.abs(left) ** 2).sum()) + _known(named, problem, point, amounts)


def _known(named: Named, problem: Problem, point: FloatArray, amounts: FloatArray) -> float:
    """Half the squared deviations from what is known beforehand."""
    known = (point / problem.parameters.prior_std) ** 2, (amounts / named.common_std) ** 2
    return 0.5 * float(sum(each.sum() for each in known))


def _extended(found: SettledSprings, suspicion: Suspicion) -> Named | None:
    """The doubts of the robot with springs put in place, linearised where places agree on it."""
    extra = found.robot.springs[len(suspicion.robot.springs) :]
    doubtful = [
        replace(other, robot=replace(other.robot, springs=(*other.robot.springs, *extra)))
        for other in suspicion.doubtful
    ]
    near = settle(found.problem, found.internal, influence(found.problem, found.internal))
    points = near.values, found.internal
    return name_doubts(found.problem, points, Suspicion(found.robot, found.options, doubtful))


def _estimates(named: Named, told: Told, springs: Sequence[str], confidence: float) -> NamedDoubts:
    every, reach, size = named.doubts, told.reach(confidence), named.point.size
    names = named.problem.parameters.names
    placed = np.array([names.index(f"{spring}.stiffness") for spring in springs], int)
    value, half = _compliance(told.values, reach, placed)
    nothing = np.zeros(len(springs))
    return NamedDoubts(
        names=(*(f"{spring}.compliance" for spring in springs), *(doubt.name for doubt in every)),
        causes=(*("missing_spring" for _ in springs), *(doubt.cause for doubt in every)),
        units=(*("% of its gear's compliance" for _ in springs), *(doubt.unit for doubt in every)),
        prior_std=np.concatenate([nothing + np.inf, named.common_std]),
        place_std=np.concatenate([nothing, named.place_std]),
        value=np.concatenate([value, told.values[size:]]),
        half_width=np.concatenate([half, reach[size:]]),
    )


def _compliance(values: FloatArray, reach: FloatArray, placed: IntArray) -> tuple[FloatArray, FloatArray]:
    """Compliance of springs put in place over what they were listed with, and half its interval, in percent."""
    lower, upper = (_PERCENT * np.exp(-values[placed] + side * reach[placed]) for side in (-1, 1))
    return _PERCENT * np.exp(-values[placed]), 0.5 * (upper - lower)
