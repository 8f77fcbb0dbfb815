"""Criteria of a design: worth of a total information, its slopes, a bound on every other, what it leaves unseen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError

_SHIFT_STEPS = 50

Criterion = Literal["d", "a", "e"]


def worth(criterion: Criterion, totals: FloatArray) -> FloatArray:
    """What total informations (n_draw, ..., n_param, n_param) under draws are worth by `d`, `a` or `e`.

    Returns:
        (...): `det^(1/n)`, its geometric mean over the draws; `1 / tr M^-1`, by the mean of the traces; the smallest
        eigenvalue, in the worst draw. 0 where a total is singular.
    """
    size = totals.shape[-1]
    if criterion == "d":
        # det^(1/n) is homogeneous of degree one; the mean of log det over draws is its geometric mean.
        sign, value = np.linalg.slogdet(totals)
        return np.asarray(np.exp(np.where(sign > 0, value, -np.inf).mean(axis=0) / size))
    if criterion == "a":
        return np.asarray(1 / _inverse_trace(totals).mean(axis=0))
    return np.asarray(np.maximum(np.linalg.eigvalsh(totals)[..., 0], 0).min(axis=0))


def _inverse_trace(totals: FloatArray) -> FloatArray:
    try:
        # tr(M^-1) = |L^-1|_F^2.
        return np.asarray((np.linalg.inv(np.linalg.cholesky(totals)) ** 2).sum(axis=(-2, -1)))
    except np.linalg.LinAlgError:
        values = np.linalg.eigvalsh(totals)
        inverse = (1 / np.where(values > 0, values, 1.0)).sum(axis=-1)
        return np.asarray(np.where(values[..., 0] > 0, inverse, np.inf))


@dataclass(frozen=True)
class Bound:
    """A tangent of a criterion."""

    factors: FloatArray  # (n_draw, n_param, n_param) `G` of the slopes `tr(G H_i)`
    scale: float  # What a difference of slopes is relative to
    excess: float  # What the slopes times the weights, and the prior's own, exceed `scale` by; 0 but for `e` smoothed


def tangent(criterion: Criterion, totals: FloatArray, smoothing: float) -> Bound:
    """Tangent at totals (n_draw, n_param, n_param).

    For every other total `M*`: `worth(M*) / worth(M) <= 1 + (sum tr(G (M* - M)) + excess) / scale`, see docs/methods,
    sec. 6: arithmetic over geometric mean for `d`, Cauchy and Schwarz for `a`, `lambda_min(M*) <= tr(Z M*)` for `e`.
    """
    if criterion == "e":
        # lambda_min(M*) <= tr(Z M*) for every positive Z of trace one (docs/methods, sec. 6).
        factors = smooth_dual(totals, smoothing)
        lowest = float(np.linalg.eigvalsh(totals)[..., 0].min())
        return Bound(factors, lowest, float((factors * totals).sum()) - lowest)
    inverse = np.linalg.inv(totals)
    inverse = 0.5 * (inverse + inverse.swapaxes(1, 2))
    if criterion == "d":
        # Gradient of mean log det is M^-1 / n_draw; tr(M^-1 M) = n scales it.
        return Bound(inverse / len(totals), float(totals.shape[-1]), 0.0)
    # Gradient of -tr M^-1 is M^-2, and tr(M^-2 M) = tr M^-1.
    return Bound(inverse @ inverse / len(totals), float(np.trace(inverse, axis1=1, axis2=2).mean()), 0.0)


def loss(criterion: Criterion, totals: FloatArray, smoothing: float) -> float:
    """What the relaxed problem minimises: `-mean log det M`, `mean tr M^-1`, the smoothed `-lambda_min`."""
    values = np.linalg.eigvalsh(totals)
    if not values.min() > 0:
        return np.inf
    if criterion == "d":
        return -float(np.log(values).sum() / len(totals))
    if criterion == "a":
        return float((1 / values).sum() / len(totals))
    shift = _shift(values, smoothing)
    # max t + mu log det(M - t 1) over t: concave in M, and the smallest eigenvalue as mu falls.
    return -shift - smoothing * float(np.log(values - shift).sum())


def derivatives(
    criterion: Criterion, totals: FloatArray, matrices: FloatArray, smoothing: float
) -> tuple[FloatArray, FloatArray]:
    """Slopes of `-loss` by the weights of matrices (n_draw, n, n_param, n_param), and root of the curvature of `loss`.

    Returns:
        Slopes (n,) and root (n, ...): the curvature is root times its transpose.
    """
    shift = _shift(np.linalg.eigvalsh(totals), smoothing) if criterion == "e" else 0.0
    n_draw, count, size = matrices.shape[:3]
    factor = smoothing if criterion == "e" else 1 / n_draw
    rows = np.empty((count, n_draw, size * size))
    units, shifts = np.empty((2, n_draw, size * size))
    for draw, (total, own) in enumerate(zip(totals, matrices, strict=True)):
        whitening = np.linalg.inv(np.linalg.cholesky(total - shift * np.eye(size)))
        # W H W' with W'W = (M - t 1)^-1: slopes are traces of it, curvature is the Gram matrix of these.
        half = (own.reshape(-1, size) @ whitening.T).reshape(count, size, size)
        white = half.swapaxes(1, 2).reshape(-1, size) @ whitening.T
        rows[:, draw] = (white @ whitening if criterion == "a" else white).reshape(count, -1)
        units[draw] = (whitening if criterion == "a" else np.eye(size)).ravel()
        if criterion == "e":
            shifts[draw] = (whitening @ whitening.T).ravel()
    flat = rows.reshape(count, -1)
    slopes = factor * (flat @ units.ravel())
    if criterion == "e":
        # The shift follows the weights, which takes its direction out of the curvature.
        along = shifts.ravel() / np.linalg.norm(shifts)
        flat = flat - np.outer(flat @ along, along)
    return slopes, np.sqrt((2 if criterion == "a" else 1) * factor) * flat


def smooth_dual(totals: FloatArray, smoothing: float) -> FloatArray:
    """Matrices `Z` (n_draw, n_param, n_param), positive with traces that sum to 1, near the lowest eigenspace."""
    values, vectors = np.linalg.eigh(totals)
    # Where the shift is best these shares sum to one.
    share = smoothing / (values - _shift(values, smoothing))
    share /= share.sum()
    return np.asarray((vectors * share[:, None]) @ vectors.swapaxes(1, 2))


def _shift(values: FloatArray, smoothing: float) -> float:
    """The `t` below all eigenvalues at which `sum smoothing / (values - t) = 1`, best for `t + smoothing log det`."""
    lowest = float(values.min())
    relative = (values - lowest).ravel() / smoothing
    # The distance from the lowest eigenvalue, over the smoothing; the reciprocal of the sum is nearly straight.
    distance = 1.0
    for _ in range(_SHIFT_STEPS):
        inverse = 1 / (relative + distance)
        whole = float(inverse.sum())
        change = whole * (whole - 1) / float((inverse**2).sum())
        distance += change
        if abs(change) <= 1e-15 * distance:
            break
    return lowest - smoothing * distance


_UNSEEN = 1e-12  # Smallest eigenvalue of the scaled total information, relative to the largest, that counts as seen
_SPREAD = 1e-14  # Of the largest, an eigenvalue that rounding hides
_ALIKE = 1e-9  # Largest difference of matrices, relative to them, at which candidates count as alike


def check_finite(matrices: FloatArray) -> None:
    """Refuses information (n_draw, n_cand, n_param, n_param) that is not finite.

    Raises:
        DataError: With the first candidate that is not.
    """
    wrong = np.flatnonzero(~np.isfinite(matrices).all(axis=(0, 2, 3)))
    if wrong.size:
        which = f"{wrong.size} of {matrices.shape[1]} candidates is not finite, first that of candidate {wrong[0]}."
        remedy = "Check the campaign's responses and their covariance, or leave these candidates out."
        raise DataError(f"D003 The information of {which}", where="design", remedy=remedy)


def check_different(matrices: FloatArray) -> None:
    """Refuses candidates of which each has the same information (n_draw, n_cand, n_param, n_param) but for a factor.

    Raises:
        DataError: If there is nothing to choose.
    """
    if matrices.shape[1] < 2:
        return
    first = matrices[:, :1]
    # Regression of each matrix on the first one: the factor by which it would be the same.
    factor = (matrices * first).sum(axis=(0, 2, 3)) / (first**2).sum() if first.any() else np.zeros(matrices.shape[1])
    if matrices.shape[-1] == 1:
        # A single parameter leaves the factor to choose by.
        factor = np.ones_like(factor)
    if np.abs(matrices - factor[:, None, None] * first).max() <= _ALIKE * np.abs(matrices).max():
        what = "each tells the same about the parameters, so there is nothing to choose."
        remedy = "Offer configurations that differ in more than the first axis, or leave the design out."
        raise DataError(f"D004 The candidates are all alike: {what}", where="design", remedy=remedy)


def checked_scale(total: FloatArray, names: tuple[str, ...], by: str, remedy: str) -> FloatArray:
    """Returns the root of the diagonal of a total information (n_param, n_param) about log-parameters.

    Messages say `by` whom it is, and the remedy.

    Raises:
        DataError: If the total is singular, with the combinations that it does not see.
    """
    if not names:
        what = "D599 there is no parameter to choose configurations for: all are fixed"
        raise DataError(what, where="design", remedy="leave some springs or dampers out of `fixed`")
    diagonal = np.diag(total)
    unseen = [name for name, value in zip(names, diagonal, strict=True) if not value > 0]
    if not unseen:
        scale = np.sqrt(diagonal)
        values, vectors = np.linalg.eigh(total / (scale[:, None] * scale))
        for vector in vectors.T[values <= _UNSEEN * values[-1]] / scale:
            # Normed to the largest term; smaller ones than 5 % are left out.
            scaled = vector / vector[np.argmax(np.abs(vector))]
            order = [index for index in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[index]) > 0.05]
            unseen.append(" ".join(f"{scaled[index]:+.2g} log({names[index]})" for index in order))
        if not unseen:
            return np.asarray(scale)
    raise DataError(f"D005 The responses of {by} do not depend on: {'; '.join(unseen)}.", where="design", remedy=remedy)


def check_spread(total: FloatArray, criterion: Criterion) -> None:
    """Refuses a total information (n_param, n_param) that a criterion which is not free of scale cannot add up.

    Raises:
        DataError: If the least and the largest information are too many decades apart.
    """
    values = np.linalg.eigvalsh(total)
    if values[0] <= _SPREAD * values[-1]:
        message = f"D603 information about parameters spreads over too many decades for the criterion `{criterion}`"
        remedy = "use `criterion: d`, or fix parameters that responses hardly depend on"
        raise DataError(message, where="design", remedy=remedy)


def is_regular(total: FloatArray) -> bool:
    """Whether a total information (n_param, n_param) sees every combination of parameters."""
    scale = np.sqrt(np.diag(total))
    if not (scale > 0).all():
        return False
    values = np.linalg.eigvalsh(total / (scale[:, None] * scale))
    return bool(values[0] > _UNSEEN * values[-1])
