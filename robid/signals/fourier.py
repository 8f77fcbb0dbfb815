"""Fourier series with boundary conditions."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, IntArray

_ROUNDS = 200


def resting_series(coefficients: ComplexArray, lines: IntArray, orders: tuple[int, ...]) -> ComplexArray:
    """Changes a series the least so that derivatives of it vanish at both ends of the period.

    They vanish for the series and for its copies with all phases shifted alike, so that an orthogonal block of
    experiments keeps the condition. Magnitudes stay nearly equal where the conditions allow it.

    Args:
        coefficients (..., n_lines): Complex amplitudes.
        lines (n_lines,): DFT lines.
        orders: Derivatives that vanish: 0 the series itself, 1 its slope, -1 its integral of zero mean.

    Raises:
        ValueError: If there are not more lines than conditions.
    """
    if len(lines) <= len(orders):
        message = f"{len(orders)} conditions need more than {len(lines)} lines"
        raise ValueError(message)
    relative = lines / lines.max()
    conditions = np.array([(1j * relative) ** order for order in orders])
    conditions /= np.linalg.norm(conditions, axis=1, keepdims=True)
    keep = np.eye(len(lines)) - np.linalg.pinv(conditions) @ conditions
    size = np.abs(coefficients)
    for _ in range(_ROUNDS):
        coefficients = coefficients @ keep.T
        coefficients = size * np.exp(1j * np.angle(coefficients))
    return np.asarray(coefficients @ keep.T)
