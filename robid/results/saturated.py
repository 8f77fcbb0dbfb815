"""Doubts about responses whose signals lie at a limit."""

from __future__ import annotations

from collections.abc import Mapping

from robid.arrays import FloatArray
from robid.frf.saturation import SATURATED_SHARE, saturation_error
from robid.results.doubt import Doubt, two_digits

_CLIPPED = 0.05
"""Share of the time from which a response that may be off by as much must not be used."""


def saturation_doubts(signals: Mapping[str, FloatArray]) -> tuple[Doubt, ...]:
    """Doubts signals that saturate: where the log has clipped them, that counts.

    Args:
        signals: Share of the time (n_conf,) in which each saturates, 0 where it does not, by what it is.
    """
    doubts = []
    for name, share in signals.items():
        worst = float(share.max(initial=0.0))
        if worst > 0:
            off = f"{two_digits(100 * saturation_error(worst))} %"
            share_told = f"{name} saturates for {two_digits(100 * worst)} % of the time"
            told = f"{share_told}, which may put its responses off by {off} and more"
            doubts.append(Doubt("saturation", told, decisive=worst > _CLIPPED, strength=1 + worst / SATURATED_SHARE))
    return tuple(doubts)
