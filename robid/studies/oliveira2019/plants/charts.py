"""Figures of the paper's kinds: chirps, step responses, validation, responses over frequency, poles and zeros."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.report.section import Curve, Figure

_MOST_POINTS = 1200
_HEIGHT = 280


def curve(name: str, x: FloatArray, y: FloatArray, *, points: bool = False) -> Curve:
    """Returns one curve, thinned evenly where it has many points."""
    every = max(1, int(np.ceil(len(x) / _MOST_POINTS)))
    return Curve(name, tuple(x[::every].tolist()), tuple(y[::every].tolist()), points=points)


def over_time(title: str, unit: str, time_s: FloatArray, signals: Sequence[tuple[str, FloatArray]]) -> Figure:
    """Signals over time."""
    curves = tuple(curve(name, time_s, values) for name, values in signals)
    return Figure(title, "Time [s]", f"Position [{unit}]", curves, log_x=False, log_y=False, height=_HEIGHT)


def stretch(
    title: str, unit: str, time_s: FloatArray, window_s: tuple[float, float], signals: Sequence[tuple[str, FloatArray]]
) -> Figure:
    """Signals over a stretch of time."""
    inside = (time_s >= window_s[0]) & (time_s <= window_s[1])
    return over_time(title, unit, time_s[inside], [(name, values[inside]) for name, values in signals])


def spectra(title: str, unit: str, period_s: float, signals: Sequence[tuple[str, FloatArray]], floor: float) -> Figure:
    """Amplitudes of the components of signals, and the resolution."""
    curves: list[Curve] = []
    frequency: FloatArray = np.zeros(0)
    for name, values in signals:
        frequency = np.fft.rfftfreq(len(values), period_s)[1:]
        amplitude = 2 / len(values) * np.abs(np.fft.rfft(values))[1:]
        # On a logarithmic axis the many fast components are thinned, the few slow ones are not.
        kept = np.unique(np.geomspace(1, len(frequency), 700).astype(int)) - 1
        curves.append(Curve(name, tuple(frequency[kept].tolist()), tuple(amplitude[kept].tolist())))
    ends = frequency[[0, -1]]
    curves.append(curve("resolution", ends, np.full(2, floor)))
    return Figure(title, "Frequency [Hz]", f"Amplitude [{unit}]", tuple(curves), height=_HEIGHT)


def magnitude(title: str, responses: Sequence[tuple[str, FloatArray, ComplexArray]]) -> Figure:
    """Magnitudes of responses, each with its frequencies."""
    curves = tuple(curve(name, frequency, _decibels(values)) for name, frequency, values in responses)
    return Figure(title, "Frequency [Hz]", "Magnitude [dB]", curves, log_y=False, height=_HEIGHT)


def phase(title: str, responses: Sequence[tuple[str, FloatArray, ComplexArray]]) -> Figure:
    """Phases of responses, each with its frequencies."""
    curves = tuple(
        curve(name, frequency, np.degrees(np.unwrap(np.angle(values)))) for name, frequency, values in responses
    )
    return Figure(title, "Frequency [Hz]", "Phase [degrees]", curves, log_y=False, height=_HEIGHT)


def roots(title: str, sets: Sequence[tuple[str, ComplexArray]], reach_rad_s: float) -> Figure:
    """Poles and zeros in the complex plane, within a distance of the origin."""
    curves = []
    for name, values in sets:
        near = values[np.abs(values) <= reach_rad_s]
        curves.append(Curve(name, tuple(near.real.tolist()), tuple(near.imag.tolist()), points=True))
    return Figure(title, "Real part [rad/s]", "Imaginary part [rad/s]", tuple(curves), log_x=False, log_y=False)


def _decibels(values: ComplexArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(np.abs(values), 1e-12)))
