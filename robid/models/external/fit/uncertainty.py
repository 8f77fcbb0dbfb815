"""How far responses and outputs of fitted transfer functions may be off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.hold import Cascade, build_cascade, discretise, propagate
from robid.models.external.fit.transfer import TransferMatrix, delayed


@dataclass(frozen=True)
class ResponseDeviation:
    """Standard deviations of a response (n_freq, n_out, n_in).

    Attributes:
        magnitude: Of the magnitude over itself.
        phase_rad: Of the phase [rad].
    """

    magnitude: FloatArray
    phase_rad: FloatArray

    @property
    def largest(self) -> FloatArray:
        """Deviation (n_freq, n_out, n_in) of the complex response over its magnitude."""
        return np.hypot(self.magnitude, self.phase_rad)


def response_deviation(
    model: TransferMatrix, root: FloatArray, omega: FloatArray, *, sampled: bool = False
) -> ResponseDeviation:
    """Propagates the coefficients' covariance to the response.

    The continuous response of a model with poles beyond the sampling is often not determined where that from samples
    to samples is.

    Args:
        model: The transfer functions.
        root (n_param, n_root): Root of the covariance of `[numerators, denominator]` without the latter's first.
        omega (n_freq,): Frequencies [rad/s].
        sampled: Whether the response is that from samples to samples, with hold and average.
    """
    omega = np.asarray(omega, dtype=float)
    cascade, weights, scale = _derivatives(model, root)
    if sampled:
        held = discretise(cascade, model.sampling_period_s * scale, model.hold)
        z = np.exp(1j * omega * model.sampling_period_s)
        drive = held.now + held.slope * (z[:, None] - 1)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(held.now)) - held.A, drive[..., None])[..., 0]
        powers = z[:, None] ** -(model.delay_samples + np.arange(model.moving_average))
        states = states * powers.mean(axis=1)[:, None]
        whole = model.sampled_response(omega)
    else:
        s = 1j * omega / scale
        states = np.linalg.solve(s[:, None, None] * np.eye(len(cascade.b)) - cascade.A, cascade.b[:, None])[..., 0]
        states = states * np.exp(-1j * omega * model.delay_samples * model.sampling_period_s)[:, None]
        whole = model.response(omega)
    return _relative(np.einsum("fk,oikr->foir", states, weights), whole)


def _relative(moves: ComplexArray, whole: ComplexArray) -> ResponseDeviation:
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = moves / whole[..., None]
    return ResponseDeviation(np.linalg.norm(relative.real, axis=-1), np.linalg.norm(relative.imag, axis=-1))


def output_deviation(
    model: TransferMatrix, root: FloatArray, inputs: FloatArray, start: Literal["rest", "periodic"] = "rest"
) -> FloatArray:
    """Propagates the coefficients' covariance to a simulation.

    Args:
        model: The transfer functions.
        root (n_param, n_root): Root of the covariance of `[numerators, denominator]` without the latter's first.
        inputs (n_sample, n_in): Commands.
        start: From zero state, or in the steady state of a period.

    Returns:
        Standard deviation (n_sample, n_out) of each simulated output.
    """
    cascade, weights, scale = _derivatives(model, root)
    period = model.sampling_period_s * scale
    commands = delayed(inputs, model.delay_samples, model.moving_average, start)
    states = propagate(discretise(cascade, period, model.hold), period, commands, start)
    moves = np.einsum("ikt,oikr->tor", states, weights, optimize=True)
    return np.asarray(np.linalg.norm(moves, axis=-1))


def _derivatives(model: TransferMatrix, root: FloatArray) -> tuple[Cascade, FloatArray, float]:
    """Returns what a covariance root's columns move outputs by.

    Returns:
        The cascade of the poles, each twice, the weights (n_out, n_in, n_state, n_root) of its states in those moves,
        and the reference frequency [rad/s].
    """
    single, _, scale = model.cascade()
    n_pole, (n_out, n_in, n_weight) = len(single.b), model.numerator.shape
    cascade = build_cascade(single.stages, 2)
    if root.shape[1] > root.shape[0]:
        root = np.linalg.qr(root.T)[1].T
    above = scale ** (np.arange(n_weight - 1, -1.0, -1.0) - n_pole)
    below = scale ** -np.arange(n_pole + 1.0)
    denominator = model.denominator * below
    pole_moves = root[-n_pole:] * below[1:, None]
    weights = np.zeros((n_out, n_in, 2 * n_pole, root.shape[1]))
    zero_moves = root[:-n_pole].reshape(n_out, n_in, n_weight, -1) * above[:, None]
    for output, input_ in np.ndindex(n_out, n_in):
        numerator = model.numerator[output, input_] * above
        polynomials = np.zeros((root.shape[1], 2 * n_pole))
        for row, up, down in zip(polynomials, zero_moves[output, input_].T, pole_moves.T, strict=True):
            for product in (np.convolve(up, denominator), -np.convolve(down, numerator)):
                row[len(row) - len(product) :] += product
        weights[output, input_] = cascade.expand(polynomials).T
    return cascade, weights, scale
