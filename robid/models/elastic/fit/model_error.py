"""Model error: what the residual holds beyond the response's covariance, per element and configuration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.stats import f, norm

from robid.arrays import BoolArray, ComplexArray, FloatArray, Quantity
from robid.frf.local import mean_correlation
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import Influence, influence, structured_covariance

_LEVEL = 0.95
_BISECTIONS = 60


_ELEMENT = "configuration output input"


@dataclass(frozen=True)
class ModelError:
    """The residual of every element against its expectation."""

    # Cost with weights of the covariance alone, over its expectation; NaN where an element has no line with a weight
    ratio: Annotated[FloatArray, Quantity("1", _ELEMENT, "Cost by the covariance alone over its expectation")]
    limit: Annotated[FloatArray, Quantity("1", _ELEMENT, "What an exact model exceeds in 5 % of all cases")]
    level: Annotated[
        FloatArray, Quantity("1", _ELEMENT, "Relative model error beyond the covariance, 0 within the limit")
    ]
    correlation: Annotated[FloatArray, Quantity("1", _ELEMENT, "Correlation of residuals at neighbouring lines")]
    correlation_limit: Annotated[FloatArray, Quantity("1", _ELEMENT, "What white residuals exceed in 5 % of all cases")]

    @property
    def count(self) -> int:
        """Number of elements of which something is known."""
        return int(np.isfinite(self.ratio).sum())

    @property
    def share_above(self) -> float:
        """Share of the elements above their band; 0.05 is expected of an exact model."""
        return _share(self.ratio > self.limit, np.isfinite(self.ratio))

    @property
    def share_correlated(self) -> float:
        """Share of the elements whose residuals are correlated over frequency; 0.05 is expected of an exact model."""
        return _share(self.correlation > self.correlation_limit, np.isfinite(self.ratio))

    @property
    def median_level(self) -> float:
        """Median relative model error of the elements above their band; 0 without any."""
        above = self.level[self.level > 0]
        return float(np.median(above)) if above.size else 0.0


@dataclass(frozen=True)
class Expectation:
    """What noise alone leaves of every element's residual, were the model exact."""

    variance: FloatArray  # (n_conf, n_freq, n_out, n_in) Relative variance of the response; 1 where a line has no part
    used: BoolArray  # (n_conf, n_freq, n_out, n_in) Which lines have part in it
    kept: FloatArray  # (n_conf, n_out, n_in) Sum of squares over variance that is expected
    freedom: FloatArray  # (n_conf, n_out, n_in) Real degrees of freedom of that sum
    known: FloatArray  # (n_conf, n_out, n_in) Real degrees of freedom behind the variance
    bias: float  # Factor on the sum: the inverse of an estimated variance is too large in the mean

    @property
    def limit(self) -> FloatArray:
        """Ratio (n_conf, n_out, n_in) of a sum over its expectation that an exact model exceeds in 5 % of all cases."""
        # The ratio of a right model is Fisher distributed: what the residual has left over what the covariance was
        # estimated from.
        return np.asarray(f.ppf(_LEVEL, self.freedom, self.known))

    def ratio(self, square: FloatArray) -> FloatArray:
        """Sum (n_conf, n_out, n_in) of squared relative residuals over what is expected; NaN for unused elements."""
        total = (np.where(self.used, square, 0.0) / self.variance).sum(axis=1)
        expected = np.divide(total, self.kept, out=np.full_like(total, np.nan), where=self.kept > 0)
        return np.asarray(self.bias * expected)


def expect(problem: Problem, internal: FloatArray, found: Influence, modelled: ComplexArray) -> Expectation | None:
    """Says what the response's covariance lets expect of the residual.

    Args:
        problem: The problem, at its minimum; its weights choose the lines that count.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        modelled (n_conf, n_freq, n_out, n_in): The model's response there.

    Returns:
        The expectation; None without a covariance.
    """
    frf = problem.frf
    shown = np.where(modelled == 0, 1.0, modelled)  # nothing is relative to zero: such elements do not count
    variance = frf.element_variance() / np.abs(shown) ** 2
    used = (problem.weight > 0) & (variance > 0) & (modelled != 0)
    if not used.any():
        return None
    variance = np.where(used, variance, 1.0)
    kept, freedom = _expected(problem, internal, found, np.where(used, 1 / variance, 0.0), shown)
    # The inverse of an estimated variance is too large in the mean, by n / (n - 1) of n complex degrees of freedom.
    bias = (frf.degrees_of_freedom - 1) / frf.degrees_of_freedom if frf.degrees_of_freedom > 1 else 1.0
    n_line = used.sum(axis=1)
    known = frf.degrees_of_freedom if frf.realization_error is None else n_line * (frf.realization_error.shape[1] - 1)
    behind = np.broadcast_to(2 * np.maximum(known, 0.5), kept.shape)
    return Expectation(variance, used, kept, np.maximum(freedom, 0.5), behind, bias)


def estimate_model_error(problem: Problem, internal: FloatArray, found: Influence) -> ModelError | None:
    """Compares each element's residual with what the response's covariance lets expect.

    Args:
        problem: The problem, at its minimum; its weights choose the lines that count.
        internal (n_param,): The minimum.
        found: The estimator linearised there.

    Returns:
        Ratios, bands, and the model error that inflated weights need; None without a covariance.

    Source:
        docs/methods, sec. 5; the level is the moment estimator of Paule and Mandel (1982).
    """
    modelled = problem.model_response(internal)
    expected = expect(problem, internal, found, modelled)
    if expected is None:
        return None
    residual = relative_residual(problem, problem.residual(internal, modelled), modelled)
    square = np.where(expected.used, np.abs(residual) ** 2, 0.0)
    ratio, limit = expected.ratio(square), expected.limit
    # Beyond that, the error of the model is what brings the cost back to its expectation.
    level = np.where(ratio > limit, _level(square, expected.variance / expected.bias, expected.kept), 0.0)
    whitened = np.where(expected.used, residual / np.sqrt(expected.variance), 0.0)
    correlation, pairs = _correlation(whitened, expected.used, problem.frf.line_correlation)
    band = norm.ppf(_LEVEL) / np.sqrt(problem.residual_kind.parts * np.maximum(pairs, 1))
    return ModelError(ratio, limit, level, correlation, band)


def relative_residual(problem: Problem, residual: ComplexArray, modelled: ComplexArray) -> ComplexArray:
    """Residuals (n_conf, n_freq, n_out, n_in, ...) as relative errors of the response, of as much power.

    Where only magnitudes count, a residual has one part of two.
    """
    kind = problem.residual_kind
    per_relative = kind.per_relative(np.where(modelled == 0, 1.0, modelled))
    divisor = per_relative.reshape(*per_relative.shape, *(1,) * (residual.ndim - per_relative.ndim))
    return np.asarray(np.sqrt(2 / kind.parts) * residual / divisor)


def _expected(
    problem: Problem, internal: FloatArray, found: Influence, precision: FloatArray, shown: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Cost of each element (n_conf, n_out, n_in) that an exact model leaves, and the degrees of freedom behind it.

    A fit takes away a share of an element's own noise and adds what the noise of all others does to its parameters:
    weights that allow for a model error leave more than the noise in elements that are better than that.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        precision (n_conf, n_freq, n_out, n_in): One over the relative variance; 0 where a line does not count.
        shown (n_conf, n_freq, n_out, n_in): The model's response.

    Source:
        The residual covariance `(I - H) S (I - H)'` of a linear estimator; Satterthwaite (1946).
    """
    rows = problem.residual_kind.parts
    derivative = problem.linear(internal)[1]
    derivative = derivative / problem.residual_kind.per_relative(shown)[..., None]
    noise = structured_covariance(replace(problem, model_error=np.zeros(())), found)
    count = (precision > 0).sum(axis=1)
    # What the fit leaves of an element's own noise; a leverage counts twice, in (I - H) S (I - H)', but for its square,
    # which `moved` has.
    own = np.maximum(np.where(precision > 0, 1 - 2 * found.leverage / rows, 0.0).sum(axis=1), 0.0)
    scaled = np.sqrt(precision)[..., None] * derivative
    scaled = np.concatenate([scaled.real, scaled.imag], axis=1).transpose(0, 2, 3, 1, 4)
    # The covariance that the errors of all parameters add to this element's residuals, over its noise.
    moved = np.swapaxes(scaled, -1, -2) @ scaled @ noise * (2 / rows)
    added = np.trace(moved, axis1=-2, axis2=-1)
    spread = np.einsum("coipq,coiqp->coi", moved, moved)
    # Satterthwaite: the freedom of the sum from the squares of its parts.
    share = np.divide(own**2, rows * count, out=np.zeros_like(own), where=count > 0) + spread
    total = own + added
    return total, np.divide(total**2, share, out=np.zeros_like(total), where=share > 0)


def element_level(problem: Problem, internal: FloatArray) -> FloatArray | None:
    """Relative model error (n_conf, n_out, n_in) that weights `estimated` allow for after a fit; None if unknown."""
    error = estimate_model_error(problem, internal, influence(problem, internal))
    return None if error is None else error.level


def _share(above: BoolArray, known: BoolArray) -> float:
    return float(above[known].mean()) if known.any() else 0.0


def _level(square: FloatArray, variance: FloatArray, kept: FloatArray) -> FloatArray:
    """Solves `sum square / (variance + level^2) = kept` by bisection over the logarithm of the level."""
    low = np.full(kept.shape, -50.0)
    high = 0.5 * np.log(square.sum(axis=1) / np.maximum(kept, 1e-300) + 1e-300) + 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        above = (square / (variance + np.exp(2 * middle)[:, None])).sum(axis=1) > kept
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(np.exp(0.5 * (low + high)))


def _correlation(whitened: FloatArray, used: BoolArray, known: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Correlation of neighbouring lines (n_conf, n_out, n_in) beyond what is known, and the pairs behind it."""
    pairs = (used[:, 1:] & used[:, :-1]).sum(axis=1)
    product = np.real(whitened[:, 1:] * whitened[:, :-1].conj()).sum(axis=1)
    # The lag-one correlation, over the mean power of as many lines as there are pairs.
    power = (np.abs(whitened) ** 2).sum(axis=1) * pairs / np.maximum(used.sum(axis=1), 1)
    found = np.divide(product, power, out=np.zeros_like(product), where=power > 0)
    if known is None:
        return found, pairs
    # Windows that overlap correlate residuals without any error of the model.
    alike = mean_correlation(known, np.asarray(used.any(axis=(2, 3))))
    return found - alike[:, :1, None], pairs / (1 + 2 * (alike**2).sum(axis=1))[:, None, None]
