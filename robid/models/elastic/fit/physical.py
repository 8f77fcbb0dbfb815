"""The parameters themselves: what a fit says of them once what the robot file may have wrong is estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.models.elastic.fit.effective import Settled, settle
from robid.models.elastic.fit.nuisance.joint import Joint, descend
from robid.models.elastic.fit.nuisance.named import Listed, Named, Suspicion, name_doubts, suspect
from robid.models.elastic.fit.nuisance.placed import (
    SettledSprings,
    Told,
    UnseenSpring,
    leave_room,
    settle_springs,
    unseen_springs,
)
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.solution import NamedDoubts
from robid.models.elastic.fit.uncertainty import influence

_PERCENT = 100.0
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
        further: How many times as far off as known beforehand the doubts are, at least 1: what is known was taken to be
            known so much worse.
        model_error: Whether an error of the model was allowed for.
    """

    values: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    doubts: NamedDoubts
    rigid: bool
    further: float = 1.0
    model_error: bool = True


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
    problem, suspicion = _allowing_for_error(problem, points[-1], suspicion)
    near = points if suspicion.rested else (np.zeros_like(points[-1]),)
    listed = suspect(problem, near, suspicion)
    if listed is None:
        return None
    left = problem.cost(points[-1])
    alone = _descended(listed, suspicion, left)
    if alone is not None and alone.explains and not alone.lacks_springs:
        return _estimated(problem, alone.named, (), (), confidence)
    named = name_doubts(problem, near, suspicion)
    if named is None:
        return None
    robot, options = suspicion.robot, suspicion.options
    found = settle_springs(problem, named.point, robot, options, named.doubts, named.columns)
    extended = _extended(found, suspicion) if found.springs else None
    if extended is None:
        named = named if alone is None else alone.named
        return _estimated(problem, named, (), (), confidence) if suspicion.rested else None
    if not suspicion.rested and found.cost > _EXPLAINED * left:
        return None
    unseen = unseen_springs(found, extended)
    soft = _as_soft(extended, unseen)
    given = replace(suspicion, robot=found.robot, options=found.options)
    together = _descended(soft, given, found.cost, found.springs)
    return _estimated(problem, soft if together is None else together.named, found.springs, unseen, confidence)


def _allowing_for_error(problem: Problem, internal: FloatArray, suspicion: Suspicion) -> tuple[Problem, Suspicion]:
    """The problem with weights that allow for an error of the model, whatever those of the fit.

    Weights without one let the data outweigh all that is known beforehand: what no doubt names then takes masses and
    torque constants far off, and with them all springs by a factor that no response tells.
    """
    weights = suspicion.options.weights
    if weights.kind in ("inflated", "estimated") or (weights.kind == "user" and weights.off_diagonal == 0):
        return problem, suspicion
    options = replace(suspicion.options, weights=replace(weights, kind="inflated"))
    allowing, _ = make_problem(problem.frf, problem.model, problem.parameters, options, internal)
    return allowing, replace(suspicion, options=options)


def _estimated(
    problem: Problem,
    named: Named,
    springs: Sequence[str],
    unseen: Sequence[UnseenSpring],
    confidence: float,
) -> Physical:
    """The problem's own parameters among those of a robot with springs put in place, and others that may be there."""
    found = influence(named.problem, named.point)
    far = settle(named.problem, named.point, found, named)
    further = _how_much_further(named, far)
    if further > 1:
        far = settle(named.problem, named.point, found, _less_sure(named, further))
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
        further=further,
        model_error=bool(problem.model_error.any()),
    )


def _descended(listed: Listed, given: Suspicion, left: float, placed: Sequence[str] = ()) -> Joint | None:
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
    known = named.common_std**2
    told = np.maximum(1 - np.diag(far.pooled.assumed)[named.point.size :] / known, 0.0).sum()
    return float(np.sqrt(max(1.0, (far.amounts**2 / known).sum() / told))) if told >= 1 else 1.0


def _less_sure(named: Named, times: float) -> Named:
    doubts = (
        replace(each, common_std=times * each.common_std, place_std=times * each.place_std) for each in named.doubts
    )
    return replace(named, doubts=tuple(doubts))


def _as_soft(named: Named, unseen: Sequence[UnseenSpring]) -> Named:
    """The doubts, those of springs that others can stand for as large as they may be."""
    known = {spring.name: spring.std for spring in unseen}
    doubts = (replace(each, common_std=known.get(each.name, each.common_std)) for each in named.doubts)
    return replace(named, doubts=tuple(doubts))


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
