"""Tests of residuals: are they Gaussian, and white but for what their filter correlates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, kurtosis, kurtosistest, skew, skewtest

from robid.arrays import FloatArray
from robid.models.rigid.fit.least_squares import Regression, solve_factor
from robid.models.rigid.fit.reduction import Reduction
from robid.models.rigid.fit.rows import RowSource

FEWEST_TESTED = 20
"""Rows of a joint below which nothing is tested."""


@dataclass(frozen=True)
class Normality:
    """Shape of one joint's residuals against a Gaussian.

    Attributes:
        skewness: Third standardised moment; 0 for a Gaussian.
        excess_kurtosis: Fourth standardised moment less 3.
        outlier_share: Share of the residuals outside 3 deviations; 0.27 % for a Gaussian.
        p_value: Chance of a Gaussian to look as odd.
    """

    skewness: float
    excess_kurtosis: float
    outlier_share: float
    p_value: float


@dataclass(frozen=True)
class Whiteness:
    """Correlation of one joint's residuals in time.

    Attributes:
        correlation (n_lag,): Autocorrelation at lags 1 and on, less the filter's own.
        largest: The largest of their magnitudes.
        p_value: Chance of white torque noise behind the filter to look as correlated.
    """

    correlation: FloatArray
    largest: float
    p_value: float


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

    Args:
        residual (n_row,): Residuals in the order of time; NaN where a row is not used.
        own (n_lag + 1,): Autocorrelation to be expected of white noise, from lag 0.

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
    beyond = (sums / pairs / (sums[0] / pairs[0]) - own)[1:]
    root = np.sqrt(pairs[1:])
    statistic = float((root * beyond) @ np.linalg.solve(_bartlett(own), root * beyond))
    return Whiteness(beyond, float(np.abs(beyond).max()), float(chi2.sf(statistic, n_lag)))


def expected_correlation(source: RowSource, reduction: Reduction, estimate: Regression, own: FloatArray) -> FloatArray:
    """Computes the autocorrelation that least-squares residuals of white torque noise have.

    The filter correlates them, and the fit takes out what looks like its columns.

    Args:
        source: The rows, for one pass.
        reduction: The same reduced.
        estimate: Plain or weighted least squares.
        own (n_lag + 1,): Autocorrelation that the filter gives white noise, from lag 0.

    Returns:
        Autocorrelation (n_joint, n_lag + 1) of each joint's residuals.
    """
    _, inverse, _ = solve_factor(reduction.weighted(estimate.weights))
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
    expected = own - taken / np.maximum(pairs, 1)
    return np.asarray(expected / expected[:, :1])


def _bartlett(own: FloatArray) -> FloatArray:
    """Covariance (n_lag, n_lag) of the root of the rows times autocorrelations about their true values."""
    n_lag = len(own) - 1
    reach = 3 * n_lag
    whole = np.zeros(4 * reach + 1)
    whole[2 * reach : 2 * reach + n_lag + 1] = own
    whole[2 * reach - n_lag : 2 * reach + 1] = own[::-1]
    shift = np.arange(1, reach + 1)
    parts = [
        whole[2 * reach + shift + lag] + whole[2 * reach + shift - lag] - 2 * own[lag] * whole[2 * reach + shift]
        for lag in range(1, n_lag + 1)
    ]
    return np.asarray(np.array(parts) @ np.array(parts).T)
