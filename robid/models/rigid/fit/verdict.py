"""Whether least squares is to be trusted: four tests, one level of false alarm, one sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.models.rigid.fit.huber import HuberRegression
from robid.models.rigid.fit.least_squares import Regression
from robid.models.rigid.fit.options import VerdictOptions
from robid.models.rigid.fit.residual_tests import Normality, Whiteness, check_normality, check_whiteness
from robid.models.rigid.fit.uncertainty import LongRun

_UNTESTED = "Do not trust: too few rows are left to test the residuals; record longer, or drop fewer rows."


@dataclass(frozen=True)
class Variation:
    """Difference of two estimates.

    Attributes:
        relative (n_param,): Magnitude of the difference over max(|X|, 3 sd), a first moment's over its vector's.
        p_value (n_param,): Chance of estimators of the same thing to differ as much.
        alarm: Whether a difference both matters and cannot be chance.
    """

    relative: FloatArray
    p_value: FloatArray
    alarm: bool


@dataclass(frozen=True)
class Verdict:
    """Whether least squares is to be trusted.

    Attributes:
        trust: The verdict.
        sentence: It in words, with what to do.
        huber: Difference from Huber's estimate (eq. 22).
        instruments: Difference from the instrumental variables; None where there are none.
        normality: Shape of each joint's residuals.
        whiteness: Correlation of each joint's residuals.
        normality_alarm: Whether a joint's residuals are far from a Gaussian.
        whiteness_alarm: Whether a joint's residuals are far from white.
        untested: Whether a joint has too few rows for these tests.
    """

    trust: bool
    sentence: str
    huber: Variation
    instruments: Variation | None
    normality: tuple[Normality, ...]
    whiteness: tuple[Whiteness, ...]
    normality_alarm: bool
    whiteness_alarm: bool
    untested: bool = False


def judge(
    least_squares: Regression,
    huber: HuberRegression,
    instruments: Regression | None,
    long_run: LongRun,
    residual: FloatArray,
    expected: FloatArray,
    names: Sequence[str],
    *,
    vectors: Sequence[Sequence[int]] = (),
    options: VerdictOptions | None = None,
) -> Verdict:
    """Judges a least-squares estimate.

    Args:
        least_squares: The estimate.
        huber: Huber's estimate from the same rows.
        instruments: The estimate by instrumental variables, if any.
        long_run: Joint covariance of these, in this order.
        residual (n_row, n_joint): Residuals of least squares on rows decimated to twice the cut-off [N m, or N].
        expected (n_joint, n_lag + 1): Autocorrelation to be expected of each joint's, see `expected_correlation`.
        names: Names of the parameters.
        vectors: Indices of the parameters that are one vector, such as a body's first moments.
        options: When to speak.

    Source:
        Janot et al. (2009), eq. 22 and sec. IV; Hausman (1978); METHODS sec. 7.
    """
    chosen = options or VerdictOptions()
    share = chosen.level / (3 if instruments is None else 4)
    size = scale_of(least_squares.parameters, np.sqrt(np.diag(long_run.of(0))), vectors)
    compared = [
        _vary(least_squares.parameters - other.parameters, size, long_run, index, share, chosen)
        for index, other in enumerate((huber, instruments), 1)
        if other is not None
    ]
    normality = tuple(check_normality(joint) for joint in residual.T)
    whiteness = tuple(check_whiteness(joint, own) for joint, own in zip(residual.T, expected, strict=True))
    single = share / residual.shape[1]
    odd = any(
        joint.p_value < single and max(abs(joint.skewness), joint.excess_kurtosis / 2) > chosen.shape
        for joint in normality
    )
    coloured = any(joint.p_value < single and joint.largest > chosen.correlation for joint in whiteness)
    against = compared[1] if instruments is not None else None
    chances = [joint.p_value for joint in normality] + [joint.p_value for joint in whiteness]
    untested = bool(np.isnan(chances).any())
    sentence = _sentence(compared[0], against, odd, coloured, names)
    trust = not (untested or odd or coloured or any(variation.alarm for variation in compared))
    if untested and not (odd or coloured or any(variation.alarm for variation in compared)):
        sentence = _UNTESTED
    return Verdict(trust, sentence, compared[0], against, normality, whiteness, odd, coloured, untested)


def scale_of(parameters: FloatArray, deviation: FloatArray, vectors: Sequence[Sequence[int]]) -> FloatArray:
    """Returns what differences (n_param,) are relative to: max(|X|, 3 sd), for a vector's components its norm."""
    size = np.abs(parameters)
    for vector in vectors:
        size[list(vector)] = np.linalg.norm(parameters[list(vector)])
    return np.asarray(np.maximum(size, 3 * deviation))


def _vary(
    difference: FloatArray, size: FloatArray, long_run: LongRun, index: int, share: float, options: VerdictOptions
) -> Variation:
    deviation = np.sqrt(np.diag(long_run.difference(0, index)))
    chance = 2 * student.sf(np.abs(difference) / np.maximum(deviation, np.finfo(float).tiny), long_run.freedom)
    relative = np.abs(difference) / size
    alarm = bool(np.any((relative > options.variation) & (chance < share / len(difference))))
    return Variation(relative, np.asarray(chance), alarm)


def _sentence(huber: Variation, instruments: Variation | None, odd: bool, coloured: bool, names: Sequence[str]) -> str:
    """States the strongest objection and its remedy."""
    if instruments is not None and instruments.alarm:
        return (
            f"Do not trust: {_largest(instruments, names)} away from the instrumental variables, so noise biases it; "
            "use these, or filter the positions lower."
        )
    if huber.alarm:
        return f"Do not trust: {_largest(huber, names)} away from Huber's estimate; filter the positions lower."
    if coloured:
        return (
            "Do not trust: the residuals are correlated in time, so the model lacks a torque or the positions' noise "
            "passes their filter; filter lower, or extend the friction."
        )
    if odd:
        return "Do not trust: the residuals are not Gaussian; find the outliers, or use Huber's estimate."
    others = "Huber's estimate" if instruments is None else "Huber's estimate and the instrumental variables"
    return f"Trust: {others} agree within what noise explains, and the residuals are white and Gaussian."


def _largest(variation: Variation, names: Sequence[str]) -> str:
    index = int(np.argmax(variation.relative))
    return f"{names[index]} is {100 * variation.relative[index]:.2g} %"
