"""Doubts that a fit estimates: parameters beside springs and dampers, with wider priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

from robid.arrays import FloatArray
from robid.fit.elastic.doubts.column import DoubtColumn, RobotMove
from robid.fit.elastic.doubts.drives import coupling_doubts
from robid.fit.elastic.doubts.masses import link_doubts, payload_doubts
from robid.fit.elastic.options import ElasticOptions
from robid.robot.description import Robot
from robid.robot.doubts import Doubts

PRIOR_FACTOR = 10.0
"""How many times as far off as a doubt is one expected to be that a user frees."""
DOUBT = "doubt"
"""Kind of the parameters that are doubts."""


def freed_doubts(robot: Robot, options: ElasticOptions) -> tuple[DoubtColumn, ...]:
    """Lists the doubts that a fit estimates, each as often as it is named.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit; what they name that is no doubt of the robot is left out.
    """
    if not options.freed:
        return ()
    return tuple(doubt for doubt in movable_doubts(robot) if any(names(doubt, name) for name in options.freed))


def movable_doubts(robot: Robot) -> tuple[DoubtColumn, ...]:
    """Lists all doubts that a fit can estimate; those that the file takes for granted too, as far off as by default."""
    doubtful = replace(
        robot,
        doubts=_open(robot.doubts),
        joints=tuple(replace(joint, doubts=_open(joint.doubts)) for joint in robot.joints),
    )
    return (*payload_doubts(doubtful), *link_doubts(doubtful), *coupling_doubts(doubtful))


def names(doubt: DoubtColumn, name: str) -> bool:
    """Whether a name is that of a doubt or of its group: its cause, or its own name as far as the last underscore."""
    return name in (doubt.name, doubt.cause) or doubt.name.startswith(f"{name}_")


def groups(doubt: DoubtColumn) -> tuple[str, ...]:
    """All names that free a doubt."""
    head, dot, kind = doubt.name.partition(".")
    return doubt.name, doubt.cause, f"{head}{dot}{kind.partition('_')[0]}"


def unknown_names(robot: Robot, options: ElasticOptions) -> list[str]:
    """Returns what options free that neither is a doubt of the robot nor one of its springs."""
    every = movable_doubts(robot) if options.freed else ()
    springs = {spring.name for spring in robot.springs}
    return [each for each in options.freed if each not in springs and not any(names(doubt, each) for doubt in every)]


def known_names(robot: Robot) -> list[str]:
    """Returns every name of a doubt, or of a group of them, that can be freed."""
    return list(dict.fromkeys(name for doubt in movable_doubts(robot) for name in groups(doubt)))


def moved_robot(robot: Robot, doubts: Sequence[DoubtColumn], amounts: FloatArray) -> Robot:
    """Returns a robot that is off by some amounts (n_doubt,) of doubts."""
    for doubt, amount in zip(doubts, amounts.tolist(), strict=True):
        if isinstance(doubt.direction, RobotMove) and amount:
            robot = doubt.direction.moved(robot, amount)
    return robot


def _open(doubts: Doubts) -> Doubts:
    zero = [each.name for each in fields(doubts) if not getattr(doubts, each.name)]
    return replace(doubts, **{name: getattr(Doubts(), name) for name in zero})
