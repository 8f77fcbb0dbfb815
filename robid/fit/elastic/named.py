"""The doubts of a robot file that a fit carries along, as further columns of its problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.fit.elastic.considered import DoubtfulRobot
from robid.fit.elastic.doubts.column import DoubtColumn
from robid.fit.elastic.doubts.columns import doubt_columns
from robid.fit.elastic.doubts.drives import left_of_freed
from robid.fit.elastic.doubts.listing import list_doubts
from robid.fit.elastic.doubts.off import are_put_in, may_differ, put_in
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.problem import Problem
from robid.places.grouping import group_places, spread_over
from robid.robot.description import Robot

_KNOWN_TORQUE = "N m"


@dataclass(frozen=True)
class Named:
    """Doubts with what they do to the residual.

    Attributes:
        doubts: The doubts.
        problem: The fit's problem, whose robot rests anew for all values: a spring must give under gravity as a link
            weighs, or what acts alike seems to be told apart.
        point (n_param,): Internal parameters where all is linearised.
        amounts (n_doubt,): By how much all is off where it is linearised; the problem's robot is, along doubts that can
            be put into one.
        columns (n_conf, n_freq, n_out, n_in, n_doubt): Negative derivatives of the residual by their amounts.
        rigid: Whether a rigid fit says how far masses may be off.
        added (n_place, n_doubt): What each place adds to the amounts there; the problem's gears have it already.
    """

    doubts: tuple[DoubtColumn, ...]
    problem: Problem
    point: FloatArray
    amounts: FloatArray
    columns: ComplexArray
    rigid: bool
    added: FloatArray

    @cached_property
    def places(self) -> list[list[int]]:
        """Indices of the configurations of each place."""
        return group_places(self.problem.frf.configurations)

    @property
    def error(self) -> ComplexArray:
        """What is left (n_conf, n_freq, n_out, n_in) at the point by the amounts alone: without what places add."""
        error = self.problem.residual(self.point, self.problem.model_response(self.point))
        without = self.added * may_differ(self.doubts) - self.amounts * ~are_put_in(self.doubts)
        for place, own in zip(self.places, without, strict=True):
            error[place] += self.columns[place] @ own
        return error

    @property
    def common_std(self) -> FloatArray:
        """Deviation (n_doubt,) of the amounts that all places share."""
        return np.array([doubt.common_std for doubt in self.doubts])

    @property
    def place_std(self) -> FloatArray:
        """Deviation (n_doubt,) of what each place adds."""
        return np.array([doubt.place_std for doubt in self.doubts])

    @property
    def least_shift(self) -> FloatArray:
        """Smallest shift (n_param + n_doubt,) of parameters and amounts from here that makes sense."""
        least = np.array([doubt.least for doubt in self.doubts]) - self.amounts
        return np.concatenate([np.full(self.point.size, -np.inf), least])


@dataclass(frozen=True)
class Suspicion:
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


def name_doubts(problem: Problem, points: Sequence[FloatArray], given: Suspicion) -> Named | None:
    """Lists what the robot file may have wrong and linearises it.

    A torque constant that is estimated along, or that every value is a ratio to, is none of them.

    Args:
        problem: The problem.
        points: Internal parameters (n_param,) to linearise at: the first where the robot and those near it rest.
        given: What is taken for granted.

    Returns:
        The doubts; None where there are none, or the robot rests nowhere.
    """
    constants = {f"{joint.name}.torque_constant" for joint in given.robot.joints}
    listed = list_doubts(given.robot, given.options, given.doubtful)
    if problem.frf.input_unit == _KNOWN_TORQUE:
        along = {name for name in constants if name.replace("constant", "scale") in problem.parameters.names}
        kept = (left_of_freed(doubt) if doubt.name in along else doubt for doubt in listed)
        doubts = tuple(doubt for doubt in kept if doubt is not None)
    else:
        doubts = tuple(doubt for doubt in listed if doubt.name not in constants)
    for point in points if doubts else ():
        try:
            return linearise(problem, doubts, point, given)
        except DataError:
            continue
    return None


def linearise(
    problem: Problem,
    doubts: tuple[DoubtColumn, ...],
    point: FloatArray,
    given: Suspicion,
    amounts: FloatArray | None = None,
    added: FloatArray | None = None,
    *,
    all_rest: bool = True,
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

    Raises:
        DataError: If that robot does not rest, or one near it that must.
    """
    places = group_places(problem.frf.configurations)
    amounts = np.zeros(len(doubts)) if amounts is None else amounts
    added = np.zeros((len(places), len(doubts))) if added is None else added
    each = spread_over(places, added)
    off = put_in(problem, point, given.robot, replace(given.options, statics="every_iterate"), doubts, amounts, each)
    columns = doubt_columns(off.problem, point, off.robot, off.options, doubts, all_rest=all_rest)
    return Named(doubts, off.problem, point, amounts, columns, bool(given.doubtful), added)
