"""Doubts that a fit estimates: parameters beside springs and dampers, with wider priors."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.doubts.balances import balance_doubts
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.models.elastic.fit.doubts.drives import TorqueScale, coupling_doubts, torque_doubts
from robid.models.elastic.fit.doubts.further import further_springs, is_spring
from robid.models.elastic.fit.doubts.gear_kinds import gear_kinds
from robid.models.elastic.fit.doubts.masses import base_doubts, link_doubts, payload_doubts
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot
from robid.robot.doubts import Doubts
from robid.robot.parameters import DOUBT as DOUBT
from robid.robot.parameters import ELASTIC, FREE

PRIOR_FACTOR = 10.0
"""How many times as far off as a doubt is one expected to be that a user frees."""


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
    """Lists all doubts that a fit can estimate: what moves the robot, or scales its torques.

    Those that the file takes for granted are listed too, as far off as by default; those that are no doubt unless a fit
    frees them come last.
    """
    doubtful = replace(
        robot,
        doubts=_open(robot.doubts),
        joints=tuple(replace(joint, doubts=_open(joint.doubts)) for joint in robot.joints),
    )
    return (
        *payload_doubts(doubtful),
        *link_doubts(doubtful),
        *base_doubts(doubtful),
        *coupling_doubts(doubtful),
        *torque_doubts(doubtful),
        *balance_doubts(doubtful),
        *gear_kinds(doubtful),
    )


def names(doubt: DoubtColumn, name: str) -> bool:
    """Whether a name is that of a doubt or of its group: its cause, or its own name as far as the last underscore."""
    return name in (doubt.name, doubt.cause) or doubt.name.startswith(f"{name}_")


def free_with(free: Sequence[str], more: Sequence[str]) -> tuple[str, ...]:
    """Returns what `free` must say so that more is estimated too; the default kinds need not be named beside doubts."""
    kinds = set(ELASTIC)
    if tuple(free) == FREE and not kinds & set(more):
        return tuple(dict.fromkeys(more))
    # Beside doubts alone the default kinds are free unsaid; a kind that is named would take their place.
    unsaid = FREE if free and not kinds & set(free) and kinds & set(more) else ()
    return tuple(dict.fromkeys((*unsaid, *free, *more)))


def options_of(robot: Robot, options: ElasticOptions) -> ElasticOptions:
    """Returns the options of a fit for a robot that may carry another payload: of none, nothing is free."""
    if robot.payload.mass_kg > 0 or not any(map(_is_of_payload, options.freed)):
        return options
    return replace(
        options,
        free=(*options.kinds, *(name for name in options.freed if not _is_of_payload(name))),
        fixed=tuple(name for name in options.fixed if not _is_of_payload(name)),
        tied={name: leader for name, leader in options.tied.items() if not _is_of_payload(name)},
        bounds={name: ends for name, ends in options.bounds.items() if not _is_of_payload(name)},
    )


def _is_of_payload(name: str) -> bool:
    return name.partition(".")[0] == "payload"


def groups(doubt: DoubtColumn) -> tuple[str, ...]:
    """All names that free a doubt."""
    head, dot, kind = doubt.name.partition(".")
    return doubt.name, doubt.cause, f"{head}{dot}{kind.partition('_')[0]}"


def unknown_names(robot: Robot, options: ElasticOptions) -> list[tuple[str, str]]:
    """Returns what options free that is neither a doubt of the robot nor a spring, with what may be meant."""
    if not options.freed:
        return []
    every = movable_doubts(robot)
    unknown = [each for each in options.freed if not any(names(doubt, each) for doubt in every)]
    return [(each, _meant(robot, each, every)) for each in unknown if not is_spring(robot, each)]


def _meant(robot: Robot, wrong: str, every: Sequence[DoubtColumn]) -> str:
    """The end of a sentence about an unknown name."""
    causes = list(dict.fromkeys(doubt.cause for doubt in every))
    springs = [further.spring.name for further in further_springs(robot)]
    known = [*ELASTIC, *causes, *(name for doubt in every for name in groups(doubt)), *springs]
    turned = ".".join(reversed(wrong.split(".")))
    close = [turned] if turned in known else difflib.get_close_matches(wrong, dict.fromkeys(known), n=3, cutoff=0.5)
    if close:
        return f"did you mean {' or '.join(f'`{name}`' for name in close)}?"
    shown = ", ".join(f"`{name}`" for name in (*ELASTIC, *causes, *springs[:1]))
    return f"known are {shown}, and single doubts as `{every[0].name}`" if every else f"known are {shown}"


def torque_slopes(doubts: Sequence[DoubtColumn], n_joint: int) -> FloatArray:
    """Derivatives (n_doubt, n_joint) of the log response to each motor's torque by the amounts of doubts."""
    slopes = np.zeros((len(doubts), n_joint))
    for row, doubt in enumerate(doubts):
        if isinstance(doubt.direction, TorqueScale):
            slopes[row, doubt.direction.joint] = doubt.direction.slope
    return slopes


def moved_robot(robot: Robot, doubts: Sequence[DoubtColumn], amounts: FloatArray) -> Robot:
    """Returns a robot that is off by some amounts (n_doubt,) of doubts."""
    for doubt, amount in zip(doubts, amounts.tolist(), strict=True):
        if isinstance(doubt.direction, RobotMove) and amount:
            robot = doubt.direction.moved(robot, amount)
    return robot


def _open(doubts: Doubts) -> Doubts:
    zero = [each.name for each in fields(doubts) if not getattr(doubts, each.name)]
    return replace(doubts, **{name: getattr(Doubts(), name) for name in zero})
