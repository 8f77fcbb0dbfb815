"""The doubts of a robot file that a fit carries along, as further columns of its problem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.fit.elastic.considered import DoubtfulRobot
from robid.fit.elastic.doubts.column import DoubtColumn, RobotMove
from robid.fit.elastic.doubts.columns import doubt_columns
from robid.fit.elastic.doubts.drives import left_of_freed
from robid.fit.elastic.doubts.listing import list_doubts
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.parameters import map_parameters
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.rest_model import rest_model
from robid.robot.description import Robot
from robid.robot.response import nominal_parameters

_KNOWN_TORQUE = "N m"


@dataclass(frozen=True)
class Named:
    """Doubts with what they do to the residual.

    Attributes:
        doubts: The doubts.
        problem: The fit's problem, whose robot rests anew for all values: a spring must give under gravity as a link
            weighs, or what acts alike seems to be told apart.
        point (n_param,): Internal parameters where all is linearised.
        amounts (n_doubt,): By how much the problem's robot is off along each doubt already.
        columns (n_conf, n_freq, n_out, n_in, n_doubt): Negative derivatives of the residual by their amounts.
        rigid: Whether a rigid fit says how far masses may be off.
    """

    doubts: tuple[DoubtColumn, ...]
    problem: Problem
    point: FloatArray
    amounts: FloatArray
    columns: ComplexArray
    rigid: bool

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
            return linearise(doubts, move(problem, doubts, point, np.zeros(len(doubts)), given), given)
        except DataError:
            continue
    return None


@dataclass(frozen=True)
class Moved:
    """A robot that is off by its doubts.

    Attributes:
        robot: The robot.
        problem: The fit's problem, with that robot at rest.
        point (n_param,): Internal parameters.
        amounts (n_doubt,): By how much it is off; zero along doubts that are no move of a robot.
    """

    robot: Robot
    problem: Problem
    point: FloatArray
    amounts: FloatArray


def move(
    problem: Problem, doubts: Sequence[DoubtColumn], point: FloatArray, amounts: FloatArray, given: Suspicion
) -> Moved:
    """Puts doubts into a robot that rests anew.

    Args:
        problem: The problem.
        doubts: The doubts.
        point (n_param,): Internal parameters.
        amounts (n_doubt,): By how much it is off.
        given: What is taken for granted.

    Raises:
        DataError: If that robot does not rest.
    """
    off = amounts * np.array([isinstance(doubt.direction, RobotMove) for doubt in doubts])
    robot, frf = given.robot, problem.frf
    for doubt, amount in zip(doubts, off.tolist(), strict=True):
        if isinstance(doubt.direction, RobotMove) and amount:
            robot = doubt.direction.moved(robot, amount)
    values, resting = problem.parameters.parameters(point), replace(given.options, statics="every_iterate")
    model = rest_model(robot, frf, resting, float(values.delay[0]), values)
    nominal = nominal_parameters(robot, model, float(problem.parameters.nominal.delay[0]))
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, nominal, given.options, *known)
    return Moved(robot, replace(problem, model=model, parameters=parameters), point, off)


def linearise(doubts: tuple[DoubtColumn, ...], at: Moved, given: Suspicion) -> Named:
    """Linearises doubts at a robot that is off by them.

    Raises:
        DataError: If a robot near it does not rest.
    """
    columns = doubt_columns(at.problem, at.point, at.robot, given.options, doubts)
    return Named(doubts, at.problem, at.point, at.amounts, columns, bool(given.doubtful))
