"""What residuals tell: intervals where they are correlated, tests of shape, and a cut-off that leaves them white."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, kurtosis, kurtosistest, skew, skewtest
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.regression import (
    HuberRegression,
    Reduction,
    Regression,
    reduce_rows,
    residuals,
    solve_factor,
    weighted_least_squares,
)
from robid.models.rigid.fit.rows import Reading, Regressor, Remembered, Rows, RowSource, prepare
from robid.signals.filters import central_differences, low_pass_reach

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


_ABOVE_FLOOR = 20.0
_SHARE = 0.99  # of the acceleration's power
_MARGIN = 1.5  # lowest cut-off over the excited band
_RATIO = 1.5
_HIGHEST = 0.2  # of the sampling rate
_LAGS = 10
_ROWS = 3.0  # at least, all joints together, over the parameters
_WHITE = 0.2


@dataclass(frozen=True)
class CutOffTrial:
    """What one cut-off leads to."""

    cut_hz: float  # the cut-off [Hz]
    # (n_joint,): largest autocorrelation of each joint's residuals, less what white noise would show.
    correlation: FloatArray
    deviation: FloatArray  # (n_joint,): deviation of each joint's residuals [N m, or N]


@dataclass(frozen=True)
class CutOffChoice:
    """A cut-off and why."""

    # The lowest cut-off above the excited band with white residuals; without one, that with the whitest [Hz].
    cut_hz: float
    white: bool  # whether its residuals are white
    excited_hz: FloatArray  # (n_joint,): frequency below which 99 % of each joint's acceleration lies [Hz]
    trials: tuple[CutOffTrial, ...]  # all cut-offs that were tried, ascending


def choose_cut_off(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    regressor: Regressor,
    options: PreprocessingOptions,
    candidates_hz: Sequence[float] = (),
    *,
    held: bool = False,
) -> CutOffChoice:
    """Tries cut-offs from the excited band upwards.

    Positions (n_sample, n_joint) are in rad, or m, torques of the motors in N m, or N, commands held until the next
    sample where `held`. Tried are by default 1.5 times the excited band and on in steps of one half; rows are decimated
    to twice each cut-off.

    Raises:
        ValueError: If the record is too short for any of them.

    Source:
        docs/methods, sec. 7: residual whiteness against the excited band.
    """
    excited = excited_band(position, sampling_period_s)
    highest = _HIGHEST / sampling_period_s
    lowest = min(_MARGIN * max(float(excited.max()), 1e-3 * highest), highest)
    count = int(np.log(highest / lowest) / np.log(_RATIO)) + 1
    cuts = sorted(candidates_hz) or [lowest * _RATIO**index for index in range(count)]
    every = [replace(options, position_cut_hz=cut, decimation=0) for cut in cuts]
    wanted = fewest_rows(len(regressor.names), position.shape[1])
    every = [tried for tried in every if row_count(len(position), tried, sampling_period_s) >= wanted]
    if not every:
        message = f"{len(position)} samples leave too few rows for {len(regressor.names)} parameters at any cut-off"
        raise ValueError(message)
    trials = tuple(_try(position, torque, sampling_period_s, regressor, tried, held) for tried in every)
    # The lowest white one: a higher one lets more of the positions' noise into the columns, which biases the fit.
    white = [trial for trial in trials if trial.correlation.max() <= _WHITE]
    best = white[0] if white else min(trials, key=lambda trial: float(trial.correlation.max()))
    return CutOffChoice(best.cut_hz, bool(white), excited, trials)


def excited_band(position: FloatArray, sampling_period_s: float) -> FloatArray:
    """Returns the frequency (n_joint,) below which 99 % of the acceleration above the noise floor lies [Hz]."""
    from scipy.signal import welch

    _, acceleration = central_differences(position, sampling_period_s)
    segment = min(len(acceleration), 1 << 13)
    hertz, power = welch(acceleration, 1 / sampling_period_s, nperseg=segment, axis=0)
    hertz, power = hertz[1:], power[1:]
    # White noise of an encoder is flat as a position; what stands far above its floor is motion.
    as_position = power / (2 * np.sin(np.pi * hertz * sampling_period_s)[:, None]) ** 4
    floor = np.median(as_position[len(as_position) // 2 :], axis=0)
    # The power of the acceleration that stands above the floor, added up from below.
    within = np.cumsum(np.where(as_position > _ABOVE_FLOOR * floor, power, 0.0), axis=0)
    return np.asarray(hertz[np.argmax(within >= _SHARE * within[-1], axis=0)])


def row_count(n_sample: int, options: PreprocessingOptions, sampling_period_s: float) -> int:
    """Returns how many rows of a joint the filters leave of a record."""
    inner = n_sample - 2 * low_pass_reach(sampling_period_s, options.cut_hz, options.position_order) - 2
    return len(options.decimator(sampling_period_s).kept(inner))


def fewest_rows(n_param: int, n_joint: int) -> int:
    """Returns how many rows of a joint a fit needs at least."""
    return math.ceil(_ROWS * n_param / n_joint)


def _try(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    regressor: Regressor,
    options: PreprocessingOptions,
    held: bool,
) -> CutOffTrial:
    decimator = options.decimator(sampling_period_s)
    motion = prepare(position, torque, sampling_period_s, options, held=held)
    rows = Remembered(Reading([motion], regressor, decimator))
    reduction = reduce_rows(rows)
    estimate = weighted_least_squares(reduction)
    expected = expected_correlation(rows, reduction, estimate, decimator.autocorrelation(_LAGS))
    residual = residuals(rows, estimate.parameters)
    tested = [check_whiteness(joint, own) for joint, own in zip(residual.T, expected, strict=True)]
    return CutOffTrial(options.cut_hz, np.array([one.largest for one in tested]), estimate.deviation)
