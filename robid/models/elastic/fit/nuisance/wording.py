"""How nuisance parameters are named in `free`, and what is said of names: what frees them, what may be meant."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from robid.models.elastic.fit.nuisance.effects import (
    Drift,
    LateDrive,
    LoadFriction,
    LoadStiffness,
    Nuisance,
    OneSided,
    RobotMove,
    TorqueScale,
    ValueOff,
)
from robid.models.elastic.fit.nuisance.kinds import FIXED, HYSTERESIS, LOAD_FRICTION
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances, names, slipping_name
from robid.models.elastic.fit.nuisance.moves import further_springs, is_spring
from robid.models.elastic.fit.options import ElasticOptions, restricted
from robid.robot.description import Robot
from robid.robot.parameters import ELASTIC, FREE

_FEW = 2
_KINDS = {"rotor_inertia": "motor_inertia", "delay": "delay"}
"""Kinds of parameters that stand for a cause."""
_ALWAYS_WHOLE = ("payload",)
_BY_NAME = LateDrive, OneSided, Drift
"""Effects that only act where a fit frees them, each by its own name."""


def free_with(free: Sequence[str], more: Sequence[str]) -> tuple[str, ...]:
    """Returns what `free` must say so that more is estimated; beside nuisances the default kinds need not be named."""
    kinds = set(ELASTIC)
    if tuple(free) == FREE and not kinds & set(more):
        return tuple(dict.fromkeys(more))
    # Beside nuisances alone the default kinds are free unsaid; a kind that is named would take their place.
    unsaid = FREE if free and not kinds & set(free) and kinds & set(more) else ()
    return tuple(dict.fromkeys((*unsaid, *free, *more)))


def options_of(robot: Robot, options: ElasticOptions) -> ElasticOptions:
    """Returns the options of a fit for a robot that may carry another payload: of none, nothing is free."""

    def keeps(name: str) -> bool:
        return name.partition(".")[0] != "payload"

    if robot.payload.mass_kg > 0 or all(map(keeps, options.estimated)):
        return options
    return restricted(options, (*options.kinds, *filter(keeps, options.estimated)), keeps)


def unknown_names(robot: Robot, options: ElasticOptions) -> list[tuple[str, str]]:
    """Returns what options free that is no nuisance parameter of the robot and no spring, with what may be meant."""
    if not options.estimated:
        return []
    every = estimable_nuisances(robot)
    unknown = [each for each in options.estimated if not any(names(nuisance, each) for nuisance in every)]
    return [(each, _meant(robot, each, every)) for each in unknown if not is_spring(robot, each)]


def _meant(robot: Robot, wrong: str, every: Sequence[Nuisance]) -> str:
    """The end of a sentence about an unknown name."""
    causes = list(dict.fromkeys(nuisance.cause for nuisance in every))
    springs = [further.spring.name for further in further_springs(robot)]
    known = [*ELASTIC, *causes, *(name for nuisance in every for name in _groups(nuisance)), *springs]
    turned = ".".join(reversed(wrong.split(".")))
    close = [turned] if turned in known else difflib.get_close_matches(wrong, dict.fromkeys(known), n=3, cutoff=0.5)
    if close:
        return f"did you mean {' or '.join(f'`{name}`' for name in close)}?"
    shown = ", ".join(f"`{name}`" for name in (*ELASTIC, *causes, *springs[:1]))
    return f"known are {shown}, and single nuisances as `{every[0].name}`" if every else f"known are {shown}"


def _groups(nuisance: Nuisance) -> tuple[str, ...]:
    """All names that free one."""
    head, dot, kind = nuisance.name.partition(".")
    return nuisance.name, nuisance.cause, f"{head}{dot}{kind.partition('_')[0]}"


def remedy(nuisances: Sequence[Nuisance], *, swings_known: bool) -> tuple[str, ...]:
    """Returns the names that free nuisances of one cause: each, or their cause where they are many.

    Args:
        nuisances: What would explain a misfit, the one that explains most first.
        swings_known: Whether the response tells how far the gears swing, without which no hysteresis can be estimated.
    """
    cause, effect = nuisances[0].cause, nuisances[0].effect
    if isinstance(effect, LoadFriction):
        by_load = (each.name.partition(LOAD_FRICTION)[0] for each in nuisances if isinstance(each.effect, LoadFriction))
        return tuple(dict.fromkeys(f"{joint}{LOAD_FRICTION}" for joint in by_load))
    if isinstance(effect, _BY_NAME):
        return tuple(nuisance.name for nuisance in nuisances if isinstance(nuisance.effect, _BY_NAME))
    if cause in _KINDS:
        return (_KINDS[cause],)
    if isinstance(effect, ValueOff) and cause != FIXED:
        return (effect.kind,)
    if cause == FIXED:
        return tuple(
            dict.fromkeys(nuisance.effect.kind for nuisance in nuisances if isinstance(nuisance.effect, ValueOff))
        )
    if isinstance(effect, LoadStiffness) and swings_known:
        return ("cubic",)  # gears that stiffen, as loads and swings bend them
    slipping = tuple(dict.fromkeys(filter(None, map(slipping_name, nuisances))))
    if slipping_name(nuisances[0]) is not None and swings_known:
        return slipping if len(slipping) <= _FEW else (HYSTERESIS,)
    if not all(isinstance(nuisance.effect, RobotMove | TorqueScale) for nuisance in nuisances):
        return ()
    many = len(nuisances) > _FEW or cause in _ALWAYS_WHOLE
    return (cause,) if many else tuple(nuisance.name for nuisance in nuisances)
