"""Springs that a robot may lack beside those put in place: data that do not call for one need not exclude it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.doubts.extension import carry_over, extend_problem, freeze_friction, hold_options
from robid.models.elastic.fit.doubts.refit import SettledSprings, cost_beside
from robid.models.elastic.fit.doubts.springs import Compliance, stiffened
from robid.models.elastic.fit.named import Named
from robid.models.elastic.fit.optimizers import optimise
from robid.robot.description import Spring

_HALF_MEAN, _HALF_VARIANCE = np.sqrt(2 / np.pi), 1 - 2 / np.pi  # of half a normal distribution
_PERCENT = 100.0
_FIRST_STEPS, _STEPS = 8, 25
_EXCLUDED = 1.05  # of the cost: half of what calls for a spring


@dataclass(frozen=True)
class UnseenSpring:
    """A spring that the data neither call for nor exclude.

    Attributes:
        name: Name of its doubt.
        std: Compliance that it may well have, in percent of its gear's.
        shift (n_param,): What a spring of this compliance does to the internal parameters.
    """

    name: str
    std: float
    shift: FloatArray


def unseen_springs(found: SettledSprings, named: Named) -> tuple[UnseenSpring, ...]:
    """Tries for each spring still missing whether it could be there, as soft as those that were put in place.

    One that others can stand for costs next to nothing, whatever its compliance: it does not save the share that a
    spring must save to be called for, and still it may be there.

    Args:
        found: The springs put in place.
        named: The doubts with them.
    """
    placed = [found.problem.parameters.names.index(f"{spring}.stiffness") for spring in found.springs]
    softness = _PERCENT * np.exp(-np.maximum(found.internal[placed], 0.0))
    std = float(np.sqrt(np.mean(softness**2)))
    missing = np.array([isinstance(doubt.direction, Compliance) for doubt in named.doubts], bool)
    beside = named.columns[..., ~missing], named.common_std[~missing]
    most = _EXCLUDED * cost_beside(found, *beside)
    unseen = []
    for doubt in named.doubts:
        if isinstance(doubt.direction, Compliance):
            there = _with(found, stiffened(doubt.direction.spring, _PERCENT / std))
            if there is not None and cost_beside(there, *beside) <= most:
                unseen.append(UnseenSpring(doubt.name, std, there.internal - found.internal))
    return tuple(unseen)


def _with(found: SettledSprings, spring: Spring) -> SettledSprings | None:
    """The fit with one spring more, which stays as it is; None where the robot does not rest so."""
    robot = replace(found.robot, springs=(*found.robot.springs, spring))
    options = hold_options(found.options, found.robot, spring)
    try:
        problem = extend_problem(found.problem, found.internal, robot, options)
    except DataError:
        return None
    start = carry_over(problem, found.problem, found.internal)
    count = start.size - problem.parameters.n_friction
    still = optimise(freeze_friction(problem, start), start[:count], max_iterations=_FIRST_STEPS)
    near = np.concatenate([still.parameters, start[count:]])
    return SettledSprings(problem, optimise(problem, near, max_iterations=_STEPS).parameters, robot, options)


@dataclass(frozen=True)
class Told:
    """Parameters and doubts with how far they may be off.

    Attributes:
        values (n,): Internal parameters, then amounts of doubts.
        covariance (n, n): Their covariance, without any quantile.
        degrees_of_freedom (n,): What the quantile of each interval follows.
    """

    values: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray

    def reach(self, confidence: float) -> FloatArray:
        """Half width (n,) of the intervals of a level."""
        return np.asarray(t.ppf(0.5 + 0.5 * confidence, self.degrees_of_freedom) * np.sqrt(np.diag(self.covariance)))


def leave_room(told: Told, spring: UnseenSpring, row: int) -> Told:
    """Mixes what the data say of a spring's compliance, to equal parts, with what was known of it beforehand.

    Where others can stand for it, an error that no doubt names moves what the data say by many of their deviations.

    Args:
        told: Parameters and doubts, this one estimated along.
        spring: The spring.
        row: Its place among them.

    Returns:
        Mean and covariance of the mixture: beforehand, the compliance is half of a normal distribution. Degrees of
        freedom are Satterthwaite's, what is added having infinitely many.
    """
    direction = np.zeros(told.values.size)
    direction[: spring.shift.size], direction[row] = spring.shift / spring.std, 1.0
    apart = _HALF_MEAN * spring.std - told.values[row]
    own = np.diag(told.covariance)
    added = 0.5 * (_HALF_VARIANCE * spring.std**2 - own[row]) + 0.25 * apart**2
    covariance = told.covariance + max(added, 0.0) * np.outer(direction, direction)
    grown = np.divide(np.diag(covariance), own, out=np.ones_like(own), where=own > 0)
    return Told(told.values + 0.5 * apart * direction, covariance, told.degrees_of_freedom * grown**2)
