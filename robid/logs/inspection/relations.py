"""How signals follow from each other: a speed is a derivative, a command comes first, a torque accelerates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft
from scipy.signal import detrend
from scipy.signal.windows import hann

from robid.arrays import ComplexArray, FloatArray, IntArray

_LOOKED = 1 << 17
_CARRIED = 0.9
"""Share of a signal's energy in the frequencies that are compared."""


@dataclass(frozen=True)
class Likeness:
    """How one signal follows from another.

    Attributes:
        correlation: Of the signal with the other's derivative, 0 to 1 whatever the sign.
        factor: What the derivative is multiplied by, its sign included.
        delay: By how many samples the signal comes later than the derivative.
    """

    correlation: float
    factor: float
    delay: float


@dataclass(frozen=True)
class Spectrum:
    """Spectrum of a signal, windowed.

    Attributes:
        values (n_freq,): The spectrum.
        omega (n_freq,): Angular frequencies [rad/s].
        strongest (n_strong,): Indices of the frequencies that carry most of its energy.
    """

    values: ComplexArray
    omega: FloatArray
    strongest: IntArray


def spectrum_of(values: FloatArray, step_s: float) -> Spectrum:
    """Returns the spectrum of a signal (n_sample,), its trend taken out."""
    used = values[(len(values) - _LOOKED) // 2 :][:_LOOKED] if len(values) > _LOOKED else values
    level = np.asarray(detrend(used))
    found = np.asarray(rfft(level * hann(len(level))))
    omega = 2 * np.pi * np.arange(len(found)) / (len(level) * step_s)
    return Spectrum(found, omega, _strongest(found))


def compare(first: Spectrum, second: Spectrum, order: int, step_s: float) -> Likeness:
    """Compares a signal with a derivative of another where the signal has its energy.

    Args:
        first: The signal that is differentiated.
        second: The signal that it is compared with.
        order: Number of derivatives, 0 for none.
        step_s: Sampling period [s].
    """
    derived = first.values * (1j * first.omega) ** order
    at = second.strongest
    x, y = derived[at], second.values[at]
    size = float(np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2)))
    if size == 0:
        return Likeness(0.0, 0.0, 0.0)
    cross = np.conj(x) * y
    slope = _delay(cross, first.omega[at])
    # A small delay turns high frequencies; without it the correlation says what it is meant to say.
    aligned = cross * np.exp(1j * first.omega[at] * slope)
    factor = float(np.sum(aligned).real / np.sum(np.abs(x) ** 2))
    return Likeness(abs(float(np.sum(aligned).real)) / size, factor, slope / step_s)


def response_at(
    drive: Spectrum, first: Spectrum, second: Spectrum, order: int, band: tuple[float, float]
) -> tuple[float, float]:
    """Compares two signals at the frequencies of a band that a third one excites.

    Args:
        drive: What excites.
        first: The signal that the other is compared with.
        second: The signal that is differentiated.
        order: Number of derivatives.
        band: Ends of the band [rad/s].

    Returns:
        Mean cosine of the phase between them, and the usual size of the second's derivative per size of the first.
    """
    at = drive.strongest[(drive.omega[drive.strongest] >= band[0]) & (drive.omega[drive.strongest] <= band[1])]
    x, y = first.values[at], second.values[at] * (1j * second.omega[at]) ** order
    told = (np.abs(x) > 0) & (np.abs(y) > 0)
    if not told.any():
        return 0.0, 0.0
    ratio = y[told] / x[told]
    return float(np.mean(np.cos(np.angle(ratio)))), float(np.median(np.abs(ratio)))


def _strongest(values: ComplexArray) -> IntArray:
    """The frequencies, the strongest first, that carry most of a signal's energy."""
    power = np.abs(values) ** 2
    power[:2] = 0  # what the window spreads from the mean
    order = np.argsort(power)[::-1]
    count = int(np.searchsorted(np.cumsum(power[order]), _CARRIED * power.sum())) + 1
    return np.asarray(np.sort(order[:count]))


def _delay(cross: ComplexArray, omega: FloatArray) -> float:
    """Delay that lines a cross spectrum up best with a real one of either sign: within a radian, then to a fraction."""
    weight = np.abs(cross)
    total = float(np.sum(weight * omega**2))
    if not total:
        return 0.0
    trials = np.linspace(-1.0, 1.0, 41) / np.sqrt(total / weight.sum())
    sums = np.array([abs(np.sum(cross * np.exp(1j * omega * one)).real) for one in trials])
    delay = float(trials[int(np.argmax(sums))])
    for _ in range(3):
        aligned = cross * np.exp(1j * omega * delay)
        phase = np.angle(aligned * np.sign(np.sum(aligned).real))
        delay -= float(np.sum(weight * omega * phase)) / total
    return delay
