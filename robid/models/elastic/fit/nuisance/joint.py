"""Parameters and nuisances estimated together: the robot is as far off as they say, in each cluster of its own."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.clusters.evidence import spread_over
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.effects import Compliance, RobotMove
from robid.models.elastic.fit.nuisance.linear import Basis, LinearNuisances, NuisanceSet, linearise
from robid.models.elastic.fit.nuisance.missing_springs import expected_cost
from robid.models.elastic.fit.nuisance.off_robot import LEAST_COMPLIANCE, OffRobot, are_put_in, may_differ, put_in
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.nuisance.scene import Scene, moves_matrices_alone
from robid.models.elastic.fit.nuisance.shares import following_rotors
from robid.models.elastic.fit.nuisance.shifts import find_shifts
from robid.results.levenberg import Normal, minimise
from robid.robot.linearize import Shifts

_STEPS = 60
_ENOUGH, _ROUGHLY = 5e-4, 1e-2  # of the cost
_SHARES = (0.01, 0.1, 1.0)
_FARTHEST = 1.0  # of a logarithm, where it begins: what a fit without nuisances ran away with says nothing
_LONGEST = 0.5  # of an internal parameter, in a step
_LONGEST_STD = 2.0  # of a nuisance's deviation
_SURPRISING = 3.0  # deviations


@dataclass(frozen=True)
class Joint:
    """Parameters and nuisances that fit best together."""

    linear: LinearNuisances  # The nuisances, linearised there
    cost: float  # What is left, without what is known beforehand

    @property
    def explains(self) -> bool:
        """Whether no more is left than noise and assumed model error give."""
        return self.cost <= expected_cost(self.linear.problem)

    @property
    def lacks_springs(self) -> bool:
        """Whether a spring that the file lacks is softer than it is known to be beforehand."""
        missing = np.array([isinstance(nuisance.effect, Compliance) for nuisance in self.linear.nuisances])
        return bool((self.linear.amounts > _SURPRISING * self.linear.common_std)[missing].any())


def descend(start: NuisanceSet, given: Basis, placed: Sequence[str] = ()) -> Joint:
    """Estimates parameters and nuisances together, clusters with what each adds to those that differ between them.

    A robot's resonances are narrow: some percent of a spring, a mass or a bristle move them by more than their width,
    and their columns say nothing any more. So the robot is put together anew at each point.

    Args:
        start: The nuisances, and where the descent begins.
        given: What is taken for granted.
        placed: Names of springs that were put in place: where they were found says something, however far.

    Returns:
        Where it ends.

    Raises:
        DataError: If a robot near that does not rest.
    """
    problem, space = start.problem, Space.of(start)
    descent = Descent(start, given, space)
    near = np.clip(start.point, -_FARTHEST, _FARTHEST)
    found = np.isin([name.rpartition(".")[0] for name in problem.parameters.names], placed)
    point = np.where(problem.parameters.logarithmic & ~found, near, start.point)
    explained = problem.cost(start.point) <= expected_cost(problem)
    best, cost = _lowest(descent, space, point, _SHARES[-1:] if explained else _SHARES)
    if cost > expected_cost(problem):
        with suppress(DataError):
            best, cost = min(
                (best, cost), _lowest(descent, space, np.zeros_like(point), _SHARES), key=lambda end: end[1]
            )
    state = space.state(best)
    where = problem, start.nuisances, state.point, given, state.amounts, space.added(state)
    shifts = descent.shifts if moves_matrices_alone(problem, state.point) else None
    return Joint(linearise(*where, all_rest=False, shifts=shifts), cost)


def _lowest(descent: Descent, space: Space, point: FloatArray, shares: tuple[float, ...]) -> tuple[FloatArray, float]:
    """Where a descent from a point (n_param,) with growing weights ends, and the squares left there."""
    now = space.internal(State(point, space.floor, np.zeros((space.clusters, space.differing.size))))
    # With small weights what is known beforehand leads; narrow resonances, in whose reach a descent must be first,
    # count in full only at the end.
    for share in shares:
        descent.share = share
        now = minimise(
            descent.cost,
            descent.normal,
            now,
            max_iterations=_STEPS,
            cost_tolerance=_ENOUGH if share == _SHARES[-1] else _ROUGHLY,
            lower=space.lower,
            upper=space.upper,
        ).parameters
    return now, descent.data_cost(now)


@dataclass(frozen=True)
class State:
    """Internal parameters (n_param,), amounts (n_nuisance,), and what clusters add (n_cluster, n_differing)."""

    point: FloatArray
    amounts: FloatArray
    each: FloatArray


@dataclass(frozen=True)
class Space:
    """Parameters, amounts and what clusters add as one vector, in units of the longest step."""

    unit: FloatArray  # (n,) The units
    precision: FloatArray  # (n,) Half of what is known beforehand of each, inverse variances in these units
    lower: FloatArray  # (n,) Smallest values
    upper: FloatArray  # (n,) Largest values
    floor: FloatArray  # (n_nuisance,) Least amounts: springs that may be missing stay in the model, however stiff
    differing: IntArray  # (n_differing,) Nuisances to which clusters add something
    size: int  # Number of parameters
    clusters: int  # Number of clusters

    @classmethod
    def of(cls, start: NuisanceSet) -> Space:
        """Returns the space of nuisances with their parameters."""
        parameters, nuisances = start.problem.parameters, start.nuisances
        missing = np.array([isinstance(nuisance.effect, Compliance) for nuisance in nuisances])
        floor = np.where(missing, 2 * LEAST_COMPLIANCE, 0.0)
        differing = np.flatnonzero(start.cluster_std)
        # In units of the longest step, a step of one is as far as the linear model is trusted for each.
        added = np.tile(start.cluster_std[differing], len(start.clusters))
        std = np.concatenate([parameters.prior_std, start.common_std, added])
        unit = np.concatenate([np.full(start.point.size, _LONGEST), _LONGEST_STD * std[start.point.size :]])
        least = np.maximum([nuisance.least for nuisance in nuisances], np.where(missing, floor, -np.inf))
        most = np.array([nuisance.most for nuisance in nuisances])
        free = np.full(added.size, np.inf)
        return cls(
            unit=unit,
            precision=0.5 * (unit / std) ** 2,
            lower=np.concatenate([parameters.lower, least, -free]) / unit,
            upper=np.concatenate([parameters.upper, most, free]) / unit,
            floor=floor,
            differing=differing,
            size=start.point.size,
            clusters=len(start.clusters),
        )

    def internal(self, state: State) -> FloatArray:
        """Returns the vector (n,) of a state."""
        return np.concatenate([state.point, state.amounts, state.each.ravel()]) / self.unit

    def state(self, internal: FloatArray) -> State:
        """Returns the state that a vector (n,) is."""
        values = internal * self.unit
        point, amounts, each = np.split(values, [self.size, self.size + self.floor.size])
        return State(point, amounts, each.reshape(self.clusters, self.differing.size))

    def added(self, state: State) -> FloatArray:
        """What clusters add (n_cluster, n_nuisance), zero for nuisances that are the same in all."""
        added = np.zeros((len(state.each), self.floor.size))
        added[:, self.differing] = state.each
        return added


class Descent:
    """Cost and normal equations of the whole; columns are those of the last point that was linearised.

    Attributes:
        share: Weight of what is measured, 1 for that of the problem.
        shifts: How the robot's matrices move with its nuisances; None before the first derivative, or without moves.
    """

    def __init__(self, start: NuisanceSet, given: Basis, space: Space) -> None:
        """Begins a descent.

        Args:
            start: The nuisances.
            given: What is taken for granted.
            space: What is estimated.
        """
        self._start, self._space = start, space
        self._given = replace(given, options=replace(given.options, statics="updates"))
        self._within, self._differing = are_put_in(start.nuisances), may_differ(start.nuisances)
        self.share = 1.0
        self.shifts: Shifts | None = None
        self._columns: FloatArray = np.empty(0)
        self._seen: tuple[FloatArray, OffRobot] | None = None

    def cost(self, internal: FloatArray) -> float:
        """Squares that are left, with what is known beforehand; infinite where the robot does not rest."""
        try:
            off = self._off(internal)
        except DataError:
            return np.inf
        with np.errstate(all="ignore"):
            left = self._left(internal, off)
            total = float(self.share * (left**2).sum() + (self._space.precision * internal**2).sum())
        return total if np.isfinite(total) else np.inf

    def data_cost(self, internal: FloatArray) -> float:
        """Squares that are left."""
        return float((self._left(internal, self._off(internal)) ** 2).sum())

    def normal(self, internal: FloatArray) -> Normal:
        """The same with half its gradient and half its Gauss-Newton Hessian."""
        state, off = self._space.state(internal), self._off(internal)
        self._columns = off.problem.rows(self._nuisance_columns(state, off))
        left = self._left(internal, off)
        clusters, each = self._start.clusters, self._each(state)
        own = off.problem.rows(off.problem.linear(state.point)[1])
        names = off.problem.parameters.names
        own = following_rotors(own, names, self._start.nuisances, self._columns, state.amounts + each)
        derivative = np.concatenate([own, self._columns], axis=-1)
        whole = derivative.shape[-1]
        added = self._space.size + self._space.differing
        hessian, score = np.diag(self._space.precision), np.zeros(internal.size)
        # Parameters and common amounts have rows in all clusters, what one adds only in its own: the Hessian is an
        # arrow, filled cluster by cluster. The residual is what is left, so its derivative has the other sign.
        for number, cluster in enumerate(clusters):
            rows = derivative[cluster].reshape(-1, whole)
            inner, pull = self.share * (rows.T @ rows), self.share * (rows.T @ left[cluster].ravel())
            at = whole + number * added.size + np.arange(added.size)
            every, kept = np.concatenate([np.arange(whole), at]), np.concatenate([np.arange(whole), added])
            unit = self._space.unit[every]
            hessian[np.ix_(every, every)] += inner[np.ix_(kept, kept)] * np.outer(unit, unit)
            score[every] += pull[kept] * unit
        known = self._space.precision * internal
        return Normal(float(self.share * (left**2).sum() + known @ internal), known - score, hessian)

    def _off(self, internal: FloatArray) -> OffRobot:
        if self._seen is None or not np.array_equal(self._seen[0], internal):
            state = self._space.state(internal)
            start, given = self._start, self._given
            each = self._each(state)
            known = start.problem, state.point, given.robot, given.options
            self._seen = internal.copy(), put_in(*known, start.nuisances, state.amounts, each)
        return self._seen[1]

    def _each(self, state: State) -> FloatArray:
        """What each configuration adds (n_conf, n_nuisance)."""
        return spread_over(self._start.clusters, self._space.added(state))

    def _left(self, internal: FloatArray, off: OffRobot) -> FloatArray:
        """Weighted residuals (n_conf, n_row), what is not put into the robot by its columns."""
        state = self._space.state(internal)
        point = state.point
        error = off.problem.residual(point, off.problem.model_response(point))
        left = off.problem.rows(error)
        if not self._columns.size:
            return left
        added = self._space.added(state)
        # Amounts that no robot can be off by act by their columns, to first order around zero; the others are in the
        # robot.
        beside = state.amounts * ~self._within + added * ~self._differing
        for cluster, amounts in zip(self._start.clusters, beside, strict=True):
            left[cluster] -= self._columns[cluster] @ amounts
        return left

    def _nuisance_columns(self, state: State, off: OffRobot) -> ComplexArray:
        """Columns (n_conf, n_freq, n_out, n_in, n_nuisance); how matrices move with a nuisance is found once."""
        arguments = off.problem, state.point, off.robot, off.options
        moves = [nuisance for nuisance in self._start.nuisances if isinstance(nuisance.effect, RobotMove)]
        if moves and self.shifts is None:
            self.shifts = find_shifts(Scene(*arguments), moves)
        return nuisance_columns(*arguments, self._start.nuisances, all_rest=False, shifts=self.shifts)
