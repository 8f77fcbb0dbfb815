"""Local models of extrema of a response, a rational one among them, and how the measured extrema scatter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy.stats import t

from robid.arrays import ComplexArray, FloatArray

Kind = Literal["resonance", "antiresonance"]

_MOST_NEGATIVE_DAMPING = -0.01  # noise may turn a small damping ratio negative, a passive robot does not
_HALF_WIDTHS, _LEAST_REACH, _PEAK_GRID = 4.0, 1e-6, 161


@dataclass(frozen=True)
class LocalMode:
    """A pole or zero of a local model."""

    frequency_hz: float  # Undamped frequency [Hz]
    std_hz: float  # Its standard deviation by the delta method over the lines' variances [Hz]
    root: complex  # The pole or zero in the upper half plane [rad/s]
    peak_hz: float  # Where the local model's magnitude is largest, or smallest [Hz]
    peak_std_hz: float  # Its standard deviation, as that of the frequency [Hz]
    is_root: bool = True  # Whether there is a pole or zero at all; else the frequency is the peak's


Estimator: TypeAlias = Callable[[FloatArray, ComplexArray, FloatArray, int, Kind], LocalMode | None]
"""What finds the mode around a line: of frequencies (n_freq,) [Hz], a response (n_freq,) in continuous time, hold and
delay removed, its variance (n_freq,), the line's index, not at an edge, and whether a pole or a zero is wanted."""


def interpolated_mode(
    frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray, extremum: int, kind: Kind
) -> LocalMode | None:
    """Interpolates the response, or its inverse for a resonance, by a complex parabola through three lines.

    Makes no use of the form of a mechanical response, so that it also holds where friction distorts it.

    Arguments as of `Estimator`.

    Returns:
        The pole or zero, or None when it does not lie between the extremum's neighbours, or grows in time.
    """
    three = slice(extremum - 1, extremum + 2)
    data = moved_data(response[three], variance[three])
    values = 1 / data if kind == "resonance" else data
    x = frequency_hz[three] / frequency_hz[extremum] - 1
    second, first, constant = np.moveaxis(values @ np.linalg.inv(np.vander(x, 3)).T, -1, 0)
    root = np.sqrt(first**2 - 4 * second * constant)
    root = np.where(np.real(root * first.conj()) < 0, -root, root)
    nearest = -2 * constant / (first + root)  # the root next to the extremum, without cancellation
    roots = 2j * np.pi * frequency_hz[extremum] * (1 + nearest)

    def magnitude(at_hz: FloatArray) -> FloatArray:
        x = at_hz / frequency_hz[extremum] - 1
        value = np.abs((second[:, None] * x + first[:, None]) * x + constant[:, None])
        return np.asarray(1 / value if kind == "resonance" else value)

    ends_hz = float(frequency_hz[extremum - 1]), float(frequency_hz[extremum + 1])
    return located_mode(roots, magnitude, ends_hz, kind)


def moved_data(data: ComplexArray, variance: FloatArray) -> ComplexArray:
    """Data (n_line,) and their moves by one deviation of each line's real and imaginary part (1 + 4 n_line, n_line)."""
    deviation = np.diag(np.sqrt(0.5 * variance))
    moves = np.concatenate([deviation, 1j * deviation])
    return np.asarray(data + np.concatenate([np.zeros((1, data.size)), moves, -moves]))


def located_mode(
    roots: ComplexArray, magnitude: Callable[[FloatArray], FloatArray], ends_hz: tuple[float, float], kind: Kind
) -> LocalMode | None:
    """Judges the first root, finds the extremum of the magnitude beside it, and takes deviations from moved data.

    Args:
        roots (n_case,): Root of each case, the data's own first.
        magnitude: Magnitude (n_case, n) of each case's local model at frequencies (n_case, n) [Hz].
        ends_hz: Between which frequencies root and extremum lie [Hz].
        kind: Whether the magnitude's maximum or minimum is wanted.

    Returns:
        The pole or zero, or None when it does not lie there, or grows in time.
    """
    found = np.abs(roots) / (2 * np.pi)
    low, high = ends_hz
    if not low <= found[0] <= high or -roots[0].real < _MOST_NEGATIVE_DAMPING * np.abs(roots[0]):
        return None
    peaks = _peaks(roots, magnitude, ends_hz, kind)
    return LocalMode(float(found[0]), _deviation(found), complex(roots[0]), float(peaks[0]), _deviation(peaks))


def _deviation(found: FloatArray) -> float:
    """Standard deviation of the first value (n_case,) from the others, found on data moved forward and backward."""
    forward, backward = np.split(found[1:], 2)
    moved = 0.5 * (forward - backward)
    moved = moved[np.isfinite(moved)]
    return float(np.sqrt(np.sum(moved**2) * forward.size / max(moved.size, 1)))


def _peaks(
    roots: ComplexArray, magnitude: Callable[[FloatArray], FloatArray], ends_hz: tuple[float, float], kind: Kind
) -> FloatArray:
    """Extremum (n_case,) of each case's magnitude within some half widths of its root, by a parabola on a fine grid."""
    centre, half = np.abs(roots) / (2 * np.pi), np.abs(roots.real) / (2 * np.pi)
    reach = np.minimum(_HALF_WIDTHS * half + _LEAST_REACH * centre, ends_hz[1] - ends_hz[0])
    grid = np.clip(centre[:, None] + reach[:, None] * np.linspace(-1, 1, _PEAK_GRID), *ends_hz)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.log(magnitude(grid)) * (1 if kind == "resonance" else -1)
    level = np.where(np.isfinite(level), level, -np.inf)
    best = np.clip(level.argmax(axis=1), 1, _PEAK_GRID - 2)[:, None]
    left, here, right = (np.take_along_axis(level, best + step, axis=1)[:, 0] for step in (-1, 0, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        curved = left - 2 * here + right
        shift = np.where(curved < 0, 0.5 * (left - right) / curved, 0.0)
    step = np.take_along_axis(grid, best + 1, axis=1) - np.take_along_axis(grid, best, axis=1)
    peak = np.take_along_axis(grid, best, axis=1)[:, 0] + np.clip(shift, -1, 1) * step[:, 0]
    return np.where(np.isfinite(centre), peak, np.nan)


def parabola_mode(
    frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray, extremum: int, kind: Kind
) -> LocalMode | None:
    """Fits a parabola of the log magnitude over log frequency through an extremum and its two neighbours.

    Where several modes share the lines next to the extremum, this is all that they show.

    Arguments as of `Estimator`.

    Returns:
        The extremum, without damping, or None when no extremum of this kind lies between the neighbours.
    """
    three = slice(extremum - 1, extremum + 2)
    inverse = np.linalg.inv(np.vander(np.log(frequency_hz[three] / frequency_hz[extremum]), 3))
    level = np.log(np.abs(response[three]))
    noise = np.sqrt(0.5 * variance[three]) / np.abs(response[three])
    polynomial = inverse @ level
    vertex = _vertex(polynomial)
    low, high = np.log(frequency_hz[[extremum - 1, extremum + 1]] / frequency_hz[extremum])
    if polynomial[0] * (1 if kind == "resonance" else -1) >= 0 or not low <= vertex <= high:
        return None
    moved = np.array([_vertex(inverse @ (level + step)) for step in np.diag(noise)])
    found = float(frequency_hz[extremum] * np.exp(vertex))
    std = float(frequency_hz[extremum] * np.sqrt(np.sum((moved - vertex) ** 2)))
    return LocalMode(found, std, 2j * np.pi * found, found, std, is_root=False)


def _vertex(polynomial: FloatArray) -> float:
    return float(-0.5 * polynomial[1] / polynomial[0]) if polynomial[0] else float("inf")


_WINDOW = 21
_SECOND_DIFFERENCE = 6.0  # its variance over that of a line
LINE_SCATTER_FREEDOM = 14.0
"""Real degrees of freedom of what neighbouring lines scatter, whose second differences share lines."""

_TINY = 1e-300


def line_scatter(measured: ComplexArray, modelled: ComplexArray) -> FloatArray:
    """Relative variance of each line beyond what is smooth, from measured over modelled responses.

    One realization of a friction's distortion looks like noise over the lines that no period averages out. Second
    differences of the quotient leave it, and their median over neighbouring lines leaves a model's error at single
    resonances out.

    Args:
        measured (n_conf, n_freq, n_out, n_in): Responses.
        modelled (n_conf, n_freq, n_out, n_in): The fitted model's.

    Returns:
        (n_conf, n_freq, n_out, n_in); zero with less than three lines.
    """
    if measured.shape[1] < 3:
        return np.zeros(measured.shape)
    ratio = np.divide(measured, modelled, out=np.ones_like(measured), where=modelled != 0)
    bend = ratio[:, 2:] - 2 * ratio[:, 1:-1] + ratio[:, :-2]
    power = np.abs(bend) ** 2 / (_SECOND_DIFFERENCE * np.maximum(np.abs(ratio[:, 1:-1]) ** 2, _TINY))
    n_bend, half = power.shape[1], _WINDOW // 2
    begin = np.clip(np.arange(-1, n_bend + 1) - half, 0, max(0, n_bend - _WINDOW))
    # The median of an exponential distribution is ln 2 of its mean.
    return np.stack([np.median(power[:, at : at + _WINDOW], axis=1) / np.log(2) for at in begin.tolist()], axis=1)


def leaving_out(
    estimate: Estimator,
    frequency_hz: FloatArray,
    response: ComplexArray,
    variance: FloatArray,
    errors: ComplexArray,
    extremum: int,
    kind: Kind,
) -> FloatArray:
    """Finds an extremum again with each realization left out.

    Args:
        estimate: The local model that found it, whose arguments the others are.
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq,): Response.
        variance (n_freq,): Its variance, which weighs the lines.
        errors (n_real, n_freq): What each realization adds to the response.
        extremum: Index of the line with the extremum.
        kind: Whether a peak or a dip is wanted.

    Returns:
        Peak and undamped frequency (n_real, 2); a local model that no longer holds gives the line instead [Hz].
    """
    count, found = len(errors), []
    for error in errors:
        left = response - error * count / (count - 1)
        near = np.abs(left[extremum - 1 : extremum + 2])
        best = extremum - 1 + int(near.argmax() if kind == "resonance" else near.argmin())
        best = min(max(best, 1), frequency_hz.size - 2)
        mode: LocalMode | None = estimate(frequency_hz, left, variance, best, kind)
        found.append([frequency_hz[best]] * 2 if mode is None else [mode.peak_hz, mode.frequency_hz])
    return np.array(found)


def jackknife_variance(left_out: FloatArray) -> FloatArray:
    """Variance (...) of an estimate from what it is with each of n parts left out (n, ...).

    Source:
        Efron and Stein (1981), The jackknife estimate of variance.
    """
    count = len(left_out)
    return np.asarray((count - 1) * np.var(left_out, axis=0))


def half_width(own: tuple[float, float], scatter: Sequence[tuple[float, float]], confidence: float) -> float:
    """Half width of an interval that holds the largest of some variances.

    Args:
        own: Variance that the response's covariance gives, and its degrees of freedom.
        scatter: Variances seen in another way, each with its degrees of freedom.
        confidence: Level of the interval.

    Returns:
        Quantile of Student's distribution times the deviation; the degrees of freedom are those of the variances
        together, so that an own variance of many stands against a scatter of few.

    Source:
        Satterthwaite (1946).
    """
    every = [own, *scatter]
    total = sum(variance for variance, _ in every)
    spent = sum(variance**2 / freedom for variance, freedom in every)
    freedom = total**2 / spent if spent > 0 else np.inf
    return float(t.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(max(variance for variance, _ in every)))


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

    Arguments as of `Estimator`, and the number of lines on either side.

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
