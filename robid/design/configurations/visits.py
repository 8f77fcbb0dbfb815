"""What visits to candidates add up to, where parameters differ between places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.clusters.evidence import saturate, saturation_slope

_CHUNK = 256


@dataclass(frozen=True)
class Visits:
    """What visits to each candidate add.

    Attributes:
        alone (n_draw, n_cand, n_part, n_all, n_all): One visit, were all places alike: the information, or bread and
            meat of a fit with weights of its own. Of n visits it is n times as much.
        between (n_all,): Variance of each parameter between places; 0 for what all of them share.
        once (n_draw, n_cand, n_part, n_all, n_all): One visit, what differs between places allowed for.
    """

    alone: FloatArray
    between: FloatArray
    once: FloatArray

    def take(self, candidates: IntArray) -> Visits:
        """The same of some candidates."""
        return Visits(self.alone[:, candidates], self.between, self.once[:, candidates])

    def scaled(self, scale: FloatArray) -> Visits:
        """The same over scales (n_all,) of the parameters."""
        unit = scale[:, None] * scale
        return Visits(self.alone / unit, self.between * scale**2, self.once / unit)

    def of(self, candidates: IntArray, counts: IntArray) -> FloatArray:
        """What numbers of visits (n_some,) to some candidates add (n_draw, n_some, n_part, n_all, n_all)."""
        found = self.once[:, candidates] * counts[:, None, None, None]
        more = counts > 1
        if self.between.any() and more.any():
            found[:, more] = _allowed(self.alone[:, candidates[more]] * counts[more, None, None, None], self.between)
        return np.asarray(found)

    def total(self, counts: IntArray) -> FloatArray:
        """What numbers of visits (n_cand,) add together (n_draw, n_part, n_all, n_all)."""
        used = np.flatnonzero(counts)
        if not self.between.any():
            return np.asarray(np.tensordot(self.once[:, used], counts[used], (1, 0)))
        return np.asarray(self.of(used, counts[used]).sum(axis=1))

    def more(self, candidates: IntArray, counts: IntArray) -> FloatArray:
        """What one visit more of some candidates adds to numbers of visits (n_cand,)."""
        found, again = self.once[:, candidates], np.flatnonzero(counts[candidates])
        if self.between.any() and again.size:
            visited = candidates[again]
            found[:, again] = self.of(visited, counts[visited] + 1) - self.of(visited, counts[visited])
        return np.asarray(found)


def make_visits(alone: FloatArray, between: FloatArray) -> Visits:
    """Allows for what differs between places.

    Args:
        alone (n_draw, n_cand, n_part, n_all, n_all): One visit, were all places alike.
        between (n_all,): Variance of each parameter between places.

    Source:
        docs/methods, sec. 11: `(I^-1 + T)^-1` in place of the information; the scores of a fit with weights of its own
        vary by `B T B` more.
    """
    if not between.any():
        return Visits(alone, between, alone)
    once = np.empty_like(alone)
    for begin in range(0, alone.shape[1], _CHUNK):
        part = slice(begin, begin + _CHUNK)
        once[:, part] = _allowed(alone[:, part], between)
    return Visits(alone, between, once)


def slopes(alone: FloatArray, counts: IntArray, between: FloatArray) -> FloatArray:
    """Derivative of the information of numbers of visits (n_cand,) by these numbers.

    Args:
        alone (n_draw, n_cand, n_all, n_all): Information of one visit, were all places alike.
        counts (n_cand,): Numbers of visits, at least one each.
        between (n_all,): Variance of each parameter between places.
    """
    times = counts[:, None, None]
    return np.asarray(saturation_slope(alone * times, between) / times)


def _allowed(parts: FloatArray, between: FloatArray) -> FloatArray:
    if parts.shape[2] == 1:
        return saturate(parts, between)
    bread, meat = parts[:, :, 0], parts[:, :, 1]
    return np.stack([bread, meat + (bread * between) @ bread], axis=2)
