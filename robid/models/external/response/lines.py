"""A measured response as the fit sees it: elements in a row, over their deviations, on a scaled imaginary axis.

In discrete time `s = (z - 1) / (z + 1)` takes the place of s: on the unit circle it is `j tan(w T / 2)`, so that one
code serves both times, with integrators at zero and stable poles on the left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.options import Time

_NYQUIST = 1 - 1e-9  # of the Nyquist frequency, from where on a line has no place on the axis


@dataclass(frozen=True)
class Lines:
    """A response over its deviations; unknown elements have weight zero."""

    x: FloatArray  # (n_freq,) s / j over the reference
    y: ComplexArray  # (n_element, n_freq) response over the deviation of a real part
    weights: FloatArray  # (n_element, n_freq) one over that deviation
    turn: FloatArray  # (n_freq,) phase per unit of delay [rad]
    reference: float  # that x and poles are over: rad/s in continuous time, 1 in discrete time
    delay_unit_s: float  # unit of delays [s]: the sampling period in discrete time
    time: Time

    @property
    def n_row(self) -> int:
        """Number of real data."""
        return 2 * int(np.count_nonzero(self.weights))

    @property
    def n_element(self) -> int:
        """Number of elements."""
        return len(self.weights)

    def fixed_factor(self, n_missing: int) -> ComplexArray:
        """Computes the factor (n_freq,) of numerators that lack some powers: zeros at z = 0 in discrete time, or 1."""
        # b_0 + .. + b_m z^-m over 1 + .. + a_n z^-n is (1 + s)^(n - m) times a polynomial of degree m over one of n.
        factor = (1 + 1j * self.x * self.reference) ** n_missing if self.time == "discrete" else np.ones(len(self.x))
        return np.asarray(factor, dtype=complex)


def make_lines(data: MeasuredResponse, time: Time) -> Lines:
    """Scales a measured response.

    A hold in the response is divided out for a continuous model, `(1 - exp(-s T)) / (s T)`: what the samples' images
    add is left in, of the order of the response beyond the sampling rate less that frequency over the response.

    Raises:
        ValueError: If discrete time lacks a sampling period, or no line is left.
    """
    period = data.sampling_period_s
    if time == "discrete" and period is None:
        message = "Argument `sampling_period_s` must be given for a model in discrete time."
        raise ValueError(message)
    step, order = float(period or 1), np.argsort(data.frequency_hz)
    omega = 2 * np.pi * np.asarray(data.frequency_hz, dtype=float)[order]
    variance = data.variance.reshape(len(omega), -1)[order].T
    response = np.where(np.isfinite(variance), data.response.reshape(len(omega), -1)[order].T, 0.0)
    weights = np.sqrt(2 / variance)
    kept = (weights > 0).any(axis=0)
    if time == "discrete":
        kept &= omega * step < np.pi * _NYQUIST
    if not kept.any():
        message = "Argument `frequency_hz` must have lines below the Nyquist frequency."
        raise ValueError(message)
    omega, weights, response = omega[kept], weights[:, kept], response[:, kept]
    if time == "continuous" and data.hold == "zoh" and period is not None:
        half = omega * period / 2
        hold = np.exp(-1j * half) * np.sinc(half / np.pi)
        response, weights = response / hold, weights * np.abs(hold)
    if time == "discrete":
        per_sample = omega * step
        return Lines(np.tan(per_sample / 2), response * weights, weights, per_sample, 1.0, step, time)
    middle = float(np.sqrt(omega[0] * omega[-1]))
    return Lines(omega / middle, response * weights, weights, omega / omega[-1], middle, 1 / omega[-1], time)
