"""A local rational model of a response around one extremum, and its pole or zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray

Kind = Literal["resonance", "antiresonance"]

_ITERATIONS = 8
_RELATIVE_FLOOR = 0.02
_MIN_LINES = 5


@dataclass(frozen=True)
class LocalMode:
    """A pole or zero of a local model.

    Attributes:
        frequency_hz: Undamped frequency [Hz].
        std_hz: Its standard deviation [Hz].
        root: The pole or zero in the upper half plane [rad/s].
    """

    frequency_hz: float
    std_hz: float
    root: complex


def local_mode(
    frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray, extremum: int, kind: Kind, lines: int = 7
) -> LocalMode | None:
    """Fits `(b0 + b1 s + b2 s^2)/(s^2 + a1 s + a0)` on the lines around an extremum of the magnitude.

    A drive with two masses is of this form; of a robot's other modes it takes constant and slope.

    Args:
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq,): Response in continuous time, hold and delay removed.
        variance (n_freq,): Its variance.
        extremum: Index of the line with the extremum.
        kind: Whether the pole or the zero is wanted.
        lines: Lines of the local model, fewer at the edges but at least 5.

    Returns:
        The pole or zero with its deviation by the delta method over the lines' variances, or None when it
        does not lie between the extremum's neighbours.
    """
    half = lines // 2
    window = slice(max(0, extremum - half), min(frequency_hz.size, extremum + half + 1))
    if frequency_hz[window].size < _MIN_LINES:
        return None
    omega = 2 * np.pi * frequency_hz[window]
    deviation = np.sqrt(0.5 * variance[window])
    moves = np.concatenate([np.diag(deviation), 1j * np.diag(deviation)])
    data = response[window] + np.concatenate([np.zeros((1, omega.size)), moves, -moves])
    roots, valid = _roots(omega, data, variance[window], 2 * np.pi * float(frequency_hz[extremum]), kind)
    found = np.abs(roots) / (2 * np.pi)
    low, high = frequency_hz[max(0, extremum - 1)], frequency_hz[min(frequency_hz.size - 1, extremum + 1)]
    if not valid[0] or not low <= found[0] <= high:
        return None
    forward, backward = np.split(found[1:], 2)
    known = np.logical_and(*np.split(valid[1:], 2))
    std = np.sqrt(np.sum((0.5 * (forward - backward)[known]) ** 2) * known.size / max(int(known.sum()), 1))
    return LocalMode(float(found[0]), float(std), complex(roots[0]))


def parabola_mode(frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray, extremum: int) -> LocalMode:
    """Fits a parabola of the log magnitude over log frequency through an extremum and its two neighbours.

    Where several modes share the window of the local model, this is all that the lines show.

    Args:
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq,): Response in continuous time, hold and delay removed.
        variance (n_freq,): Its variance.
        extremum: Index of the line with the extremum, not at an edge.

    Returns:
        The extremum, without damping.
    """
    three = slice(extremum - 1, extremum + 2)
    inverse = np.linalg.inv(np.vander(np.log(frequency_hz[three] / frequency_hz[extremum]), 3))
    level = np.log(np.abs(response[three]))
    noise = np.sqrt(0.5 * variance[three]) / np.abs(response[three])
    vertex = _vertex(inverse @ level)
    moved = np.array([_vertex(inverse @ (level + step)) for step in np.diag(noise)])
    found = float(frequency_hz[extremum] * np.exp(vertex))
    std = float(frequency_hz[extremum] * np.sqrt(np.sum((moved - vertex) ** 2)))
    return LocalMode(found, std, 2j * np.pi * found)


def _vertex(polynomial: FloatArray) -> float:
    return float(-0.5 * polynomial[1] / polynomial[0])


def _roots(
    omega: FloatArray, data: ComplexArray, variance: FloatArray, centre: float, kind: Kind
) -> tuple[ComplexArray, BoolArray]:
    """Roots (n_case,) of the numerator or denominator of each case (n_case, n_line), and which are oscillating.

    The polynomials are written in `x = (w^2 - w0^2)/scale`, which keeps narrow windows well conditioned; the
    linearised least squares is reweighted with the last denominator.
    """
    scale = np.abs(omega**2 - centre**2).max()
    shift = (omega**2 - centre**2) / scale
    rate = 1j * omega / centre
    power = np.abs(data) ** 2
    base = 1 / np.sqrt(variance + _RELATIVE_FLOOR**2 * power)
    one = np.ones_like(shift)
    numerator = np.broadcast_to(np.stack([one, shift, rate], axis=-1), (*data.shape, 3))
    denominator = np.ones_like(data)
    theta: FloatArray = np.zeros((data.shape[0], 5))
    for _ in range(_ITERATIONS):
        weight = (base / np.abs(denominator))[..., None]
        columns = np.stack([one, rate], axis=-1) * data[..., None]
        rows = weight * np.concatenate([numerator, -columns], axis=-1)
        target = weight[..., 0] * (-shift * data)
        theta = _least_squares(rows, target)
        denominator = -shift + theta[:, 3:4] + theta[:, 4:5] * rate
    if kind == "resonance":
        free, slope = theta[:, 3] * scale, theta[:, 4] * scale / centre
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            free, slope = -theta[:, 0] / theta[:, 1] * scale, -theta[:, 2] / theta[:, 1] * scale / centre
    squared = centre**2 + free
    valid = np.isfinite(squared) & np.isfinite(slope) & (squared > 0.25 * slope**2)
    imaginary = np.sqrt(np.where(valid, squared - 0.25 * slope**2, 0.0))
    return np.where(valid, -0.5 * slope, 0.0) + 1j * imaginary, valid


def _least_squares(rows: ComplexArray, target: ComplexArray) -> FloatArray:
    """Real solution (n_case, n_unknown) of complex equations (n_case, n_line, n_unknown)."""
    real = np.concatenate([rows.real, rows.imag], axis=1)
    right = np.concatenate([target.real, target.imag], axis=1)
    transposed = np.swapaxes(real, 1, 2)
    normal = transposed @ real
    ridge = 1e-13 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(normal.shape[-1])
    return np.asarray(np.linalg.solve(normal + ridge, transposed @ right[..., None])[..., 0])
