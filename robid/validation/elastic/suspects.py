"""What a robot file may have wrong by a little, for score tests: the fit's own doubts, each with its column."""

from __future__ import annotations

from dataclasses import dataclass

from robid.arrays import ComplexArray
from robid.fit.elastic.doubts.column import DoubtColumn
from robid.fit.elastic.doubts.listing import list_doubts
from robid.fit.elastic.doubts.scene import Scene
from robid.fit.elastic.options import ElasticOptions
from robid.robot.description import Robot
from robid.validation.elastic.fitted import FittedModel

_TESTED = ("payload", "masses", "torque_constant", "gear_nonlinearity", "arm_friction", "friction")
_FINER = ("com_x", "com_y", "com_z", "inertia")  # of a body whose mass is tested


@dataclass(frozen=True)
class Suspect:
    """Something that may be off, with what it does to the response.

    Attributes:
        doubt: What it is, with the amounts that make sense.
        column (n_conf, n_freq, n_out, n_in): Derivative of the log response by the amount.
    """

    doubt: DoubtColumn
    column: ComplexArray


def suspects(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Suspect]:
    """Lists what may be off in a robot file, linearised at a fitted model.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of its response.
        options: Options of the fit.
    """
    scene = Scene(fitted.problem, fitted.internal, robot, options)
    tested = [doubt for doubt in list_doubts(robot, options) if _is_tested(doubt)]
    return [Suspect(doubt, doubt.direction.column(scene)) for doubt in tested]


def _is_tested(doubt: DoubtColumn) -> bool:
    """Whether a doubt is one of few of its cause; missing springs are tried one by one, in place."""
    of_link = doubt.cause == "masses" or doubt.name == "payload.inertia"
    return doubt.cause in _TESTED and not (of_link and doubt.name.endswith(_FINER))
