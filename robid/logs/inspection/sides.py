"""Which motion of an axis is the motor's and which are behind it: by the response, then names, else a person says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np

from robid.logs.inspection.collocation import Order, find_motor, is_behind_spring
from robid.logs.inspection.roles import Comparison, Signal, derivatives

Where: TypeAlias = Literal["motor", "arm", "other"]

SIDES = {"motor": 0, "": 1, "arm": 2, "tool": 3}
"""Order of sides along an axis, as names say them."""

_EXCHANGE = "exchange them where it is the other way round, and take the marks away"


@dataclass(frozen=True)
class Place:
    """Where a motion of an axis was measured.

    Attributes:
        signal: The motion.
        side: The motor's, the first behind it, or another one.
        told: What says so.
        is_open: Whether nothing says so, so that a person has to.
    """

    signal: Signal
    side: Where
    told: tuple[str, ...] = ()
    is_open: bool = False


def find_sides(drive: Signal, own: Sequence[Signal], comparison: Comparison) -> list[Place]:
    """Finds the motor's motion among those of an axis, and puts the others behind it.

    Args:
        drive: What drives it.
        own: Its motions.
        comparison: Where signals are compared.
    """
    if len(own) == 1:
        return [_lone(drive, own[0], comparison)]
    named = sorted(own, key=lambda one: SIDES[one.hint.side])
    verdicts = _verdicts(drive, named, comparison)
    lead, why, is_open = _motor(named, verdicts)
    others = [one for one in named if one is not lead]

    def rank(one: Signal) -> tuple[int, int]:  # of two behind the motor, the one that moves the other comes first
        return SIDES[one.hint.side], sum(verdicts.get((other.name, one.name)) is not None for other in others)

    places = [Place(lead, "motor", why, is_open)]
    for index, one in enumerate(sorted(others, key=rank)):
        told = () if is_open else _behind(lead, one, verdicts.get((lead.name, one.name)))
        places.append(Place(one, "other" if index else "arm", told, is_open))
    return places


def _verdicts(drive: Signal, own: Sequence[Signal], comparison: Comparison) -> dict[tuple[str, str], Order]:
    """Where the response tells which of two motions is nearer to the drive: by the names of that one and the other."""
    found: dict[tuple[str, str], Order] = {}
    torque = comparison.spectrum(drive)
    for first, second in combinations(own, 2):
        orders = derivatives(first.role), derivatives(second.role)
        spectra = comparison.spectrum(first), comparison.spectrum(second)
        order = find_motor(torque, *spectra, (orders[0], orders[1]), comparison.step_s)
        if order is not None:
            found[(first.name, second.name) if order.first else (second.name, first.name)] = order
    return found


def _motor(named: Sequence[Signal], verdicts: Mapping[tuple[str, str], Order]) -> tuple[Signal, tuple[str, ...], bool]:
    """The motor's motion, what says so where its name does not, and whether that is left to a person."""
    for lead in named:
        others = [one for one in named if one is not lead]
        if all((lead.name, one.name) in verdicts for one in others):
            by_name = [one.name for one in named if one.hint.side == "motor" and one is not lead]
            if by_name or lead.hint.side in ("arm", "tool"):
                against = f"`{by_name[0]}`" if by_name else "another one"
                told = f"by the response `{lead.name}` is the motor's, by its name {against}: {_EXCHANGE}"
                return lead, (told,), True
            return lead, (), False
    first, second = named[:2]
    if SIDES[first.hint.side] != SIDES[second.hint.side] and not any(name == second.name for name, _ in verdicts):
        return first, (), False
    told = f"neither response nor names tell whether `{first.name}` or `{second.name}` is the motor's: {_EXCHANGE}"
    return first, (told,), True


def _behind(motor: Signal, one: Signal, verdict: Order | None) -> tuple[str, ...]:
    if one.hint.side and motor.hint.side:
        return ()
    if verdict is None:
        return (f"taken for a side behind `{motor.name}` by the names alone: the response does not tell",)
    at = (
        f" on which `{motor.name}` stands still at {verdict.antiresonance / (2 * np.pi):.3g} Hz"
        if verdict.is_seen
        else ""
    )
    return (f"taken for the load's side: by the response it moves behind a spring{at}",)


def _lone(drive: Signal, one: Signal, comparison: Comparison) -> Place:
    """A motion without another one to compare with."""
    behind = is_behind_spring(
        comparison.spectrum(drive), comparison.spectrum(one), derivatives(one.role), comparison.step_s
    )
    by_name = one.hint.side
    if behind and by_name == "motor":
        told = f"its name says the motor's side, but it turns against `{drive.name}` behind a resonance, as a load does"
        return Place(one, "motor", (f"{told}: add `.arm` to its name if it is, and take the mark away",), is_open=True)
    if behind and not by_name:
        return Place(one, "arm", (f"taken for the load's side: it turns against `{drive.name}` behind a resonance",))
    return Place(one, "arm" if by_name in ("arm", "tool") else "motor")
