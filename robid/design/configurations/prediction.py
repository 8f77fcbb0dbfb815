"""Expected error of a model's predicted responses: of noise, and of what the model may lack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.design.configurations.relaxed import Relaxed, relaxed_design

_CHUNK = 256
_LEFT_OUT = 1e-4  # Share of what the model may lack, as fits of all candidates see it, that exchange leaves out
_ADDED = ("bread", "noise", "best", "apart", "lacking")  # Of each candidate
_SILENT = 1e-6  # Of the mean variance of outputs, what parameters that move none count in the relaxed problem
_UNSEEN = 1e-9  # Of all candidates' mean, what makes sums of few experiments regular


@dataclass(frozen=True)
class PredictionParts:
    """What visits to each candidate add to a fit, and the responses that it is to predict.

    Parameters are all that the fit estimates, the wanted ones first; they are the same in all configurations. What the
    model may lack is given by independent amounts of unit variance.
    """

    bread: FloatArray  # (n_draw, n_cand, n_all, n_all) `2 Re J^H W J`
    noise: FloatArray  # (n_draw, n_cand, n_all, n_all) Covariance of the scores by noise, `2 Re J^H W Lambda W J`
    best: FloatArray  # (n_draw, n_cand, n_all, n_all) Information by optimal weights, what the model lacks left aside
    apart: FloatArray  # (n_draw, n_cand, n_all, n_all) Covariance of the scores by what differs between configurations
    lacking: FloatArray  # (n_draw, n_cand, n_all, n_alt) `2 Re J^H W H`
    precision: FloatArray  # (n_all,) What is known of each parameter beforehand, over its variance
    # Means over the responses to predict, by weights that sum to 1
    own: FloatArray  # (n_draw, n_all, n_all) `Re J^H V J`
    mixed: FloatArray  # (n_draw, n_all, n_alt) `Re J^H V H`
    whole: FloatArray  # (n_draw,) `tr H^H V H`

    def take(self, candidates: IntArray) -> PredictionParts:
        """The same of some candidates."""
        return replace(self, **{name: getattr(self, name)[:, candidates] for name in _ADDED})

    def known(self, prior: FloatArray | None) -> FloatArray:
        """What is known beforehand (n_all, n_all), with what an earlier fit knows of the wanted parameters."""
        known = np.diag(self.precision)
        if prior is not None:
            known[: len(prior), : len(prior)] += prior
        return known

    def predicting(self, own: FloatArray, mixed: FloatArray, whole: FloatArray) -> PredictionParts:
        """The same with means over other outputs, which the last parameters need not move: friction of measurements."""
        missing = self.own.shape[-1] - own.shape[-1]
        own, mixed = np.pad(own, ((0, 0), (0, missing), (0, missing))), np.pad(mixed, ((0, 0), (0, missing), (0, 0)))
        return replace(self, own=own, mixed=mixed, whole=whole)

    def compressed(self) -> PredictionParts:
        """The same with few combinations of what the model may lack: those that fits of the candidates see."""
        total = self.bread.sum(axis=1) + np.diag(self.precision)
        # What the fit of all makes of each amount, whitened: directions that it does not see bias nothing.
        seen = np.linalg.solve(np.linalg.cholesky(_regular(total)), self.lacking.sum(axis=1))
        # Single candidates see more than their sum, where amounts cancel.
        each = np.einsum("dcij,dcik->jk", self.lacking, np.linalg.solve(_regular(total)[:, None], self.lacking))
        values, vectors = np.linalg.eigh(each + np.einsum("dij,dik->jk", seen, seen))
        kept = vectors[:, np.cumsum(values) > _LEFT_OUT * values.sum()]
        return replace(self, lacking=self.lacking @ kept, mixed=self.mixed @ kept)


def joined(parts: Sequence[PredictionParts], counts: Sequence[int]) -> PredictionParts:
    """Parts of more candidates; means over the responses to predict are weighted by their numbers of configurations."""
    share = np.array(counts) / sum(counts)
    found: dict[str, Any] = _side_by_side(parts)
    found |= {
        name: sum(float(one) * getattr(each, name) for one, each in zip(share, parts, strict=True))
        for name in ("own", "mixed", "whole")
    }
    return PredictionParts(precision=parts[0].precision, **found)


def with_further(parts: PredictionParts, further: PredictionParts) -> PredictionParts:
    """Parts of more candidates, whose own responses are not among those to predict."""
    return replace(parts, **_side_by_side((parts, further)))


def _side_by_side(parts: Sequence[PredictionParts]) -> dict[str, Any]:
    """What the candidates of all parts add."""
    return {name: np.concatenate([getattr(each, name) for each in parts], axis=1) for name in _ADDED}


def parts_of_one(
    own: ComplexArray,
    weighted: ComplexArray,
    further: ComplexArray,
    cluster_std: FloatArray,
    between: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """What the scores of one configuration hold of what the model may lack.

    Args:
        own (n_freq, n_element, n_all): Derivatives of the residual by the parameters.
        weighted (n_freq, n_element, n_all): The same, weighted as in the fit: `W J`.
        further (n_freq, n_element, n_amount): Derivatives by amounts of what the model may lack.
        cluster_std (n_amount,): Deviation of what each configuration adds to the amounts.
        between (n_all,): Deviation of each parameter between configurations.

    Returns:
        `2 Re J^H W H` (n_all, n_amount), and the covariance (n_all, n_all) of the scores by what differs between
        configurations.
    """
    n_all = own.shape[-1]
    pull = weighted.reshape(-1, n_all).conj().T
    lacking = 2 * np.real(pull @ further.reshape(-1, further.shape[-1]))
    bread = 2 * np.real(pull @ own.reshape(-1, n_all))
    # Scores of a configuration move by the columns times what is its own: B T B' of both.
    local = np.concatenate([lacking * cluster_std, bread * between], axis=1)
    return lacking, local @ local.T


def predicted_means(
    own: ComplexArray, further: ComplexArray, weights: FloatArray, root: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Means over the elements of one configuration's response, by weights (n_freq, n_element) made to sum to 1.

    Derivatives of its logarithm by the parameters are (n_freq, n_element, n_all), by amounts of what the model may
    lack (n_freq, n_element, n_amount); `root` (n_amount, n_alt) makes the amounts independent.

    Returns:
        `own` (n_all, n_all), `mixed` (n_all, n_alt) and `whole` of `PredictionParts`.
    """
    scale = np.sqrt(weights / weights.sum())[..., None]
    j, h = ((scale * each).reshape(-1, each.shape[-1]) for each in (own, further))
    h = h @ root
    return np.real(j.conj().T @ j), np.real(j.conj().T @ h), float((np.abs(h) ** 2).sum())


def second_moment_root(std: FloatArray, least: FloatArray) -> FloatArray:
    """Root (n_amount, n_amount) of the second moments of amounts, by which independent ones of unit variance make them.

    Amounts are normal with deviations (n_amount,); those that cannot be negative (`least` 0) are half-normal, so they
    have means, and second moments with each other.
    """
    one_sided = least == 0
    mean = np.where(one_sided, np.sqrt(2 / np.pi) * std, 0.0)
    # E a^2 = std^2 for both; E a_i a_j of two half-normal amounts is the product of their means.
    root = np.diag(np.where(one_sided, np.sqrt(1 - 2 / np.pi), 1.0) * std)
    return np.concatenate([root, mean[:, None]], axis=1)


@dataclass(frozen=True)
class ExpectedError:
    """Worth of experiments by how little the predicted responses are off: one over the mean square error.

    `J = tr(L P) + mean |(H - J K) a|^2`, with `P = B^-1 S B^-1` and `K = B^-1 J^H W H` of the sums.

    Source:
        docs/methods, sec. 6; Box and Draper (1959), "A basis for the selection of a response surface design".
    """

    parts: PredictionParts
    prior: FloatArray  # (n_all, n_all) What is known beforehand

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments (n_cand,)."""
        return 1 / float(sum(self.errors(counts)))

    def errors(self, counts: IntArray) -> tuple[float, float]:
        """Mean square error of the log responses by noise and by what the model lacks, mean over the draws."""
        noise, bias = self._errors(*(each[None] for each in self._sums(counts)))
        return float(noise[0]), float(bias[0])

    def covariance(self, counts: IntArray) -> FloatArray:
        """Covariance (n_draw, n_all, n_all) of the estimates, what differs between configurations included."""
        bread, meat, _ = self._sums(counts)
        inverse = np.linalg.inv(bread)
        return np.asarray(inverse @ meat @ inverse)

    def with_each(self, counts: IntArray, indices: IntArray) -> FloatArray:
        """Worth (n_some,) with one experiment more of each of some candidates."""
        bread, meat, pull = self._sums(counts)
        parts, found = self.parts, []
        for begin in range(0, indices.size, _CHUNK):
            some = indices[begin : begin + _CHUNK]
            # n visits share what is their configuration's own: it counts n^2 times.
            twice = (2 * counts[some] + 1)[:, None, None]
            more = parts.noise[:, some] + twice * parts.apart[:, some]
            sums = bread[:, None] + parts.bread[:, some], meat[:, None] + more, pull[:, None] + parts.lacking[:, some]
            found.append(1 / np.sum(self._errors(*(each.swapaxes(0, 1) for each in sums)), axis=0))
        return np.concatenate(found)

    def slopes(self, counts: IntArray) -> tuple[FloatArray, FloatArray]:
        """Bias makes the worth neither convex nor concave: slopes screen nothing."""
        return np.full(counts.size, np.inf), np.zeros(counts.size)

    def _sums(self, counts: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        used, parts = np.flatnonzero(counts), self.parts
        times = counts[used].astype(float)
        floor = _UNSEEN * parts.bread.mean(axis=1)
        bread = self.prior + floor + np.tensordot(parts.bread[:, used], times, (1, 0))
        meat = self.prior + floor + np.tensordot(parts.noise[:, used], times, (1, 0))
        meat = meat + np.tensordot(parts.apart[:, used], times**2, (1, 0))
        return bread, meat, np.tensordot(parts.lacking[:, used], times, (1, 0))

    def _errors(self, bread: FloatArray, meat: FloatArray, pull: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Errors (n_some,) by sums (n_some, n_draw, ...)."""
        own, mixed, whole = self.parts.own, self.parts.mixed, self.parts.whole
        solved = np.linalg.solve(bread, np.concatenate([pull, meat], axis=-1))
        follow, half = solved[..., : pull.shape[-1]], solved[..., pull.shape[-1] :]
        covariance = np.linalg.solve(bread, half.swapaxes(-1, -2))
        noise = (own * covariance).sum(axis=(-2, -1))
        bias = whole - 2 * (mixed * follow).sum(axis=(-2, -1)) + ((own @ follow) * follow).sum(axis=(-2, -1))
        return noise.mean(axis=-1), bias.mean(axis=-1)

    def least_bias(self) -> float:
        """What no fit of these parameters is off by less: the best approximation of all responses to predict."""
        parts = self.parts
        best = np.linalg.solve(_regular(parts.own), parts.mixed)
        return float((parts.whole - (parts.mixed * best).sum(axis=(-2, -1))).mean())

    def relaxed(self, cost: FloatArray, budget: float, gap: float, iterations: int, limit: float = 1.0) -> Relaxed:
        """Optimal shares (n_cand,) of the cost for the part that noise has, which is convex, with their certificate.

        `tr(L M^-1)` is the mean variance, criterion A, of the parameters `R x` with `R' R = L`.
        """
        parts, known = self.parts, (self.prior + _UNSEEN * self.parts.bread.mean(axis=1)) / budget
        # Parameters that move no output, as dampers no resonance, count a little, each as it is told.
        told = _regular(known + (parts.best / cost[:, None, None]).mean(axis=1))
        size = np.trace(np.linalg.solve(told, parts.own), axis1=-2, axis2=-1) / told.shape[-1]
        root = np.linalg.inv(np.linalg.cholesky(parts.own + _SILENT * size[:, None, None] * told))
        back = root.swapaxes(-1, -2)
        matrices = root[:, None] @ (parts.best / cost[:, None, None]) @ back[:, None]
        prior = root @ known @ back
        return relaxed_design(matrices, criterion="a", gap=gap, iterations=iterations, prior=prior, limit=limit)

    def bound(self, found: Relaxed, budget: float) -> float:
        """Mean square error below which no experiments within the budget come."""
        return 1 / (budget * found.worth * (1 + found.gap)) + self.least_bias()


def _regular(matrices: FloatArray) -> FloatArray:
    """Matrices (..., n, n) whose unseen directions are seen a little, so that they can be inverted."""
    size = np.trace(matrices, axis1=-2, axis2=-1)[..., None, None] / matrices.shape[-1]
    return np.asarray(matrices + 1e-12 * size * np.eye(matrices.shape[-1]))
