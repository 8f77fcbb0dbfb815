"""Signals and spectra of a log, thinned out for drawing."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.fft import rfft
from scipy.signal.windows import hann

from robid.arrays import FloatArray, IntArray
from robid.logs.period import line_power

_POINTS = 1200


@dataclass(frozen=True)
class Spectra:
    """Amplitudes of a signal.

    Attributes:
        frequency_hz (n_freq,): Frequencies [Hz].
        amplitude (n_freq,): Amplitudes there.
        noise (n_freq,): What the periods scatter; empty where nothing repeats.
    """

    frequency_hz: FloatArray
    amplitude: FloatArray
    noise: FloatArray


def thin_out(values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Returns samples with their places: all of a short signal, lowest and highest of each part of a long one."""
    if len(values) <= 2 * _POINTS:
        return np.arange(len(values)), values
    width = len(values) // _POINTS
    parts = values[: width * _POINTS].reshape(_POINTS, width)
    filled = np.where(np.isfinite(parts), parts, 0.0)
    inside = np.sort(np.stack([filled.argmin(axis=1), filled.argmax(axis=1)], axis=1), axis=1)
    places = (width * np.arange(_POINTS)[:, None] + inside).ravel()
    return places, values[places]


def spectra_of_periods(blocks: FloatArray, step_s: float) -> Spectra:
    """Returns amplitudes of the mean of some periods (n_period, n_sample), and of what they scatter."""
    mean, noise = line_power(blocks)
    count = blocks.shape[1]
    frequency = np.arange(len(mean)) / (count * step_s)
    amplitude, scatter = 2 * np.sqrt(mean) / count, 2 * np.sqrt(noise) / count
    kept = _highest(amplitude[1:]) + 1
    return Spectra(frequency[kept], amplitude[kept], scatter[kept])


def spectra_of_all(values: FloatArray, step_s: float) -> Spectra:
    """Returns amplitudes of a signal (n_sample,) that does not repeat."""
    window = hann(len(values))
    amplitude = 2 * np.abs(rfft((values - values.mean()) * window)) / window.sum()
    frequency = np.arange(len(amplitude)) / (len(values) * step_s)
    kept = _highest(amplitude[1:]) + 1
    return Spectra(frequency[kept], amplitude[kept], np.zeros(0))


def _highest(amplitude: FloatArray) -> IntArray:
    """Places to draw: all of few, the highest of each of equal parts of a logarithmic axis of many."""
    if len(amplitude) <= 2 * _POINTS:
        return np.arange(len(amplitude))
    edges = np.unique(np.geomspace(1, len(amplitude), _POINTS + 1).astype(int))
    return np.array([start - 1 + int(np.argmax(amplitude[start - 1 : stop - 1])) for start, stop in pairwise(edges)])
