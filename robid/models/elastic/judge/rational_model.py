"""A rational local model of a response around one extremum, on as many lines as their noise asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.judge.local_model import Kind, LocalMode, located_mode, moved_data

_NARROW = 3
"""Lines on either side where they tell enough."""

_RELATIVE_FLOOR = 0.02
_MISFIT_LIMIT, _WIDE_MISFIT_LIMIT = 5.0, 1.5
_LINEAR_STEPS, _GAUSS_NEWTON_STEPS = 3, 2


def rational_mode(
    frequency_hz: FloatArray,
    response: ComplexArray,
    variance: FloatArray,
    extremum: int,
    kind: Kind,
    half_width_lines: int = _NARROW,
) -> LocalMode | None:
    """Fits `(b0 + b1 s + b2 s^2)/(s^2 + a1 s + a0)` on the lines around an extremum of the magnitude.

    A drive with two masses is of this form; of a robot's other modes it takes constant and slope. More than seven
    lines serve only where their noise is above the error that is allowed of the form: there a flat peak has its
    highest line anywhere, and its root lies somewhere in the window.

    Args:
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq,): Response in continuous time, hold and delay removed.
        variance (n_freq,): Its variance.
        extremum: Index of the line with the extremum.
        kind: Whether the pole or the zero is wanted.
        half_width_lines: Lines on either side.

    Returns:
        The pole or zero, or None when the data are not of this form (misfit above 10 % and five deviations; of
        more lines above 3 % and one and a half) or it does not lie between the extremum's neighbours, or grows in time.
    """
    half, wide = half_width_lines, half_width_lines > _NARROW
    window = slice(max(0, extremum - half), min(frequency_hz.size, extremum + half + 1))
    hz = frequency_hz[window]
    if hz.size < 2 * half - 1:
        return None
    power = np.abs(response[window]) ** 2
    if wide and np.median(variance[window]) <= _RELATIVE_FLOOR**2 * np.median(power):
        return None
    omega, centre = 2 * np.pi * hz, 2 * np.pi * float(frequency_hz[extremum])
    weight = 1 / np.sqrt(variance[window] + _RELATIVE_FLOOR**2 * power)
    data = moved_data(response[window], variance[window])
    roots, magnitude, misfit = _rational_roots(omega, data, weight, centre, kind)
    if misfit > (_WIDE_MISFIT_LIMIT if wide else _MISFIT_LIMIT):
        return None
    near = max(0, extremum - 1), min(frequency_hz.size - 1, extremum + 1)
    low, high = (hz[1], hz[-2]) if wide else frequency_hz[list(near)]
    return located_mode(roots, magnitude, (float(low), float(high)), kind)


def _rational_roots(
    omega: FloatArray, data: ComplexArray, weight: FloatArray, centre: float, kind: Kind
) -> tuple[ComplexArray, Callable[[FloatArray], FloatArray], float]:
    """Roots (n_case,) of the numerator or denominator of each case (n_case, n_line), magnitude, the first one's misfit.

    The polynomials are written in `x = (w^2 - w0^2)/scale`, which keeps narrow windows well conditioned. A root that
    does not oscillate is NaN.
    """
    scale = np.abs(omega**2 - centre**2).max()
    shift = (omega**2 - centre**2) / scale
    powers = np.stack([np.ones_like(shift) + 0j, shift, 1j * omega / centre], axis=-1)
    theta = _without_bias(_linearised(data, weight, powers), data, weight, powers)
    misfit = weight * np.abs(_curve(theta[:1], powers)[0] - data[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        free, slope = theta[:, 3:].T if kind == "resonance" else -theta[:, [0, 2]].T / theta[:, 1]
        squared, slope = centre**2 + free * scale, slope * scale / centre
        roots = -0.5 * slope + 1j * np.sqrt(squared - 0.25 * slope**2)

    def magnitude(at_hz: FloatArray) -> FloatArray:
        at = 2 * np.pi * at_hz
        x, s = (at**2 - centre**2) / scale, 1j * at / centre
        top, bottom = theta[:, :3, None], theta[:, 3:, None]
        return np.asarray(
            np.abs(top[:, 0] + top[:, 1] * x + top[:, 2] * s) / np.abs(bottom[:, 0] + bottom[:, 1] * s - x)
        )

    return np.asarray(roots), magnitude, float(np.sqrt(np.mean(misfit**2)))


def _linearised(data: ComplexArray, weight: FloatArray, powers: ComplexArray) -> FloatArray:
    """Coefficients (n_case, 5) by linearised least squares, reweighted with the last denominator.

    Source:
        Sanathanan and Koerner (1963).
    """
    numerator = np.broadcast_to(powers, (*data.shape, 3))
    denominator = np.ones_like(data)
    theta: FloatArray = np.zeros((data.shape[0], 5))
    for _ in range(_LINEAR_STEPS):
        here = (weight / np.abs(denominator))[..., None]
        rows = here * np.concatenate([numerator, -powers[:, [0, 2]] * data[..., None]], axis=-1)
        theta = _least_squares(rows, here[..., 0] * (-powers[:, 1] * data))
        denominator = _denominator(theta, powers)
    return theta


def _without_bias(theta: FloatArray, data: ComplexArray, weight: FloatArray, powers: ComplexArray) -> FloatArray:
    """Coefficients by Gauss-Newton steps on the misfit itself: noise biases the linearised ones towards no extremum."""
    begun = theta
    for _ in range(_GAUSS_NEWTON_STEPS):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = 1 / _denominator(theta, powers)[..., None]
            curve = _curve(theta, powers)
            rows = (
                weight[:, None]
                * inverse
                * np.concatenate(
                    [np.broadcast_to(powers, (*data.shape, 3)), -powers[:, [0, 2]] * curve[..., None]], axis=-1
                )
            )
            theta = theta + _least_squares(rows, weight * (data - curve))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        before, after = (np.sum(np.abs(weight * (_curve(at, powers) - data)) ** 2, axis=1) for at in (begun, theta))
    return np.where((after < before)[:, None], theta, begun)


def _curve(theta: FloatArray, powers: ComplexArray) -> ComplexArray:
    return np.asarray((theta[:, :3] @ powers.T) / _denominator(theta, powers))


def _denominator(theta: FloatArray, powers: ComplexArray) -> ComplexArray:
    return np.asarray(theta[:, 3:] @ powers[:, [0, 2]].T - powers[:, 1])


def _least_squares(rows: ComplexArray, target: ComplexArray) -> FloatArray:
    """Real solution (n_case, n_unknown) of complex equations (n_case, n_line, n_unknown)."""
    real = np.concatenate([rows.real, rows.imag], axis=1)
    right = np.concatenate([target.real, target.imag], axis=1)
    transposed = np.swapaxes(real, 1, 2)
    normal = transposed @ real
    ridge = 1e-13 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(normal.shape[-1])
    return np.asarray(np.linalg.solve(normal + ridge, transposed @ right[..., None])[..., 0])
