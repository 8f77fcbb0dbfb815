"""How far a measured extremum may be off: what lines, realizations and repeated configurations scatter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.judge.local_model import Estimator, Kind, LocalMode

_WINDOW = 21
_SECOND_DIFFERENCE = 6.0  # its variance over that of a line
LINE_SCATTER_FREEDOM = 14.0
"""Real degrees of freedom of what neighbouring lines scatter, whose second differences share lines."""

_TINY = 1e-300


def line_scatter(measured: ComplexArray, modelled: ComplexArray) -> FloatArray:
    """Relative variance of each line beyond what is smooth, from measured over modelled responses.

    One realization of a friction's distortion looks like noise over the lines that no period averages out. Second
    differences of the quotient leave it, and their median over neighbouring lines leaves a model's error at single
    resonances out.

    Args:
        measured (n_conf, n_freq, n_out, n_in): Responses.
        modelled (n_conf, n_freq, n_out, n_in): The fitted model's.

    Returns:
        (n_conf, n_freq, n_out, n_in); zero with less than three lines.
    """
    if measured.shape[1] < 3:
        return np.zeros(measured.shape)
    ratio = np.divide(measured, modelled, out=np.ones_like(measured), where=modelled != 0)
    bend = ratio[:, 2:] - 2 * ratio[:, 1:-1] + ratio[:, :-2]
    power = np.abs(bend) ** 2 / (_SECOND_DIFFERENCE * np.maximum(np.abs(ratio[:, 1:-1]) ** 2, _TINY))
    n_bend, half = power.shape[1], _WINDOW // 2
    begin = np.clip(np.arange(-1, n_bend + 1) - half, 0, max(0, n_bend - _WINDOW))
    # The median of an exponential distribution is ln 2 of its mean.
    return np.stack([np.median(power[:, at : at + _WINDOW], axis=1) / np.log(2) for at in begin.tolist()], axis=1)


def leaving_out(
    estimate: Estimator,
    frequency_hz: FloatArray,
    response: ComplexArray,
    variance: FloatArray,
    errors: ComplexArray,
    extremum: int,
    kind: Kind,
) -> FloatArray:
    """Finds an extremum again with each realization left out.

    Args:
        estimate: The local model that found it.
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq,): Response in continuous time.
        variance (n_freq,): Its variance, which weighs the lines.
        errors (n_real, n_freq): What each realization adds to it.
        extremum: Index of the line with the extremum, not at an edge.
        kind: Whether a peak or a dip is wanted.

    Returns:
        Peak and undamped frequency (n_real, 2); a local model that no longer holds gives the line instead [Hz].
    """
    count, found = len(errors), []
    for error in errors:
        left = response - error * count / (count - 1)
        near = np.abs(left[extremum - 1 : extremum + 2])
        best = extremum - 1 + int(near.argmax() if kind == "resonance" else near.argmin())
        best = min(max(best, 1), frequency_hz.size - 2)
        mode: LocalMode | None = estimate(frequency_hz, left, variance, best, kind)
        found.append([frequency_hz[best]] * 2 if mode is None else [mode.peak_hz, mode.frequency_hz])
    return np.array(found)


def jackknife_variance(left_out: FloatArray) -> FloatArray:
    """Variance (...) of an estimate from what it is with each of n parts left out (n, ...).

    Source:
        Efron and Stein (1981), The jackknife estimate of variance.
    """
    count = len(left_out)
    return np.asarray((count - 1) * np.var(left_out, axis=0))


def half_width(own: tuple[float, float], scatter: Sequence[tuple[float, float]], confidence: float) -> float:
    """Half width of an interval that holds the largest of some variances.

    Args:
        own: Variance that the response's covariance gives, and its degrees of freedom.
        scatter: Variances seen in another way, each with its degrees of freedom.
        confidence: Level of the interval.

    Returns:
        Quantile of Student's distribution times the deviation; the degrees of freedom are those of the variances
        together, so that an own variance of many stands against a scatter of few.

    Source:
        Satterthwaite (1946).
    """
    every = [own, *scatter]
    total = sum(variance for variance, _ in every)
    spent = sum(variance**2 / freedom for variance, freedom in every)
    freedom = total**2 / spent if spent > 0 else np.inf
    return float(t.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(max(variance for variance, _ in every)))
