"""How far a measured response is off: by its coherence, or by its scatter about its neighbours."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray

_REACH = 3  # Lines on each side
_DEGREE = 2


def coherence_variance(
    response: ComplexArray, coherence: FloatArray, averages: float, input_power: FloatArray | None = None
) -> FloatArray:
    """Variance E|dG|^2 (n_freq, n_out, n_in) of responses by H1 with noise on the outputs.

    Args:
        response (n_freq, n_out, n_in): The response.
        coherence (n_freq, n_out, n_in): Coherence of each element, its input alone excited; or (n_freq, n_out, 1):
            multiple coherence of inputs excited together and independently.
        averages: Effective number n of averages.
        input_power (n_in,): Power of each input, for multiple coherence.

    Source:
        Bendat and Piersol, "Random Data", for large n; exact in the mean for n averages of a normal signal:
        `|G|^2 (1 - g2) / (g2 (n - 1))`. With several inputs `S_e = (1 - g2) S_yy`, `g2 S_yy = sum_i |G_i|^2 S_i`.
    """
    told = np.clip(coherence, 1e-12, 1.0)
    ratio = (1 - told) / told
    n_in = response.shape[2]
    if coherence.shape[2] == n_in:
        return np.asarray(np.abs(response) ** 2 * ratio / (averages - 1))
    power = np.ones(n_in) if input_power is None else input_power
    explained = (np.abs(response) ** 2 * power).sum(axis=2, keepdims=True)
    return np.asarray(explained * ratio / (power * (averages - n_in)))


def neighbour_variance(frequency_hz: FloatArray, response: ComplexArray) -> tuple[FloatArray, float]:
    """Variance (n_freq, n_out, n_in) by what lines scatter about a parabola through their neighbours.

    Where the response bends faster, as at a sharp resonance between few lines, it comes out too large.

    Args:
        frequency_hz (n_freq,): Lines.
        response (n_freq, n_out, n_in): Response.

    Returns:
        The variance, and the complex degrees of freedom behind it.
    """
    size = frequency_hz.size
    count = min(2 * _REACH + 1, size)
    degree = min(_DEGREE, count - 2)
    first = np.clip(np.arange(size) - _REACH, 0, size - count)
    windows = first[:, None] + np.arange(count)
    place = np.log(frequency_hz[windows])
    middle = place.mean(axis=1, keepdims=True)
    columns = ((place - middle) / np.ptp(place, axis=1)[:, None])[..., None] ** np.arange(degree + 1)
    base = np.linalg.qr(columns)[0]
    inside = response[windows].reshape(size, count, -1)
    left = inside - base @ (base.swapaxes(-1, -2) @ inside)
    freedom = count - degree - 1
    variance = (np.abs(left) ** 2).sum(axis=1) / freedom
    return variance.reshape(response.shape), float(freedom)
