"""Angles and counters that start again after a turn or at the end of their range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray

_TURN = {"deg": 360.0, "rad": 2 * np.pi, "mrad": 2e3 * np.pi, "urad": 2e6 * np.pi, "turn": 1.0}
_TURN |= {"gon": 400.0, "arcmin": 21600.0, "arcsec": 1296000.0}
"""A turn in the units that a log may state."""

_UNSTATED = ("deg", "rad", "turn")
_COUNTED = (1.0, 1.6, 1.8, 2.0, 2.5, 3.2, 3.6, 4.0, 5.0, 6.4, 7.2, 8.0)
"""Counts of a turn, but for powers of ten, that encoders have beside powers of two."""

_FASTEST = 0.25
"""Turns from sample to sample up to which a jump is told from a motion."""

_ODD = 0.1
"""Share of the jumps by which others may be there, as where samples are missing."""

_SMOOTH = 5.0
"""How much more the speed may change at a jump, once that is taken out, than it does elsewhere at most."""


@dataclass(frozen=True)
class Wrap:
    """How a signal wraps.

    Attributes:
        size: The range that it starts again after, in its own numbers.
        unit: Unit of which that is a turn; `counts` of counts.
        count: How often it does.
    """

    size: float
    unit: str
    count: int


def find_wrap(values: FloatArray, unit: str) -> Wrap | None:
    """Finds the range of an angle or a counter that starts again; None where it does not, or that is not told.

    Args:
        values (n_sample,): The signal, NaN where samples are missing.
        unit: Its unit, as far as the log states one.
    """
    kept = values[np.isfinite(values)]
    if len(kept) < 3 or np.ptp(kept) == 0:
        return None
    steps = np.diff(kept)
    span = float(np.ptp(kept))
    if np.abs(steps).max() < (1 - 2 * _FASTEST) * span:
        return None
    found = [(one, _roughness(steps, span, one.size)) for one in _candidates(unit, span, kept)]
    told = [(rough, one.size, one) for one, rough in found if rough is not None]
    if not told:
        return None
    # Of ranges that do, the one that leaves the smoothest motion; a power of two before its neighbours.
    _, _, best = min(told)
    return Wrap(best.size, best.unit, int(np.count_nonzero(np.abs(steps) > best.size / 2)))


def unwrapped(values: FloatArray, size: float) -> FloatArray:
    """Returns a signal (n_sample,) without its jumps by a range, NaN left where they are."""
    made = np.array(values, float)
    finite = np.isfinite(made)
    made[finite] = np.unwrap(made[finite], period=size)
    return made


def _candidates(unit: str, span: float, values: FloatArray) -> list[Wrap]:
    if unit in _TURN:
        return [Wrap(_TURN[unit], unit, 0)]
    if unit and unit != "counts":
        return []
    made = [] if unit else [Wrap(_TURN[one], one, 0) for one in _UNSTATED]
    if unit == "counts" or bool(np.all(values == np.round(values))):
        sizes = {2.0**power for power in range(7, 33)} | {
            part * 10.0**power for power in range(2, 9) for part in _COUNTED
        }
        known = [one.size for one in made]
        made += [Wrap(one, "counts", 0) for one in sorted(sizes) if span <= one < 1.5 * span + 2 and one not in known]
    return made


def _roughness(steps: FloatArray, span: float, size: float) -> float | None:
    """How much a speed changes at jumps by a range at most, once they are taken out; None where it is no such range."""
    if span > size * (1 + 1e-6):
        return None
    jumps = np.abs(steps) > size / 2
    rest = steps - size * np.round(steps / size)
    odd = np.abs(rest) > _FASTEST * size
    if np.count_nonzero(odd) > _ODD * np.count_nonzero(jumps) or not jumps.any():
        return None
    changes = np.abs(np.diff(rest))
    beside = jumps[1:] | jumps[:-1]
    plain = ~(beside | odd[1:] | odd[:-1])
    usual = float(changes[plain].max(initial=0.0)) if plain.any() else float(np.abs(rest).max())
    at_jumps = float(np.median(changes[beside]))
    return at_jumps if at_jumps <= _SMOOTH * max(usual, 1e-9 * size) else None
