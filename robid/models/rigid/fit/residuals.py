"""What residuals tell: intervals where they are correlated, and tests of their shape and colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, kurtosis, kurtosistest, skew, skewtest
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.models.rigid.fit.regression import (
    HuberRegression,
    Reduction,
    Regression,
    solve_factor,
)
from robid.models.rigid.fit.rows import Rows, RowSource

FEWEST_TESTED = 20
"""Rows of a joint below which nothing is tested."""


@dataclass(frozen=True)
class Normality:
    """Shape of one joint's residuals against a Gaussian."""

    skewness: float  # third standardised moment; 0 for a Gaussian
    excess_kurtosis: float  # fourth standardised moment less 3
    outlier_share: float  # share of the residuals outside 3 deviations; 0.27 % for a Gaussian
    p_value: float  # chance of a Gaussian to look as odd


@dataclass(frozen=True)
class Whiteness:
    """Correlation of one joint's residuals in time."""

    correlation: FloatArray  # (n_lag,): autocorrelation at lags 1 and on, less the filter's own
    largest: float  # the largest of their magnitudes
    p_value: float  # chance of white torque noise behind the filter to look as correlated


def check_normality(residual: FloatArray) -> Normality:
    """Tests the residuals (n_row,) of one joint; NaN where a row is not used.

    Source:
        D'Agostino and Pearson (1973), skewness and kurtosis.
    """
    kept = residual[np.isfinite(residual)]
    if len(kept) < FEWEST_TESTED:
        return Normality(np.nan, np.nan, np.nan, np.nan)
    statistic = float(skewtest(kept).statistic ** 2 + kurtosistest(kept).statistic ** 2)
    outside = float(np.mean(np.abs(kept - kept.mean()) > 3 * kept.std()))
    return Normality(float(skew(kept)), float(kurtosis(kept)), outside, float(chi2.sf(statistic, 2)))


def check_whiteness(residual: FloatArray, own: FloatArray) -> Whiteness:
    """Tests the residuals of one joint.

    Residuals (n_row,) are in the order of time, NaN where a row is not used; `own` (n_lag + 1,) is the autocorrelation
    to be expected of white noise, from lag 0.

    Source:
        Box and Pierce (1970), with Bartlett's covariance of the autocorrelations about the filter's own.
    """
    n_lag = len(own) - 1
    centred = np.nan_to_num(residual - np.nanmean(residual))
    used = np.isfinite(residual).astype(float)
    pairs = np.array([used[lag:] @ used[: len(used) - lag] for lag in range(n_lag + 1)])
    if pairs.min() < FEWEST_TESTED:
        return Whiteness(np.full(n_lag, np.nan), np.nan, np.nan)
    sums = np.array([centred[lag:] @ centred[: len(centred) - lag] for lag in range(n_lag + 1)])
    # Autocovariances over the pairs that count; the filter's own correlation is no sign of colour and is subtracted.
    beyond = (sums / pairs / (sums[0] / pairs[0]) - own)[1:]
    root = np.sqrt(pairs[1:])
    statistic = float((root * beyond) @ np.linalg.solve(_bartlett(own), root * beyond))
    return Whiteness(beyond, float(np.abs(beyond).max()), float(chi2.sf(statistic, n_lag)))


def expected_correlation(source: RowSource, reduction: Reduction, estimate: Regression, own: FloatArray) -> FloatArray:
    """Computes the autocorrelation (n_joint, n_lag + 1) that least-squares residuals of white torque noise have.

    The filter correlates them, and the fit takes out what looks like its columns. The filter gives white noise the
    autocorrelation `own` (n_lag + 1,), from lag 0.
    """
    _, inverse, _ = solve_factor(reduction.weighted(estimate.weights))
    # Residuals are (1 - P) e with P = W (W^T W)^-1 W^T: at a lag, the product of two rows of W R is what P takes, with
    # R R^T the inverse.
    root = np.linalg.cholesky(inverse)
    n_lag = len(own) - 1
    taken = np.zeros((len(estimate.weights), n_lag + 1))
    pairs = np.zeros_like(taken)
    before: FloatArray | None = None
    for rows in source:
        used = np.broadcast_to(rows.used[..., None], rows.columns.shape)
        pulls = np.where(used, rows.columns, 0.0) @ root * np.sqrt(estimate.weights)[:, None]
        joined = np.concatenate([pulls, rows.used[..., None]], axis=2)
        joined = joined if before is None else np.concatenate([before, joined])
        new = slice(0 if before is None else len(before), None)
        for lag in range(n_lag + 1):
            later = joined[new][max(0, lag - (0 if before is None else len(before))) :]
            products = np.einsum("rjp,rjp->jp", later, joined[len(joined) - lag - len(later) : len(joined) - lag])
            taken[:, lag] += products[:, :-1].sum(axis=1)
            pairs[:, lag] += products[:, -1]
        before = joined[-n_lag:] if n_lag else None
    # White noise e filtered has the correlation `own`; what the fit takes is subtracted, and lag zero set to one again.
    expected = own - taken / np.maximum(pairs, 1)
    return np.asarray(expected / expected[:, :1])


def _bartlett(own: FloatArray) -> FloatArray:
    """Covariance (n_lag, n_lag) of the root of the rows times autocorrelations about their true values."""
    n_lag = len(own) - 1
    reach = 3 * n_lag
    # Bartlett: cov(r_k, r_l) n = sum_s (rho_{s+k} + rho_{s-k} - 2 rho_s rho_k)(the same of l), s from one on; beyond
    # its lags the filter's correlation is zero.
    whole = np.zeros(4 * reach + 1)
    whole[2 * reach : 2 * reach + n_lag + 1] = own
    whole[2 * reach - n_lag : 2 * reach + 1] = own[::-1]
    shift = np.arange(1, reach + 1)
    parts = [
        whole[2 * reach + shift + lag] + whole[2 * reach + shift - lag] - 2 * own[lag] * whole[2 * reach + shift]
        for lag in range(1, n_lag + 1)
    ]
    return np.asarray(np.array(parts) @ np.array(parts).T)


_LARGEST_FREEDOM = 100


@dataclass(frozen=True)
class Influence:
    """An estimator linearised: how each kept sample moves the parameters."""

    parameters: FloatArray  # (n_param,): where it is linearised
    bread: FloatArray  # (n_param, n_param): parameters a weighted score
    weights: FloatArray  # (n_joint,): weight of each joint's rows
    limit: FloatArray  # (n_joint,): magnitude at which a residual's pull ends; infinite without a bend
    instrumented: bool = False  # whether the scores are the instruments' instead of the columns'

    def of(self, rows: Rows) -> FloatArray:
        """Returns the move (n_row, n_param) of the parameters by each kept sample."""
        residual = np.where(rows.used, rows.torque - rows.columns @ self.parameters, 0.0)
        # The score of one sample: its residual, beyond the bend no more than the bend, times its regressor.
        pull = np.clip(residual, -self.limit, self.limit) * self.weights
        source = rows.instruments if self.instrumented and rows.instruments is not None else rows.columns
        return np.asarray(np.matmul(pull[:, None, :], source)[:, 0, :] @ self.bread.T)


def least_squares_influence(reduction: Reduction, estimate: Regression) -> Influence:
    """Linearises plain or weighted least squares."""
    _, bread, _ = solve_factor(reduction.weighted(estimate.weights))
    return Influence(estimate.parameters, bread, estimate.weights, np.full(len(estimate.weights), np.inf))


def huber_influence(reduction: Reduction, estimate: HuberRegression, bend: float) -> Influence:
    """Linearises Huber's estimator, with the mean slope of its score."""
    _, bread, _ = solve_factor(reduction.weighted(estimate.weights))
    # Beyond the bend the score is flat, so that only the other rows hold the estimate in place.
    slope = 1 - estimate.share_down_weighted
    return Influence(estimate.parameters, bread / slope, estimate.weights, bend * estimate.scale)


@dataclass(frozen=True)
class LongRun:
    """Joint covariance of several estimators of the same parameters."""

    # (n_estimator * n_param, n_estimator * n_param): the covariance, one estimator after the other.
    covariance: FloatArray
    freedom: int  # degrees of freedom of its variances
    n_param: int  # number of parameters

    def of(self, index: int) -> FloatArray:
        """Returns the covariance (n_param, n_param) of one estimator."""
        part = slice(index * self.n_param, (index + 1) * self.n_param)
        return self.covariance[part, part]

    def difference(self, first: int, second: int) -> FloatArray:
        """Returns the covariance (n_param, n_param) of the difference of two."""
        one = slice(first * self.n_param, (first + 1) * self.n_param)
        other = slice(second * self.n_param, (second + 1) * self.n_param)
        # Both come of the same rows, so their covariance counts. Hausman's short form, the difference of the two
        # variances, assumes that one is efficient, which correlated residuals rule out.
        cross = self.covariance[one, other]
        return np.asarray(self.of(first) + self.of(second) - cross - cross.T)

    def half_width(self, index: int, level: float = 0.95) -> FloatArray:
        """Returns half the width (n_param,) of one estimator's intervals."""
        return np.asarray(student.ppf(0.5 + level / 2, self.freedom) * np.sqrt(np.diag(self.of(index))))


def long_run_covariance(
    source: RowSource, influences: Sequence[Influence], n_row: int, n_used: float | None = None
) -> LongRun:
    """Estimates the covariance of estimators whose residuals are correlated in time, in one pass.

    The long-run variance of the influences is the mean of the squares of their first cosine transforms, whose
    number, 0.4 n^(2/3), is the degrees of freedom of Student's t.

    Source:
        Lazarus, Lewis, Stock and Watson (2018), "HAR inference", the equal-weighted cosine estimator.
    """
    counted = n_row if n_used is None else n_used
    freedom = int(np.clip(0.4 * counted ** (2 / 3), 1, _LARGEST_FREEDOM))
    n_param = len(influences[0].parameters)
    transformed = np.zeros((freedom, len(influences) * n_param))
    # Cosines of order 1 and above at t + 1/2 (DCT-II) are orthogonal to a constant: influences need no centring.
    frequency = np.pi * np.arange(1, freedom + 1) / n_row
    first = 0
    for rows in source:
        moves = np.concatenate([influence.of(rows) for influence in influences], axis=1)
        moment = first + np.arange(len(moves)) + 0.5
        transformed += np.cos(np.outer(frequency, moment)) @ moves
        first += len(moves)
    # Each parameter taken from the residuals takes its share of their variance away.
    factor = 2 / freedom * counted / max(counted - n_param, 1)
    return LongRun(factor * transformed.T @ transformed, freedom, n_param)
