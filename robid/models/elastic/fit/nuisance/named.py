"""The doubts of a robot file that a fit carries along, as further columns of its problem."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_places, spread_over
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.kinds import DoubtfulRobot, Nuisance, left_of_freed, list_nuisances
from robid.models.elastic.fit.nuisance.off_robot import are_put_in, may_differ, put_in
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import NamedDoubts
from robid.robot.description import Robot
from robid.robot.linearize import Shifts

_KNOWN_TORQUE = "N m"


@dataclass(frozen=True)
class Listed:
    """What the robot file may have wrong.

    Attributes:
        doubts: The doubts.
        problem: The fit's problem, whose robot rests anew for all values: a spring must give under gravity as a link
            weighs, or what acts alike seems to be told apart.
        point (n_param,): Internal parameters.
        rigid: Whether a rigid fit says how far masses may be off.
    """

    doubts: tuple[Nuisance, ...]
    problem: Problem
    point: FloatArray
    rigid: bool

    @cached_property
    def places(self) -> list[list[int]]:
        """Indices of the configurations of each place."""
        return group_places(self.problem.frf.configurations)

    @property
    def common_std(self) -> FloatArray:
        """Deviation (n_doubt,) of the amounts that all places share."""
        return np.array([doubt.common_std for doubt in self.doubts])

    @property
    def place_std(self) -> FloatArray:
        """Deviation (n_doubt,) of what each place adds."""
        return np.array([doubt.place_std for doubt in self.doubts])


@dataclass(frozen=True)
class Named(Listed):
    """Doubts with what they do to the residual, linearised at the point.

    Attributes:
        amounts (n_doubt,): By how much all is off where it is linearised; the problem's robot is, along doubts that can
            be put into one.
        columns (n_conf, n_freq, n_out, n_in, n_doubt): Negative derivatives of the residual by their amounts.
        added (n_place, n_doubt): What each place adds to the amounts there; the problem's gears have it already.
    """

    amounts: FloatArray
    columns: ComplexArray
    added: FloatArray

    @property
    def error(self) -> ComplexArray:
        """What is left (n_conf, n_freq, n_out, n_in) at the point by the amounts alone: without what places add."""
        error = self.problem.residual(self.point, self.problem.model_response(self.point))
        without = self.added * may_differ(self.doubts) - self.amounts * ~are_put_in(self.doubts)
        for place, own in zip(self.places, without, strict=True):
            error[place] += self.columns[place] @ own
        return error

    def estimated(self, value: FloatArray, half_width: FloatArray) -> NamedDoubts:
        """Returns what a fit says of the amounts (n_doubt,) that it estimated along."""
        names, causes, units = zip(*((each.name, each.cause, each.unit) for each in self.doubts), strict=True)
        return NamedDoubts(names, causes, units, self.common_std, self.place_std, value, half_width)

    @property
    def least_shift(self) -> FloatArray:
        """Smallest shift (n_param + n_doubt,) of parameters and amounts from here that makes sense."""
        least = np.array([doubt.least for doubt in self.doubts]) - self.amounts
        return np.concatenate([np.full(self.point.size, -np.inf), least])


@dataclass(frozen=True)
class Basis:
    """What a fit takes for granted, to be named where its parameters are.

    Attributes:
        robot: The robot that the fit started from.
        options: Options of the fit.
        doubtful: Robots that are off along independent directions that a rigid fit leaves open.
        rested: Whether the fit ended where its robot rests; where it did not, only a missing spring may say why.
    """

    robot: Robot
    options: ElasticOptions
    doubtful: Sequence[DoubtfulRobot] = ()
    rested: bool = True


def name_doubts(problem: Problem, points: Sequence[FloatArray], given: Basis) -> Named | None:
    """Lists what the robot file may have wrong and linearises it.

    Args:
        problem: The problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest.
        given: What is taken for granted.

    Returns:
        The doubts; None where there are none, or the robot rests nowhere.
    """
    doubts = _doubts_of(problem, given)
    for point in points if doubts else ():
        with suppress(DataError):
            return linearise(problem, doubts, point, given)
    return None


def list_at_rest(problem: Problem, points: Sequence[FloatArray], given: Basis) -> Listed | None:
    """Lists what the robot file may have wrong.

    Args:
        problem: The problem.
        points: Internal parameters (n_param,) to look at: the first where the robot rests.
        given: What is taken for granted.

    Returns:
        The doubts; None where there are none, or the robot rests nowhere.
    """
    doubts = _doubts_of(problem, given)
    nothing = np.zeros(len(doubts))
    for point in points if doubts else ():
        with suppress(DataError):
            off = put_in(problem, point, given.robot, _anywhere(given), doubts, nothing)
            return Listed(doubts, off.problem, point, bool(given.doubtful))
    return None


def _doubts_of(problem: Problem, given: Basis) -> tuple[Nuisance, ...]:
    """All doubts but those of torque constants that are estimated along, or that every value is a ratio to."""
    constants = {f"{joint.name}.torque_constant" for joint in given.robot.joints}
    listed = list_nuisances(given.robot, given.options, given.doubtful)
    if problem.frf.input_unit == _KNOWN_TORQUE:
        along = {name for name in constants if name.replace("constant", "scale") in problem.parameters.names}
        kept = (left_of_freed(doubt) if doubt.name in along else doubt for doubt in listed)
        return tuple(doubt for doubt in kept if doubt is not None)
    return tuple(doubt for doubt in listed if doubt.name not in constants)


def _anywhere(given: Basis) -> ElasticOptions:
    """Options with which the robot rests anew for all values."""
    return replace(given.options, statics="every_iterate")


def linearise(
    problem: Problem,
    doubts: tuple[Nuisance, ...],
    point: FloatArray,
    given: Basis,
    amounts: FloatArray | None = None,
    added: FloatArray | None = None,
    *,
    all_rest: bool = True,
    shifts: Shifts | None = None,
) -> Named:
    """Linearises doubts at a robot that is off by them.

    Args:
        problem: The problem of the robot that is right.
        doubts: The doubts.
        point (n_param,): Internal parameters.
        given: What is taken for granted.
        amounts (n_doubt,): By how much all is off; nothing when not given.
        added (n_place, n_doubt): What each place adds to that; nothing when not given.
        all_rest: Whether robots near it must rest; otherwise nothing is said of doubts along which they do not.
        shifts: How that robot's matrices move with doubts that are moves of it; found here when not given.

    Raises:
        DataError: If that robot does not rest, or one near it that must.
    """
    places = group_places(problem.frf.configurations)
    amounts = np.zeros(len(doubts)) if amounts is None else amounts
    added = np.zeros((len(places), len(doubts))) if added is None else added
    each = spread_over(places, added)
    off = put_in(problem, point, given.robot, _anywhere(given), doubts, amounts, each)
    where = off.problem, point, off.robot, off.options, doubts
    columns = nuisance_columns(*where, amounts=amounts, all_rest=all_rest, shifts=shifts)
    return Named(doubts, off.problem, point, bool(given.doubtful), amounts, columns, added)
