"""Transfer functions with common poles, and what they answer exactly to held commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import expm

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.hold import Cascade, Hold, Start, build_cascade, discretise, find_stages, propagate


@dataclass(frozen=True)
class TransferMatrix:
    """Strictly proper continuous transfer functions with common poles, a delay and a moving average of the inputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    numerator: FloatArray  # (n_out, n_in, n_zero + 1): Numerators, highest power of s [rad/s] first
    denominator: FloatArray  # (n_pole + 1,): Denominator, highest power first, which has coefficient 1
    delay_samples: int  # transport delay in samples
    moving_average: int  # samples over which commands are averaged
    sampling_period_s: float
    hold: Hold  # what commands do between samples

    @property
    def poles(self) -> ComplexArray:
        """Poles (n_pole,) [rad/s]."""
        return np.asarray(np.roots(self.denominator), dtype=complex)

    def zeros(self, output: int = 0, input: int = 0) -> ComplexArray:  # noqa: A002
        """Returns the zeros (n_zero,) [rad/s] of one channel."""
        return np.asarray(np.roots(self.numerator[output, input]), dtype=complex)

    @property
    def static_gain(self) -> FloatArray:
        """Static gain (n_out, n_in); infinite with an integrator."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.numerator[..., -1] / self.denominator[-1])

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie in the left half plane."""
        return bool((self.poles.real < 0).all())

    def response(self, omega: FloatArray) -> ComplexArray:
        """Computes the response (n_freq, n_out, n_in) with delay, without hold and average.

        Args:
            omega (n_freq,): Frequencies [rad/s].
        """
        s = 1j * np.asarray(omega)
        above = np.moveaxis(_values(self.numerator, s), -1, 0)
        delay = np.exp(-s * self.delay_samples * self.sampling_period_s)
        return np.asarray(above * (delay / _values(self.denominator, s))[:, None, None])

    def sampled_response(self, omega: FloatArray) -> ComplexArray:
        """Computes the response (n_freq, n_out, n_in) from samples to samples: with hold, delay and average.

        Args:
            omega (n_freq,): Frequencies [rad/s].
        """
        cascade, weights, scale = self.cascade()
        held = discretise(cascade, self.sampling_period_s * scale, self.hold)
        z = np.exp(1j * np.asarray(omega) * self.sampling_period_s)
        drive = held.now + held.slope * (z[:, None] - 1)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(held.now)) - held.A, drive[..., None])[..., 0]
        above = np.einsum("oik,fk->foi", weights, states)
        powers = z[:, None] ** -(self.delay_samples + np.arange(self.moving_average))
        return np.asarray(above * powers.mean(axis=1)[:, None, None])

    def step(self, time: FloatArray) -> FloatArray:
        """Computes the response (n_time, n_out, n_in) to a unit step at zero, with delay, without hold and average.

        Args:
            time (n_time,): Times [s].
        """
        cascade, weights, scale = self.cascade()
        size = len(cascade.b)
        augmented = np.zeros((size + 1, size + 1))
        augmented[:size, :size], augmented[:size, size] = cascade.A, cascade.b
        since = np.maximum(np.asarray(time) - self.delay_samples * self.sampling_period_s, 0.0) * scale
        states = expm(since[:, None, None] * augmented)[:, :size, size]
        return np.asarray(np.einsum("oik,tk->toi", weights, states))

    def simulate(self, inputs: FloatArray, start: Literal["rest", "periodic"] = "rest") -> FloatArray:
        """Simulates the outputs (n_sample, n_out) to commands (n_sample, n_in).

        Args:
            inputs (n_sample, n_in): Commands, zero before the first sample.
            start: From zero state, or in the steady state of a period.
        """
        cascade, weights, scale = self.cascade()
        period = self.sampling_period_s * scale
        commands = delayed(inputs, self.delay_samples, self.moving_average, start)
        states = propagate(discretise(cascade, period, self.hold), period, commands, start)
        return np.asarray(np.einsum("oik,ikt->to", weights, states))

    def cascade(self) -> tuple[Cascade, FloatArray, float]:
        """Returns the poles' cascade, its states' weights (n_out, n_in, n_pole) and its reference frequency [rad/s]."""
        scale = reference_frequency(self.denominator)
        cascade = build_cascade(find_stages(scaled(self.denominator, scale)))
        n_pole, n_zero = len(self.denominator) - 1, self.numerator.shape[-1] - 1
        powers = scale ** (np.arange(n_zero, -1.0, -1.0) - n_pole)
        return cascade, cascade.expand(self.numerator * powers), scale


def scaled(denominator: FloatArray, scale: float) -> FloatArray:
    """Returns a denominator (n_pole + 1,) in `s / scale`, with coefficient 1 first."""
    return np.asarray(denominator * scale ** -np.arange(len(denominator), dtype=float))


def reference_frequency(denominator: FloatArray) -> float:
    """Returns a frequency [rad/s] amid the poles of a denominator (n_pole + 1,)."""
    sizes = np.abs(np.roots(denominator))
    moving = sizes[sizes > 1e-9 * sizes.max(initial=0.0)]
    return float(np.exp(np.log(moving).mean())) if len(moving) else 1.0


def delayed(inputs: FloatArray, delay_samples: int, moving_average: int, start: Start) -> FloatArray:
    """Averages and delays commands.

    Args:
        inputs (n_sample, n_in): Commands.
        delay_samples: Delay in samples.
        moving_average: Samples averaged.
        start: What came before: nothing (`rest`), the same period (`periodic`) or the first value (`free`).

    Returns:
        What the transfer function receives (n_in, n_sample).
    """
    signals = np.ascontiguousarray(np.asarray(inputs, dtype=float).T)
    n_sample = signals.shape[1]
    reach = delay_samples + moving_average - 1
    if reach == 0:
        return signals
    before = {
        "rest": np.zeros((len(signals), reach)),
        "periodic": np.take(signals, np.arange(-reach, 0) % n_sample, axis=1),
        "free": np.repeat(signals[:, :1], reach, axis=1),
    }[start]
    longer = np.concatenate([before, signals], axis=1)
    last = moving_average - 1
    return np.asarray(sum(longer[:, lag : lag + n_sample] for lag in range(last + 1)) / moving_average)


def _values(polynomials: FloatArray, s: ComplexArray) -> ComplexArray:
    """Values (..., n_freq) of polynomials (..., n_power), highest power first."""
    values = np.zeros((*polynomials.shape[:-1], len(s)), dtype=complex)
    for power in range(polynomials.shape[-1]):
        values = values * s + polynomials[..., power, None]
    return values
