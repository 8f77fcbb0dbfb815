"""The nuisances of a robot file that a fit carries along, as further columns of its problem."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_clusters, spread_over
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.effects import Nuisance, PerturbedRobot
from robid.models.elastic.fit.nuisance.listing import left_of_estimated, list_nuisances
from robid.models.elastic.fit.nuisance.off_robot import are_put_in, may_differ, put_in
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import NuisanceEstimates
from robid.robot.description import Robot
from robid.robot.linearize import Shifts

_KNOWN_TORQUE = "N m"


@dataclass(frozen=True)
class NuisanceSet:
    """What the robot file may have wrong."""

    nuisances: tuple[Nuisance, ...]  # The nuisances
    # The fit's problem, whose robot rests anew for all values: a spring must give under gravity as a link weighs, or
    # what acts alike seems to be distinguishable
    problem: Problem
    point: FloatArray  # (n_param,) Internal parameters
    rigid: bool  # Whether a rigid fit says how far masses may be off

    @cached_property
    def clusters(self) -> list[list[int]]:
        """Indices of the configurations of each cluster."""
        return group_clusters(self.problem.frf.configurations)

    @property
    def common_std(self) -> FloatArray:
        """Deviation (n_nuisance,) of the amounts that all clusters share."""
        return np.array([nuisance.common_std for nuisance in self.nuisances])

    @property
    def cluster_std(self) -> FloatArray:
        """Deviation (n_nuisance,) of what each cluster adds."""
        return np.array([nuisance.cluster_std for nuisance in self.nuisances])


@dataclass(frozen=True)
class LinearNuisances(NuisanceSet):
    """Nuisances with what they do to the residual, linearised at the point."""

    # (n_nuisance,) By how much all is off where it is linearised; so is the problem's robot, along those that can be
    # put into one
    amounts: FloatArray
    columns: ComplexArray  # (n_conf, n_freq, n_out, n_in, n_nuisance) Negative derivatives of the residual by amounts
    # (n_cluster, n_nuisance) What each cluster adds to the amounts there; the problem's gears have it already
    added: FloatArray

    @property
    def each(self) -> FloatArray:
        """By how much each configuration is off there (n_conf, n_nuisance)."""
        return self.amounts + spread_over(self.clusters, self.added)

    @property
    def error(self) -> ComplexArray:
        """What is left (n_conf, n_freq, n_out, n_in) at the point by the amounts alone: without what clusters add."""
        error = self.problem.residual(self.point, self.problem.model_response(self.point))
        without = self.added * may_differ(self.nuisances) - self.amounts * ~are_put_in(self.nuisances)
        for cluster, own in zip(self.clusters, without, strict=True):
            error[cluster] += self.columns[cluster] @ own
        return error

    def estimated(self, value: FloatArray, half_width: FloatArray, covariance: FloatArray) -> NuisanceEstimates:
        """Returns what a fit says of the amounts (n_nuisance,) that it estimated along.

        Args:
            value (n_nuisance,): The amounts.
            half_width (n_nuisance,): Half the widths of their intervals.
            covariance: Joint covariance (n_param + n_nuisance, n_param + n_nuisance), parameters first.
        """
        names, causes, units = zip(*((each.name, each.cause, each.unit) for each in self.nuisances), strict=True)
        # Where all that is known is Gaussian, amounts move the parameters by their regression on these.
        size = self.point.size
        slopes = np.linalg.lstsq(covariance[size:, size:], covariance[size:, :size], rcond=None)[0].T
        moves = slopes * value
        return NuisanceEstimates(names, causes, units, self.common_std, self.cluster_std, value, half_width, moves)

    @property
    def least_shift(self) -> FloatArray:
        """Smallest shift (n_param + n_nuisance,) of parameters and amounts from here that makes sense."""
        least = np.array([nuisance.least for nuisance in self.nuisances]) - self.amounts
        return np.concatenate([np.full(self.point.size, -np.inf), least])


@dataclass(frozen=True)
class Basis:
    """What a fit takes for granted, beside its parameters."""

    robot: Robot  # The robot that the fit started from
    options: ElasticOptions  # Options of the fit
    perturbed: Sequence[PerturbedRobot] = ()  # Robots off along independent directions that a rigid fit leaves open
    rested: bool = True  # Whether the fit ended where its robot rests; if not, only a missing spring may say why

    @property
    def anywhere(self) -> ElasticOptions:
        """Options with which the robot rests anew for all values."""
        return replace(self.options, statics="every_iterate")


def list_linearised(problem: Problem, points: Sequence[FloatArray], given: Basis) -> LinearNuisances | None:
    """Lists what the robot file may have wrong and linearises it.

    Args:
        problem: The problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest.
        given: What is taken for granted.

    Returns:
        The nuisances; None where there are none, or the robot rests nowhere.
    """
    nuisances = _nuisances_of(problem, given)
    for point in points if nuisances else ():
        with suppress(DataError):
            return linearise(problem, nuisances, point, given)
    return None


def list_at_rest(problem: Problem, points: Sequence[FloatArray], given: Basis) -> NuisanceSet | None:
    """Lists the same without linearising it, at the first point where the robot rests; see `list_linearised`."""
    nuisances = _nuisances_of(problem, given)
    nothing = np.zeros(len(nuisances))
    for point in points if nuisances else ():
        with suppress(DataError):
            off = put_in(problem, point, given.robot, given.anywhere, nuisances, nothing)
            return NuisanceSet(nuisances, off.problem, point, bool(given.perturbed))
    return None


def _nuisances_of(problem: Problem, given: Basis) -> tuple[Nuisance, ...]:
    """All nuisances but those of torque constants that are estimated along, or that every value is a ratio to."""
    constants = {f"{joint.name}.torque_constant" for joint in given.robot.joints}
    every = list_nuisances(given.robot, given.options, given.perturbed)
    if problem.frf.input_unit == _KNOWN_TORQUE:
        along = {name for name in constants if name.replace("constant", "scale") in problem.parameters.names}
        kept = (left_of_estimated(nuisance) if nuisance.name in along else nuisance for nuisance in every)
        return tuple(nuisance for nuisance in kept if nuisance is not None)
    return tuple(nuisance for nuisance in every if nuisance.name not in constants)


def linearise(
    problem: Problem,
    nuisances: tuple[Nuisance, ...],
    point: FloatArray,
    given: Basis,
    amounts: FloatArray | None = None,
    added: FloatArray | None = None,
    *,
    all_rest: bool = True,
    shifts: Shifts | None = None,
) -> LinearNuisances:
    """Linearises nuisances at a robot that is off by them.

    Args:
        problem: The problem of the robot that is right.
        nuisances: The nuisances.
        point (n_param,): Internal parameters.
        given: What is taken for granted.
        amounts (n_nuisance,): By how much all is off; nothing when not given.
        added (n_cluster, n_nuisance): What each cluster adds to that; nothing when not given.
        all_rest: Whether robots near it must rest; otherwise nothing is said of nuisances along which they do not.
        shifts: How that robot's matrices move with nuisances that are moves of it; found here when not given.

    Raises:
        DataError: If that robot does not rest, or one near it that must.
    """
    clusters = group_clusters(problem.frf.configurations)
    amounts = np.zeros(len(nuisances)) if amounts is None else amounts
    added = np.zeros((len(clusters), len(nuisances))) if added is None else added
    each = spread_over(clusters, added)
    off = put_in(problem, point, given.robot, given.anywhere, nuisances, amounts, each)
    where = off.problem, point, off.robot, off.options, nuisances
    columns = nuisance_columns(*where, amounts=amounts, all_rest=all_rest, shifts=shifts)
    return LinearNuisances(nuisances, off.problem, point, bool(given.perturbed), amounts, columns, added)
