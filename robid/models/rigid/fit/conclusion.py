"""All estimators on the same rows, their joint uncertainty, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robid.arrays import FloatArray
from robid.models.rigid.fit.huber import HuberRegression, huber
from robid.models.rigid.fit.least_squares import Regression, ordinary_least_squares, weighted_least_squares
from robid.models.rigid.fit.options import ConclusionOptions
from robid.models.rigid.fit.reduction import Reduction, reduce_rows, residuals
from robid.models.rigid.fit.residual_tests import expected_correlation
from robid.models.rigid.fit.rows import RowSource
from robid.models.rigid.fit.uncertainty import (
    Influence,
    LongRun,
    huber_influence,
    least_squares_influence,
    long_run_covariance,
)
from robid.models.rigid.fit.verdict import Verdict, judge
from robid.signals.filters import Decimator

LEAST_SQUARES, HUBER, INSTRUMENTS = range(3)
"""Order of the estimators in the joint covariance."""


@dataclass(frozen=True)
class Conclusion:
    """What the rows say.

    Attributes:
        reduction: The rows, reduced.
        least_squares: Plain or weighted least squares.
        huber: Huber's estimate.
        instruments: Instrumental variables, or None.
        long_run: Their joint covariance that respects correlated residuals, in this order.
        residual (n_row, n_joint): Residuals of least squares, NaN where a row is not used [N m, or N].
        verdict: Whether to trust least squares.
    """

    reduction: Reduction
    least_squares: Regression
    huber: HuberRegression
    instruments: Regression | None
    long_run: LongRun
    residual: FloatArray
    verdict: Verdict


def conclude(
    source: RowSource,
    decimator: Decimator,
    names: Sequence[str],
    instruments: tuple[Regression, Influence] | None = None,
    *,
    vectors: Sequence[Sequence[int]] = (),
    options: ConclusionOptions | None = None,
) -> Conclusion:
    """Fits rows by least squares and by Huber, and judges the fit.

    Args:
        source: The rows, decimated to twice the cut-off.
        decimator: What decimated them.
        names: Names of the parameters.
        instruments: Instrumental variables from the same rows, if any.
        vectors: Indices of the parameters that are one vector, such as a body's first moments.
        options: How.
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
