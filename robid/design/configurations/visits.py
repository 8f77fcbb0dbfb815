"""What visits to candidates add up to: where parameters differ between clusters, and in a fit with its own weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.clusters.evidence import saturate, saturation_slope

_CHUNK = 256


@dataclass(frozen=True)
class Visits:
    """What visits to each candidate add."""

    # (n_draw, n_cand, n_part, n_all, n_all) One visit, were all configurations alike: the information, or bread and
    # meat of a fit with weights of its own. Of n visits it is n times as much
    alone: FloatArray
    between: FloatArray  # (n_all,) Variance of each parameter between configurations; 0 for what all of them share
    # (n_draw, n_cand, n_part, n_all, n_all) One visit, what differs between configurations allowed for
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
            # Of n visits to one configuration (I^-1 / n + T)^-1: it saturates at T^-1.
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
            # One visit more where some are: the difference of two saturated informations.
            found[:, again] = self.of(visited, counts[visited] + 1) - self.of(visited, counts[visited])
        return np.asarray(found)


def make_visits(alone: FloatArray, between: FloatArray) -> Visits:
    """Allows for what differs between configurations, by the arguments of `Visits`.

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
    """Derivative of the information of numbers of visits (n_cand,), at least one each, by these numbers.

    The information of one visit alone is (n_draw, n_cand, n_all, n_all), the variance between configurations (n_all,).
    """
    times = counts[:, None, None]
    return np.asarray(saturation_slope(alone * times, between) / times)


def _allowed(parts: FloatArray, between: FloatArray) -> FloatArray:
    if parts.shape[2] == 1:
        return saturate(parts, between)
    # Scores of a fit with its own weights vary by B T B between clusters, besides what the meat has.
    bread, meat = parts[:, :, 0], parts[:, :, 1]
    return np.stack([bread, meat + (bread * between) @ bread], axis=2)


_LEAST = 1e-12
"""What nuisances without any effect are known by, so that they can be taken out; relative to one candidate's."""


@dataclass(frozen=True)
class FittedInformation:
    """What a fit with weights of its own makes of each candidate: parts of sums over the configurations of the fit.

    The parameters are the wanted ones and then those that are estimated along. These are the same in all
    configurations, so they go out of the sums, not of the single candidates, and what is known of them counts once.
    """

    bread: FloatArray  # (n_draw, n_conf, n_all, n_all) `2 Re J^H W J`
    # (n_draw, n_conf, n_all, n_all) `2 Re J^H W Lambda W J`; the covariance of the fit is `B^-1 S B^-1` of the sums,
    # what is known beforehand added to both
    meat: FloatArray
    # (n_draw, n_conf, n_all, n_all) Information by optimal weights, `2 Re J^H Lambda^-1 J`, `Lambda` taken for granted
    # as in the meat
    best: FloatArray
    precision: FloatArray  # (n_all,) What is known of each parameter beforehand, over its variance

    def take(self, candidates: IntArray) -> FittedInformation:
        """The same of some candidates."""
        return FittedInformation(
            self.bread[:, candidates], self.meat[:, candidates], self.best[:, candidates], self.precision
        )

    def scaled(self, wanted: FloatArray) -> FittedInformation:
        """The same over scales: (n_wanted,) of the first parameters, and what is natural to the others."""
        own = np.diagonal(self.bread, axis1=2, axis2=3).mean(axis=(0, 1)) + self.precision
        scale = np.sqrt(np.where(own > 0, own, 1.0))
        scale[: wanted.size] = wanted
        unit = scale[:, None] * scale
        return FittedInformation(self.bread / unit, self.meat / unit, self.best / unit, self.precision / scale**2)

    def parts(self) -> FloatArray:
        """Bread and meat (n_draw, n_conf, 2, n_all, n_all)."""
        return np.stack([self.bread, self.meat], axis=2)

    def base(self, known: FloatArray) -> FloatArray:
        """Bread and meat (2, n_all, n_all) of what is known beforehand, with (n_wanted, n_wanted) from elsewhere."""
        count, whole = len(known), np.diag(self.precision)
        whole[:count, :count] += known
        seen = whole + np.diag(np.where(np.arange(len(whole)) < count, 0.0, _LEAST))
        return np.stack([seen, whole])

    def bound(self, known: FloatArray, visits: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Information that adds over candidates and never falls short of what a fit makes of their sum.

        For every `K`, `[I; -K]' M [I; -K]` is at least what is left of `M` once nuisances are taken out, and equal
        for the best `K`, which is found here for some numbers of visits (n_conf,), where the bound is tight, and holds
        as a bound for all others. What is known of the wanted parameters is (n_wanted, n_wanted).

        Returns:
            Matrices (n_draw, n_conf, n_wanted, n_wanted), and what is known beforehand (n_draw, n_wanted, n_wanted).

        Source:
            Schur complement as a minimum, Boyd and Vandenberghe (2004), appendix A.5.5.
        """
        count = len(known)
        whole = self.base(known)[0]
        total = whole + np.tensordot(self.best, visits, ((1,), (0,)))
        keep = np.broadcast_to(np.eye(count), (len(total), count, count))
        # K that is best for these visits: [I; -K]' M [I; -K] bounds the Schur complement for all others.
        follow = np.concatenate([keep, -np.linalg.solve(total[:, count:, count:], total[:, count:, :count])], axis=1)
        back = follow.swapaxes(1, 2)
        return back[:, None] @ self.best @ follow[:, None], back @ whole @ follow


def merged(parts: FloatArray, count: int | None = None) -> FloatArray:
    """Information (..., n_wanted, n_wanted) of total parts (..., n_part, n_all, n_all), nuisances taken out.

    One part is the information itself; two are bread and meat of a fit with its own weights, `B S^-1 B`. Wanted
    parameters come first; they are all where they are not counted.
    """
    own = reduced(parts, parts.shape[-1] if count is None else count)
    bread = own[..., 0, :, :]
    if own.shape[-3] == 1:
        return np.asarray(bread)
    # Inverse of the sandwich covariance B^-1 S B^-1.
    whole = bread @ np.linalg.solve(own[..., 1, :, :], bread)
    return np.asarray(0.5 * (whole + whole.swapaxes(-1, -2)))


def reduced(parts: FloatArray, count: int) -> FloatArray:
    """Parts (..., n_part, count, count) with the other parameters at their best for the first part."""
    if parts.shape[-1] == count:
        return parts
    first = parts[..., 0, :, :]
    # Nuisances at their best for the first part, the bread; the meat follows.
    follow = -np.linalg.solve(first[..., count:, count:], first[..., count:, :count])[..., None, :, :]
    mixed = parts[..., :count, count:] @ follow
    others = follow.swapaxes(-1, -2) @ parts[..., count:, count:] @ follow
    return np.asarray(parts[..., :count, :count] + mixed + mixed.swapaxes(-1, -2) + others)
