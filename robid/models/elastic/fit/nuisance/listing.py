"""The nuisance parameters of one robot and fit: those that widen its intervals, and those that it estimates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from robid.models.elastic.fit.nuisance.effects import (
    STICKS,
    Hysteresis,
    Nuisance,
    PerturbedRobot,
    RigidError,
    TorqueScale,
)
from robid.models.elastic.fit.nuisance.kinds import ESTIMABLE, HYSTERESIS, LINKS, WIDENING
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot


def list_nuisances(robot: Robot, options: ElasticOptions, rigid: Sequence[PerturbedRobot] = ()) -> tuple[Nuisance, ...]:
    """Lists the nuisance parameters of a robot file with the priors that it states.

    What the fit estimates is none: springs, dampers, rotor inertias, viscous friction, delay, cubic gears, nuisance
    parameters that are estimated and not fixed.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit.
        rigid: Robots that are off along the independent directions that a rigid fit leaves open, which take the place
            of the file's links.
    """
    estimated = {each.name for each in estimated_nuisances(robot, options)}.difference(options.fixed)
    return tuple(_left(_widening(robot, options, rigid), estimated))


def _widening(robot: Robot, options: ElasticOptions, rigid: Sequence[PerturbedRobot]) -> Iterator[Nuisance]:
    for section in WIDENING:
        if rigid and section is LINKS:
            for number, off in enumerate(rigid, start=1):
                title = f"error {number} of the rigid fit"
                yield Nuisance(f"rigid.{number}", title, "masses", "std", 1.0, 0.0, RigidError(off))
            continue
        owners, kinds = section
        for owner in owners(robot):
            for kind in kinds:
                own = bool(kind.parameter) and options.estimates(kind.parameter, owner.named(kind.parameter))
                found = None if own else kind.of(robot, owner)
                if found is not None and rigid and isinstance(found.effect, TorqueScale):
                    found = replace(found, effect=replace(found.effect, shared=True))
                if found is not None:
                    yield found


def _left(every: Iterable[Nuisance], estimated: set[str]) -> Iterator[Nuisance]:
    for each in every:
        gear = f"{each.name.rpartition('.')[0]}.{HYSTERESIS}"
        left = left_of_estimated(each) if each.name in estimated else each
        if left is not None and not (isinstance(each.effect, Hysteresis) and gear in estimated):
            yield left


def left_of_estimated(nuisance: Nuisance) -> Nuisance | None:
    """What is left once a fit estimates one: of a torque constant, masses that the same torques gave."""
    effect = nuisance.effect
    if not isinstance(effect, TorqueScale) or not effect.shared:
        return None
    name, title = f"{nuisance.name.rpartition('.')[0]}.mass_by_torque", f"mass by {nuisance.title}"
    return replace(nuisance, name=name, title=title, cause="masses", cluster_std=0.0, effect=effect.heavier)


def estimable_nuisances(robot: Robot) -> tuple[Nuisance, ...]:
    """Lists all that a fit can estimate; what the file takes for granted is as far off as by default."""
    every = (
        kind.of(robot, owner, by_default=True)
        for owners, kinds in ESTIMABLE
        for owner in owners(robot)
        for kind in kinds
    )
    return tuple(each for each in every if each is not None)


def estimated_nuisances(robot: Robot, options: ElasticOptions) -> tuple[Nuisance, ...]:
    """Lists those that a fit estimates, each as often as it is named.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit; what they name that the robot does not have is left out.
    """
    if not options.estimated:
        return ()
    return tuple(each for each in estimable_nuisances(robot) if any(names(each, name) for name in options.estimated))


def names(nuisance: Nuisance, name: str) -> bool:
    """Whether a name is its own, or of its group: its cause, or its name as far as the last underscore."""
    return name in (nuisance.name, nuisance.cause) or nuisance.name.startswith(f"{name}_")


def slipping_name(nuisance: Nuisance) -> str | None:
    """Name of what frees the hysteresis that one stands for; None of others, and of bristles that stick."""
    effect = nuisance.effect
    if not isinstance(effect, Hysteresis) or effect.slip == STICKS:
        return None
    return f"{nuisance.name.rpartition('.')[0]}.{HYSTERESIS}"
