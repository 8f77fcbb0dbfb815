"""What to write into the settings of a fit so that it estimates what would explain its misfit."""

from __future__ import annotations

from collections.abc import Sequence

from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.models.elastic.fit.doubts.drives import TorqueScale, ViscousFriction
from robid.models.elastic.fit.doubts.gear_kinds import HYSTERESIS
from robid.models.elastic.fit.doubts.gears import slipping_name
from robid.models.elastic.fit.doubts.held import HELD, HeldSpring

_FEW = 2
_KINDS = {"rotor_inertia": "motor_inertia", "delay": "delay"}
"""Kinds of parameters that stand for a cause."""
_ALWAYS_WHOLE = ("payload",)


def remedy(doubts: Sequence[DoubtColumn], *, swings_known: bool) -> tuple[str, ...]:
    """Returns the names that free doubts of one cause: each, or their cause where they are many.

    Args:
        doubts: What would explain a misfit, the one that explains most first.
        swings_known: Whether the response tells how far the gears swing, without which no hysteresis can be freed.
    """
    cause = doubts[0].cause
    if cause in _KINDS:
        return (_KINDS[cause],)
    if isinstance(doubts[0].direction, ViscousFriction):
        return (doubts[0].direction.kind,)
    if cause == HELD:
        return tuple(dict.fromkeys(doubt.direction.kind for doubt in doubts if isinstance(doubt.direction, HeldSpring)))
    slipping = tuple(dict.fromkeys(filter(None, map(slipping_name, doubts))))
    if slipping_name(doubts[0]) is not None and swings_known:
        return slipping if len(slipping) <= _FEW else (HYSTERESIS,)
    if not all(isinstance(doubt.direction, RobotMove | TorqueScale) for doubt in doubts):
        return ()
    many = len(doubts) > _FEW or cause in _ALWAYS_WHOLE
    return (cause,) if many else tuple(doubt.name for doubt in doubts)
