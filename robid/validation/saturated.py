"""Doubts about responses whose signals lie at a limit."""

from __future__ import annotations

from collections.abc import Sequence

from robid.arrays import FloatArray
from robid.frf.saturation import SATURATED_SHARE, saturation_error
from robid.validation.doubt import Doubt, two_digits

_CLIPPED = 0.05
"""Share of the time from which a response that may be off by as much must not be used."""


def saturation_doubts(names: Sequence[str], share: FloatArray) -> tuple[Doubt, ...]:
    """Doubts inputs whose signals, or what was measured of them, saturate: where the log has clipped them, that counts.

    Args:
        names: Names of the inputs.
        share (n_conf, n_in): Share of the time in which each saturates, 0 where it does not.
    """
    doubts = []
    for name, worst in zip(names, share.max(axis=0).tolist(), strict=True):
        if worst > 0:
            off = f"{two_digits(100 * saturation_error(worst))} %"
            told = (
                f"{name}: its signals saturate for {two_digits(100 * worst)} % of the time, which may put its response"
                f" off by {off} and more"
            )
            doubts.append(Doubt("saturation", told, decisive=worst > _CLIPPED, strength=1 + worst / SATURATED_SHARE))
    return tuple(doubts)
