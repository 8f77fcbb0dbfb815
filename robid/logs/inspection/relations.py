"""How signals follow from each other: a speed is a derivative, a command comes first, a torque accelerates.

All functions take plain arrays, or the spectra that `spectrum_of` makes of them, and know neither logs nor mappings, so
that whatever compares channels of one motion can use them: `relate_signals` says how much of a derivative of one signal
another one is, and how surely.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import comb

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d
from scipy.signal import detrend

from robid.arrays import ComplexArray, FloatArray, IntArray

_LOOKED = 1 << 17
_CARRIED = 0.9  # share of a signal's energy in the frequencies that are compared
_NEIGHBOURS = 9  # lines over which cross and power spectra are averaged for a coherence
_COHERENT = 0.9  # coherence from which a line tells a factor
_AVERAGES = 6.0  # independent averages that these stand for, as a window correlates neighbours
_SLOW = 0.2  # share of the sampling rate up to which a factor is told: above, differences of samples are no derivatives
_LINES = 5  # lines from which a factor is told
# Share of an acceleration that speed and position do not explain, from which a torque can be compared with it
_LEFT = 1e-3
_SURE = 1e-6  # smallest relative distance between the bounds of a factor at a line that counts


@dataclass(frozen=True)
class Likeness:
    """How one signal follows from another."""

    correlation: float  # Of the signal with the other's derivative, 0 to 1 whatever the sign
    factor: float  # What the derivative is multiplied by, its sign included
    delay: float  # By how many samples the signal comes later than the derivative


@dataclass(frozen=True)
class Relation:
    """How much of another signal's derivative a signal is, by the transfer function between the two."""

    factor: float  # What the derivative is multiplied by towards low frequencies, its sign included
    relative_std: float  # Relative standard deviation of it: scatter over the lines, and what noise may hide
    delay: float  # By how many samples the signal comes later than the derivative
    carried: float  # Share of the signal's energy at the lines that tell the factor


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Spectrum of a signal, windowed."""

    # (3, n_freq) Transforms of the signal times the window, and times its first and second derivative
    windowed: ComplexArray
    trends: ComplexArray  # (2, n_freq) Orthonormal transforms of what a constant and a slope leave behind the window
    omega: FloatArray  # (n_freq,) Angular frequencies [rad/s]
    strongest: IntArray  # (n_strong,) Indices of the frequencies that carry most of its energy
    _derivatives: dict[int, ComplexArray] = field(default_factory=dict)

    @property
    def values(self) -> ComplexArray:
        """The spectrum (n_freq,)."""
        return self.derivative(0)

    def derivative(self, order: int) -> ComplexArray:
        """Spectrum (n_freq,) of the signal's derivative of an order 0 to 2 behind the same window.

        By parts, `w x' = (w x)' - w' x`: to multiply by `j omega` alone is wrong by the window's own derivative, which
        is most of it where a motion lasts no longer than some of its periods. Constants and slopes are taken out of
        every derivative by the same projection, which leaves the relation of two signals as it is.
        """
        if order not in self._derivatives:
            made = np.zeros_like(self.windowed[0])
            for part in range(order + 1):
                made += (-1) ** part * comb(order, part) * (1j * self.omega) ** (order - part) * self.windowed[part]
            self._derivatives[order] = _without(made, self.trends)
        return self._derivatives[order]


def spectrum_of(values: FloatArray, step_s: float) -> Spectrum:
    """Returns the spectrum of a signal (n_sample,) in the middle of which constants and slopes are taken out."""
    used = values[(len(values) - _LOOKED) // 2 :][:_LOOKED] if len(values) > _LOOKED else values
    window, trends = _window(len(used))
    rate = 2 * np.pi / (len(used) * step_s)
    scaled = window * np.array([[1.0], [rate], [rate**2]])
    windowed = np.asarray(rfft(np.asarray(detrend(used)) * scaled, axis=1))
    omega = rate * np.arange(windowed.shape[1])
    return Spectrum(windowed, trends, omega, _strongest(_without(windowed[0], trends)))


@lru_cache(maxsize=2)
def _window(count: int) -> tuple[FloatArray, ComplexArray]:
    """The window (3, n_sample) with its derivatives over the phase, and orthonormal trends (2, n_freq) behind it."""
    phase = 2 * np.pi * np.arange(count) / count
    window = 0.5 - 0.5 * np.cos(phase)
    derivatives = np.stack([window, 0.5 * np.sin(phase), 0.5 * np.cos(phase)])
    trends = _orthonormal(np.asarray(rfft(window * np.stack([np.ones(count), phase - np.pi]), axis=1)))
    return derivatives, trends


def compare(first: Spectrum, second: Spectrum, order: int, step_s: float) -> Likeness:
    """Compares a signal with the derivative of an order of the first one where it has its energy, by the step [s]."""
    at = second.strongest
    x, y = first.derivative(order)[at], second.values[at]
    size = float(np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2)))
    if size == 0:
        return Likeness(0.0, 0.0, 0.0)
    cross = np.conj(x) * y
    slope = _delay(cross, first.omega[at])
    # A small delay turns high frequencies; without it the correlation says what it is meant to say.
    aligned = cross * np.exp(1j * first.omega[at] * slope)
    factor = float(np.sum(aligned).real / np.sum(np.abs(x) ** 2))
    return Likeness(abs(float(np.sum(aligned).real)) / size, factor, slope / step_s)


def relate_signals(first: FloatArray, second: FloatArray, order: int, step_s: float) -> Relation | None:
    """Says how much of a derivative of a signal (n_sample,) another one is, None if they do not tell; see `relate`."""
    return relate(spectrum_of(first, step_s), spectrum_of(second, step_s), order, step_s)


def relate(first: Spectrum, second: Spectrum, order: int, step_s: float) -> Relation | None:
    """Says how much of a derivative of one signal another one is, None where the two do not tell.

    Noise of the first signal grows with its derivative and lowers a ratio of amplitudes; so the factor is that of the
    transfer function, at lines with coherence alone. Between `H1 = S_xy / S_xx`, low by noise of x, and `H2 = S_yy /
    S_yx`, high by noise of y, lies the true one: their geometric mean is taken, and half of their distance counts as a
    deviation. Speeds that are filtered, or differences of samples, bend it by the square of the frequency.

    The order of the derivative is 0 to 2, the step in s.
    """
    x, y = (one / max(float(np.linalg.norm(one)), 1e-300) for one in (first.derivative(order), second.values))
    ratio = float(np.linalg.norm(second.values)) / max(float(np.linalg.norm(first.derivative(order))), 1e-300)
    strong = second.strongest
    delay_s = _delay(np.conj(x[strong]) * y[strong], second.omega[strong])
    cross = np.conj(x) * y * np.exp(1j * first.omega * delay_s)
    averaged = uniform_filter1d(cross.real, _NEIGHBOURS) + 1j * uniform_filter1d(cross.imag, _NEIGHBOURS)
    power_x, power_y = (np.maximum(uniform_filter1d(np.abs(one) ** 2, _NEIGHBOURS), 1e-150) for one in (x, y))
    coherence = np.minimum(np.abs(averaged) ** 2 / (power_x * power_y), 1.0)
    useful = (coherence > _COHERENT) & (first.omega * step_s < 2 * np.pi * _SLOW)
    useful &= power_y > np.finfo(float).eps * power_y.max()
    useful[:2] = False
    at = np.flatnonzero(useful)
    energy = np.abs(y) ** 2
    carried = float(energy[at].sum() / max(energy[2:].sum(), 1e-300))
    if len(at) < _LINES:
        return None
    sign = float(np.sign(np.sum(averaged[at].real * power_y[at] / power_x[at] ** 0.5)))
    size = 0.5 * np.log(power_y[at] / power_x[at])  # of the geometric mean of H1 and H2
    apart = -0.5 * np.log(coherence[at])  # half of the distance between their logarithms
    level, deviation = _towards_zero(size, np.hypot(apart, _SURE), energy[at], first.omega[at] * step_s)
    return Relation(sign * ratio * float(np.exp(level)), deviation, delay_s / step_s, carried)


def _towards_zero(size: FloatArray, apart: FloatArray, energy: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Value towards zero frequency of an even curve over frequency, and its deviation.

    A constant and a parabola are fitted to all lines and to the lower ones alone; the one counts that scatters least.
    `size` (n_line,) is the logarithm of the factor, `apart` how far noise may have moved it, `omega` in rad per sample.
    """
    # Lines count by what they say, those with hardly any energy by that.
    every = 1 / (apart**2 + 1e-6) * np.minimum(energy / (1e-4 * energy.max()), 1.0)
    found: list[tuple[float, float]] = []
    count = len(omega)
    while count >= _LINES:
        weight = every[:count] / every[:count].sum()
        bias = float(np.sum(weight * apart[:count]))
        # Of an averaged line, var log |H| = (1 - coherence) / (2 averages); neighbours share most of it.
        chance = bias / _AVERAGES / max(1 / float(np.sum(weight**2)) / _NEIGHBOURS, 1.0)
        relative = (omega[:count] / omega[count - 1]) ** 2
        for basis in (np.ones((count, 1)), np.stack([np.ones(count), relative], axis=1)):
            normal = basis.T @ (weight[:, None] * basis)
            if basis.shape[1] > 1 and (count < 2 * _LINES or np.linalg.cond(normal) > 1e9):
                continue
            inverse = np.linalg.inv(normal)
            solution = inverse @ (basis.T @ (weight * size[:count]))
            rest = float(np.sum(weight * (size[:count] - basis @ solution) ** 2))
            found.append((float(solution[0]), float(np.sqrt((rest + chance) * inverse[0, 0] + bias**2))))
        count //= 2
    return min(found, key=lambda one: one[1])


def response_at(
    drive: Spectrum, first: Spectrum, second: Spectrum, order: int, band: tuple[float, float]
) -> tuple[float, float]:
    """Compares a derivative of a signal with another one at the frequencies of a band [rad/s] that a third one excites.

    Returns:
        Mean cosine of the phase between them, and the usual size of the second's derivative per size of the first.
    """
    at = drive.strongest[(drive.omega[drive.strongest] >= band[0]) & (drive.omega[drive.strongest] <= band[1])]
    x = first.values[at]
    y = second.derivative(order)[at] if order >= 0 else second.values[at] * (1j * second.omega[at]) ** order
    told = (np.abs(x) > 0) & (np.abs(y) > 0)
    if not told.any():
        return 0.0, 0.0
    ratio = y[told] / x[told]
    return float(np.mean(np.cos(np.angle(ratio)))), float(np.median(np.abs(ratio)))


def sense_of_inertia(drive: Spectrum, motion: Spectrum, order: int, band: tuple[float, float]) -> float:
    """Tells which way a motion counts against the torque that drives it.

    In `torque = inertia x acceleration + damping x speed + stiffness x position` the inertia is positive. Phases alone
    do not tell: below where gravity or a spring to the base gives way to inertia, acceleration goes against torque.

    The motion becomes an acceleration by `order` derivatives; only lines of the drive within the band [rad/s] count.

    Returns:
        Correlation of torque and acceleration once speed and position are taken out of both, -1 to 1.
    """
    at = drive.strongest[(drive.omega[drive.strongest] >= band[0]) & (drive.omega[drive.strongest] <= band[1])]
    if len(at) < _LINES:
        return 0.0
    torque, acceleration, omega = drive.values[at], motion.derivative(order)[at], drive.omega[at]
    # Neither resonances nor antiresonances are to outweigh all else.
    weight = 1 / np.sqrt(np.maximum(np.abs(torque) * np.abs(acceleration), np.finfo(float).tiny))
    torque, acceleration = weight * torque, weight * acceleration
    rest = np.stack([acceleration / (1j * omega), -acceleration / omega**2], axis=1)
    u, a = (_split_off(one, rest) for one in (torque, acceleration))
    size = float(np.linalg.norm(u) * np.linalg.norm(a))
    # What is left of an acceleration that the others explain is rounding.
    told = np.linalg.norm(a) > _LEFT * np.linalg.norm(acceleration)
    whole = float(np.linalg.norm(torque))
    return float(u @ a) / size * min(float(np.linalg.norm(u)) / whole / _LEFT, 1.0) if size and told else 0.0


def sense_of_loss(drive: Spectrum, motion: Spectrum, order: int) -> float:
    """Tells which way a motor's motion counts against its torque by where the work goes.

    A motor drives what loses energy, however joints pass it to each other: torque goes with the speed on the whole.

    Args:
        drive: The torque.
        motion: The motor's motion, which becomes a speed by `order` derivatives.
        order: From 0 to 2.

    Returns:
        Correlation of torque and speed, -1 to 1.
    """
    torque, speed = drive.values, motion.derivative(order)
    size = float(np.linalg.norm(torque) * np.linalg.norm(speed))
    return float(np.vdot(torque, speed).real) / size if size else 0.0


def _split_off(values: ComplexArray, others: ComplexArray) -> FloatArray:
    """Real and imaginary part of a spectrum without what real factors of others make of it."""
    columns = np.concatenate([others.real, others.imag])
    parts = np.concatenate([values.real, values.imag])
    found, *_ = np.linalg.lstsq(columns, parts, rcond=None)
    return np.asarray(parts - columns @ found)


def _without(values: ComplexArray, trends: ComplexArray) -> ComplexArray:
    """A spectrum without what lies along orthonormal ones, with real factors."""
    return np.asarray(values - (np.conj(trends) @ values).real @ trends)


def _orthonormal(trends: ComplexArray) -> ComplexArray:
    """Spectra (n, n_freq) turned into orthonormal ones, with real factors."""
    made: list[ComplexArray] = []
    for one in trends:
        rest = one
        for other in made:
            rest = rest - float(np.sum(np.conj(other) * rest).real) * other
        made.append(rest / max(float(np.linalg.norm(rest)), np.finfo(float).tiny))
    return np.stack(made)


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
