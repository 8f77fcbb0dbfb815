"""Periodic Fourier series that begin and end at rest, and their derivatives in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class RestingSeries:
    """All series of zero mean whose value, slope and curvature vanish where the period begins.

    Attributes:
        period_s: Length of the period [s].
        shapes (2 n_harmonic, n_shape): Sine coefficients of the harmonics, then cosine coefficients, of orthonormal
            shapes that span these series.
    """

    period_s: float
    shapes: FloatArray

    @property
    def count(self) -> int:
        """Number of shapes."""
        return int(self.shapes.shape[1])

    @property
    def lines(self) -> IntArray:
        """Harmonics (n_harmonic,), from 1."""
        return np.arange(1, len(self.shapes) // 2 + 1)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Value, first and second derivative (3, n_time, n_shape) of each shape."""
        omega = 2 * np.pi * self.lines / self.period_s
        angle = np.asarray(time_s)[:, None] * omega
        sine, cosine = np.sin(angle), np.cos(angle)
        waves = [
            np.hstack([sine, cosine]),
            np.hstack([omega * cosine, -omega * sine]),
            np.hstack([-(omega**2) * sine, -(omega**2) * cosine]),
        ]
        return np.asarray(np.array(waves) @ self.shapes)

    def grid(self, count: int) -> FloatArray:
        """The same at equidistant times of one period (3, count, n_shape)."""
        return self.at(np.arange(count) * (self.period_s / count))

    def amplitudes(self, coefficients: FloatArray) -> ComplexArray:
        """Complex amplitudes (n_harmonic, ...) of the harmonics from coefficients (n_shape, ...)."""
        sine, cosine = np.split(self.shapes @ coefficients, 2)
        return np.asarray(cosine - 1j * sine)


def resting_series(harmonics: int, period_s: float) -> RestingSeries:
    """Returns the series of harmonics 1 to `harmonics` that begin and end at rest.

    Raises:
        ValueError: If there are fewer than two harmonics, which leave nothing.
    """
    if harmonics < 2:
        message = f"a series at rest needs two harmonics or more, not {harmonics}"
        raise ValueError(message)
    order, none = np.arange(1, harmonics + 1), np.zeros(harmonics)
    conditions = np.array([[*none, *np.ones(harmonics)], [*order, *none], [*none, *order**2]])
    _, _, rows = np.linalg.svd(conditions / np.linalg.norm(conditions, axis=1, keepdims=True))
    return RestingSeries(period_s, rows[3:].T)
