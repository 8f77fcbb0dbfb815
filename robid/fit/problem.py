"""The elastic least-squares problem: residual, weights, cost and normal equations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.friction import FrictionMove, friction_move
from robid.fit.levenberg import Normal
from robid.fit.options import ElasticOptions, Weights
from robid.fit.parameters import ParameterMap
from robid.frf.frf import Frf
from robid.robot.linearize import LinearModel
from robid.robot.response import jacobian, response

_MIN_SNR = 10.0


@dataclass(frozen=True)
class Problem:
    """Measured against parametric response.

    Attributes:
        frf: Measured response.
        model: Linearised robot in the same configurations.
        parameters: What is estimated.
        estimator: `lls` or `nls`.
        weight (n_conf, n_freq, n_out, n_in): Weight of each squared residual.
        model_error: Relative model error that the weights assume.
    """

    frf: Frf
    model: LinearModel
    parameters: ParameterMap
    estimator: str
    weight: FloatArray
    model_error: float

    @cached_property
    def friction(self) -> FrictionMove:
        """How the measured response follows the friction scales."""
        return friction_move(self.frf)

    def model_response(self, internal: FloatArray) -> ComplexArray:
        """Parametric response (n_conf, n_freq, n_out, n_in)."""
        values = self.parameters.parameters(internal)
        return response(self.model, values, self.frf.frequency_hz, self.frf.hold_period_s).sampled

    def measured(self, internal: FloatArray) -> ComplexArray:
        """Measured response, friction compensation moved by the estimated friction scales."""
        count = self.parameters.n_friction
        return self.friction.moved(internal[-count:]) if count else self.frf.response

    def residual(self, internal: FloatArray, modelled: ComplexArray) -> ComplexArray:
        """Residual (n_conf, n_freq, n_out, n_in), Wernholt and Moberg (2008) eq. 4c or 7c."""
        if self.estimator == "nls":
            return np.asarray(self.measured(internal) - modelled)
        return np.asarray(np.log(self.measured(internal) / modelled))

    def cost(self, internal: FloatArray) -> float:
        """Weighted cost, eq. 4b or 7b, with half the squared friction scales over their variance."""
        with np.errstate(all="ignore"):
            error = self.residual(internal, self.model_response(internal))
            total = float((self.weight * np.abs(error) ** 2).sum()) + self._prior_cost(internal)
        return total if np.isfinite(total) else np.inf

    def configuration_cost(self, modelled: ComplexArray, internal: FloatArray) -> FloatArray:
        """Weighted cost of each configuration (n_conf,)."""
        error = self.residual(internal, modelled)
        return np.asarray((self.weight * np.abs(error) ** 2).sum(axis=(1, 2, 3)))

    def linear(self, internal: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Residual and its negative derivative (n_conf, n_freq, n_out, n_in, n_param)."""
        values = self.parameters.parameters(internal)
        period = self.frf.hold_period_s
        result = response(self.model, values, self.frf.frequency_hz, period)
        plain = jacobian(self.model, values, result, self.parameters.kinds, period)[..., self.parameters.columns()]
        count = self.parameters.n_friction
        slopes = self.parameters.slopes(internal)
        derivative = plain * slopes[: slopes.size - count]
        if self.estimator == "lls":
            derivative /= result.sampled[..., None]
        if count:
            moved = -self.friction.slopes(internal[-count:])
            if self.estimator == "lls":
                moved = moved / self.measured(internal)[..., None]
            derivative = np.concatenate([derivative, moved], axis=-1)
        return self.residual(internal, result.sampled), derivative

    def normal(self, internal: FloatArray) -> Normal:
        """Cost, half gradient and half Gauss-Newton Hessian."""
        error, derivative = self.linear(internal)
        root = np.sqrt(self.weight)
        rows = (root[..., None] * derivative).reshape(-1, derivative.shape[-1])
        target = (root * error).ravel()
        real, target_real = np.concatenate([rows.real, rows.imag]), np.concatenate([target.real, target.imag])
        precision = 0.5 / self.parameters.prior_std**2
        hessian = real.T @ real + np.diag(precision)
        gradient = -(real.T @ target_real) + precision * internal
        return Normal(float(target_real @ target_real) + self._prior_cost(internal), gradient, hessian)

    def _prior_cost(self, internal: FloatArray) -> float:
        return float((0.5 * (internal / self.parameters.prior_std) ** 2).sum())


def make_weights(frf: Frf, weights: Weights, estimator: str, size: FloatArray | None = None) -> tuple[FloatArray, int]:
    """Weights of the squared residuals.

    Args:
        frf: Measured response with its variance.
        weights: Which weights.
        estimator: `lls` or `nls`; the logarithm drops elements below 10 dB.
        size (n_conf, n_freq, n_out, n_in): Magnitude that errors are relative to, the measured one by default.
            A fitted model's is better: noise then does not choose its own weight.

    Returns:
        Weights (n_conf, n_freq, n_out, n_in) and the number of dropped elements. Without a covariance the
        model error takes the place of the noise.

    Source:
        Wernholt and Moberg (2008), eq. 6, 8 and sec. 6; METHODS sec. 5.
    """
    power = (np.abs(frf.response) if size is None else size) ** 2
    variance = frf.element_variance()
    relative = np.divide(variance, power, out=np.full(power.shape, np.inf), where=power > 0)
    freedom = frf.degrees_of_freedom
    inverse_bias = (freedom - 1) / freedom if freedom > 1 else 1.0
    if weights.kind == "user":
        base = np.where(np.eye(*power.shape[2:]) > 0, 1.0, weights.off_diagonal) + np.zeros(power.shape)
        typical = float((base * relative).sum() / max((base > 0).sum(), 1))
        base = base / (typical if 0 < typical < np.inf else weights.model_error**2 or 1.0)
    elif variance.any():
        floor = weights.model_error**2 if weights.kind == "inflated" else 0.0
        base = inverse_bias / (relative + floor)
    else:
        base = np.full(power.shape, 1 / (weights.model_error**2 or 1.0))
    if estimator == "nls":
        base = np.divide(base, power, out=np.zeros(power.shape), where=power > 0)
    below = relative > 1 / _MIN_SNR
    dropped = below if estimator == "lls" else np.zeros_like(below)
    keep = ~dropped & (frf.frequency_hz >= weights.low_cut_hz)[None, :, None, None]
    return np.where(keep, base, 0.0), int(dropped.sum())


def make_problem(
    frf: Frf,
    model: LinearModel,
    parameters: ParameterMap,
    options: ElasticOptions,
    internal: FloatArray | None = None,
) -> tuple[Problem, int]:
    """Sets up the problem; where fitted internal values are known, the weights follow the fitted response.

    Returns:
        The problem and the number of elements that the logarithm drops.
    """
    size = None
    if internal is not None:
        values = parameters.parameters(internal)
        size = np.abs(response(model, values, frf.frequency_hz, frf.hold_period_s).sampled)
    weight, dropped = make_weights(frf, options.weights, options.estimator, size)
    model_error = options.weights.model_error if options.weights.kind == "inflated" else 0.0
    return Problem(frf, model, parameters, options.estimator, weight, model_error), dropped
