"""Instrumental variables beside least squares and Huber, and whether least squares is to be trusted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.options import ConclusionOptions, InstrumentOptions, VerdictOptions
from robid.models.rigid.fit.regression import (
    HuberRegression,
    Reduction,
    Regression,
    huber,
    ordinary_least_squares,
    reduce_rows,
    residuals,
    weighted_least_squares,
)
from robid.models.rigid.fit.residuals import (
    Influence,
    LongRun,
    Normality,
    Whiteness,
    check_normality,
    check_whiteness,
    expected_correlation,
    huber_influence,
    least_squares_influence,
    long_run_covariance,
)
from robid.models.rigid.fit.rows import RowSource
from robid.signals.filters import Decimator

_WAY = (0.0, 0.5, 0.8, 1.0)


def instrumental_variables(
    instrumented: Callable[[FloatArray], RowSource | None],
    start: Regression,
    options: InstrumentOptions | None = None,
    known: FloatArray | None = None,
) -> tuple[Regression, Influence, RowSource]:
    """Estimates with the simulated model as instrument, simulated again until the parameters stay.

    `instrumented` simulates parameters (n_param,) and returns the rows with these instruments, None where the
    simulation is lost; where rows are dropped, the instrument's speed decides. Least squares on badly filtered rows may
    be no robot at all: the simulation then begins on the way to `known` (n_param,), such as the robot file's. The
    estimate comes with its linearisation and the rows of its last simulation.

    Raises:
        ValueError: If the rows have no instruments, or these do not determine the parameters.
        DataError: If nothing can be simulated.

    Source:
        Janot, Vandanjon and Gautier (2014), "A generic instrumental variable approach for industrial robot
        identification".
    """
    chosen = options or InstrumentOptions()
    parameters, weights = start.parameters, start.weights
    status: Literal["converged", "iteration_limit"] = "iteration_limit"
    iterations = 0
    while status != "converged" and iterations < chosen.iteration_limit:
        iterations += 1
        rows = _simulated(instrumented, parameters, parameters if known is None else known)
        found, influence = solve_instruments(rows, weights)
        step = np.abs(found.parameters - parameters)
        parameters = found.parameters
        if np.all(step <= chosen.tolerance * found.standard_deviation):
            status = "converged"
    return replace(found, iterations=iterations, status=status), influence, rows


def _simulated(
    instrumented: Callable[[FloatArray], RowSource | None], parameters: FloatArray, known: FloatArray
) -> RowSource:
    """Rows with instruments of some parameters, or as near to them as can be simulated on the way to known ones."""
    for share in _WAY:
        rows = instrumented(parameters + share * (known - parameters))
        if rows is not None:
            return rows
    message = "D181 the model cannot be simulated in its loop, not even with the robot file's values"
    raise DataError(message, where="record", remedy="state `instruments: none`, or correct the robot file")


def solve_instruments(rows: RowSource, weights: FloatArray) -> tuple[Regression, Influence]:
    """Estimates with the instruments that the rows bring, by weights (n_joint,), and linearises the estimate.

    Raises:
        ValueError: If the rows have no instruments or these do not determine the parameters.
    """
    # x = (Z^T W)^-1 Z^T y with the weights of the joints; each column is scaled by the norm of its instrument, so that
    # the condition number says what the motion is worth.
    cross, right, square = _products(rows)
    scale = 1 / np.sqrt(np.diag(np.einsum("j,jab->ab", weights, square)))
    matrix = scale[:, None] * np.einsum("j,jab->ab", weights, cross) * scale
    condition = float(np.linalg.cond(matrix))
    if not condition < 1 / np.finfo(float).eps:
        raise ValueError("The instruments do not determine all parameters: fit base parameters, on a richer motion.")
    bread = scale[:, None] * np.linalg.inv(matrix) * scale
    parameters = bread @ (weights @ right)
    residual = residuals(rows, parameters)
    n_row = np.sum(np.isfinite(residual), axis=0)
    share = len(parameters) / n_row.sum()
    # Parameters take degrees of freedom from each joint in proportion to its rows.
    deviation = np.sqrt(np.nansum(residual**2, axis=0) / (n_row * (1 - share)))
    # The sandwich: (Z^T W)^-1 Z^T S Z (Z^T W)^-T with the residual variance of each joint in S.
    covariance = bread @ np.einsum("j,jab->ab", (weights * deviation) ** 2, square) @ bread.T
    found = Regression(parameters, covariance, deviation, n_row, weights, condition)
    return found, Influence(parameters, bread, weights, np.full(len(weights), np.inf), instrumented=True)


def _products(source: RowSource) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums the products of instruments with columns, torques and themselves, joint by joint."""
    sums: list[FloatArray] = []
    for rows in source:
        if rows.instruments is None:
            raise ValueError("The rows have no instruments: simulate the model along the same reference.")
        columns, torque = rows.columns.swapaxes(0, 1), rows.torque.T[..., None]
        # Rows that do not count have instruments of zero: they drop out of all three products.
        counted = np.where(rows.used[..., None], rows.instruments, 0.0).transpose(1, 2, 0)
        parts = [counted @ columns, (counted @ torque)[..., 0], counted @ counted.swapaxes(1, 2)]
        sums = [old + new for old, new in zip(sums, parts, strict=True)] if sums else parts
    return sums[0], sums[1], sums[2]


_UNTESTED = "Too few rows are left to test the residuals; record longer, or drop fewer rows."


@dataclass(frozen=True)
class Variation:
    """Difference of two estimates."""

    # (n_param,): magnitude of the difference over max(|X|, 3 sd), a first moment's over its vector's.
    relative: FloatArray
    p_value: FloatArray  # (n_param,): chance of estimators of the same thing to differ as much
    alarm: bool  # whether a difference both matters and cannot be chance


@dataclass(frozen=True)
class Verdict:
    """Whether least squares is to be trusted."""

    trust: bool  # the verdict
    sentence: str  # what the tests found, in words, with what to do
    huber: Variation  # difference from Huber's estimate (eq. 22)
    instruments: Variation | None  # difference from the instrumental variables; None where there are none
    normality: tuple[Normality, ...]  # shape of each joint's residuals
    whiteness: tuple[Whiteness, ...]  # correlation of each joint's residuals
    normality_alarm: bool  # whether a joint's residuals are far from a Gaussian
    whiteness_alarm: bool  # whether a joint's residuals are far from white
    untested: bool = False  # whether a joint has too few rows for these tests


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

    The joint covariance `long_run` is of least squares, Huber and instruments if any, the residual (n_row, n_joint) of
    least squares on rows decimated to twice the cut-off [N m, or N], and `expected` (n_joint, n_lag + 1) as of
    `expected_correlation`; `vectors` are indices of parameters that are one vector.

    Source:
        Janot et al. (2009), eq. 22 and sec. IV; Hausman (1978); docs/methods, sec. 7.
    """
    chosen = options or VerdictOptions()
    # Bonferroni: the level of all alarms together is shared by differences, shape and whiteness, and within each by its
    # single tests.
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
    # The variances have few degrees of freedom (see the long-run covariance), so that Student's t decides.
    chance = 2 * student.sf(np.abs(difference) / np.maximum(deviation, np.finfo(float).tiny), long_run.freedom)
    relative = np.abs(difference) / size
    alarm = bool(np.any((relative > options.variation) & (chance < share / len(difference))))
    return Variation(relative, np.asarray(chance), alarm)


def _sentence(huber: Variation, instruments: Variation | None, odd: bool, coloured: bool, names: Sequence[str]) -> str:
    if instruments is not None and instruments.alarm:
        return (
            f"Least squares has {_largest(instruments, names)} away from the instrumental variables, so noise biases"
            " it; use these, or filter the positions lower."
        )
    if huber.alarm:
        return f"Least squares has {_largest(huber, names)} away from Huber's estimate; filter the positions lower."
    if coloured:
        return (
            "The residuals are correlated in time, so the model lacks a torque or the positions' noise "
            "passes their filter; filter lower, or extend the friction."
        )
    if odd:
        return "The residuals are not Gaussian; find the outliers, or use Huber's estimate."
    others = "Huber's estimate" if instruments is None else "Huber's estimate and the instrumental variables"
    return f"{others} agree with least squares within what noise explains; the residuals are white and Gaussian."


def _largest(variation: Variation, names: Sequence[str]) -> str:
    index = int(np.argmax(variation.relative))
    return f"{names[index]} {100 * variation.relative[index]:.2g} %"


LEAST_SQUARES, HUBER, INSTRUMENTS = range(3)
"""Order of the estimators in the joint covariance."""


@dataclass(frozen=True)
class Conclusion:
    """What the rows say."""

    reduction: Reduction  # the rows, reduced
    least_squares: Regression  # plain or weighted least squares
    huber: HuberRegression  # Huber's estimate
    instruments: Regression | None  # instrumental variables, or None
    long_run: LongRun  # their joint covariance that respects correlated residuals, in this order
    residual: FloatArray  # (n_row, n_joint): residuals of least squares, NaN where a row is not used [N m, or N]
    verdict: Verdict  # whether to trust least squares


def conclude(
    source: RowSource,
    decimator: Decimator,
    names: Sequence[str],
    instruments: tuple[Regression, Influence] | None = None,
    *,
    vectors: Sequence[Sequence[int]] = (),
    options: ConclusionOptions | None = None,
) -> Conclusion:
    """Fits rows, decimated to twice the cut-off, by least squares and by Huber, and judges the fit.

    `vectors` are indices of parameters that are one vector, such as a body's first moments.
    """
    chosen = options or ConclusionOptions()
    reduction = reduce_rows(source)
    fitted = weighted_least_squares(reduction) if chosen.weighted else ordinary_least_squares(reduction)
    robust = huber(source, reduction, chosen.huber)
    residual = residuals(source, fitted.parameters)
    influences = [
        least_squares_influence(reduction, fitted),
        huber_influence(reduction, robust, chosen.huber.bend),
        *([] if instruments is None else [instruments[1]]),
    ]
    long_run = long_run_covariance(source, influences, len(residual), float(reduction.n_row.mean()))
    expected = expected_correlation(source, reduction, fitted, decimator.autocorrelation(chosen.verdict.lags))
    found = None if instruments is None else instruments[0]
    verdict = judge(fitted, robust, found, long_run, residual, expected, names, vectors=vectors, options=chosen.verdict)
    return Conclusion(reduction, fitted, robust, found, long_run, residual, verdict)
