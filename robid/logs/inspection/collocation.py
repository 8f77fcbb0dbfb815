"""Which of two motions of a drive is the motor's, and which the load's behind a spring, by how they go with each other.

Torque acts on the motor. Whatever the torque is, the motor reaches the load through the spring alone, so that between
them `motor / load = r (1 + c s + s^2 / w_a^2)`, a polynomial: `w_a` is where the motor stands still in spite of the
torque, its antiresonance, and below the resonance. The other way round is none. Amplitudes do not tell: below `w_a` the
load moves more than the motor, and above the resonance that depends on the inertias.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from robid.arrays import ComplexArray, FloatArray
from robid.logs.inspection.relations import Spectrum

_NEIGHBOURS = 5
"""Lines over which a coherence is averaged."""

_COHERENT = 0.8
"""Coherence from which a line counts."""

_FEWEST = 8
"""Lines that tell something, at least."""

_HIGHEST = 0.2
"""Share of the sampling rate up to which delays between two channels leave the polynomial as it is."""

_BENT = 0.1
"""Least share by which the spring bends the ratio over the band: less may be noise, or a delay."""

_BETTER = 0.5
"""Misfit of the polynomial over that of its inverse, at most."""

_GOOD = 0.3
"""Relative misfit of the polynomial up to which it is one."""

_SURELY_GOOD = 0.15
"""The same for a lone motion, of which nothing else tells."""

_TURNED = 1.5
"""Square of the highest line over that of the resonance from which the sign has turned within the band."""

_PARTS = (1.0, 0.5, 0.25)
"""Parts of the band that are looked at: above, further springs may make it none."""


@dataclass(frozen=True)
class Order:
    """Which of two motions the motor's is.

    Attributes:
        first: Whether it is the first of them.
        antiresonance: Angular frequency at which the motor stands still, poorly known where that is beyond the lines
            [rad/s].
        is_seen: Whether it is among the lines.
        misfit: Relative misfit of what a spring between them gives.
        other: The same for the motor on the other side.
    """

    first: bool
    antiresonance: float
    is_seen: bool
    misfit: float
    other: float


def find_motor(
    drive: Spectrum, first: Spectrum, second: Spectrum, orders: tuple[int, int], step_s: float
) -> Order | None:
    """Tells which of two motions of a drive is the motor's; None where their responses do not tell.

    Args:
        drive: What drives.
        first: One motion.
        second: The other one.
        orders: How often each is to be differentiated so that both are the same quantity.
        step_s: Sampling period [s].
    """
    x, y = first.derivative(orders[0]), second.derivative(orders[1])
    # Whatever moves them, as the torque of another joint: what they have in common tells.
    at = np.flatnonzero((_coherence(x, y) > _COHERENT) & (drive.omega * step_s < 2 * np.pi * _HIGHEST))
    at = np.intersect1d(at, drive.strongest)
    verdicts: list[Order] = []
    for part in _PARTS:
        inside = at[drive.omega[at] <= part * drive.omega[at[-1]]] if len(at) else at
        if len(inside) >= _FEWEST:
            found = _judge(x[inside], y[inside], drive.omega[inside])
            verdicts += [found] if found is not None else []
    if not verdicts or len({one.first for one in verdicts}) > 1:
        return None
    return min(verdicts, key=lambda one: one.misfit / max(one.other, 1e-12))


def _judge(x: ComplexArray, y: ComplexArray, omega: FloatArray) -> Order | None:
    """Tries either one as the motor's."""
    weight = 1 / (np.abs(x) ** 2 / np.median(np.abs(x)) ** 2 + np.abs(y) ** 2 / np.median(np.abs(y)) ** 2)
    (one, bend_one), (two, bend_two) = _misfit(x, y, weight, omega), _misfit(y, x, weight, omega)
    first = one < two
    best, other, bend = (one, two, bend_one) if first else (two, one, bend_two)
    if best > _GOOD or best > _BETTER * other or bend * float(omega.max()) ** 2 < _BENT:
        return None
    still = float(1 / np.sqrt(bend))
    return Order(first, still, bool(omega.min() <= still <= omega.max()), best, other)


def _misfit(motor: ComplexArray, load: ComplexArray, weight: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Relative misfit of `motor = load r (1 + c s + s^2 / w_a^2)`, and `1 / w_a^2`."""
    scale = float(omega.max())
    s = 1j * omega / scale
    rest, found = _solve(motor, load, weight, np.stack([np.ones(len(s)), s, s**2], axis=1))
    return rest, float(found[2] / found[0] / scale**2) if found[0] else 0.0


def _solve(
    wanted: ComplexArray, other: ComplexArray, weight: FloatArray, powers: ComplexArray
) -> tuple[float, FloatArray]:
    """Real factors of powers of `s` that make one motion of another, and the relative misfit."""
    columns = np.sqrt(weight)[:, None] * other[:, None] * powers
    left = np.sqrt(weight) * wanted
    found, *_ = np.linalg.lstsq(
        np.concatenate([columns.real, columns.imag]), np.concatenate([left.real, left.imag]), rcond=None
    )
    rest = float(np.linalg.norm(left - columns @ found) / max(float(np.linalg.norm(left)), 1e-300))
    return rest, np.asarray(found)


def _coherence(u: ComplexArray, x: ComplexArray) -> FloatArray:
    cross = np.conj(u) * x
    averaged = uniform_filter1d(cross.real, _NEIGHBOURS) ** 2 + uniform_filter1d(cross.imag, _NEIGHBOURS) ** 2
    power = uniform_filter1d(np.abs(u) ** 2, _NEIGHBOURS) * uniform_filter1d(np.abs(x) ** 2, _NEIGHBOURS)
    return np.asarray(averaged / np.maximum(power, 1e-300))


def is_behind_spring(drive: Spectrum, motion: Spectrum, order: int, step_s: float) -> bool:
    """Returns whether a lone motion is surely that of a load: its acceleration turns against the torque for good.

    A motor's acceleration goes with the torque at low lines and at high ones, and stands still between; a load's has no
    such line, `torque = acceleration J (d / s + 1 + c s + s^2 / w_r^2)`, and its sign changes at the resonance.

    Args:
        drive: The torque.
        motion: The motion.
        order: How often it is to be differentiated to an acceleration.
        step_s: Sampling period [s].
    """
    a, u = motion.derivative(order), drive.values
    at = np.flatnonzero((_coherence(u, a) > _COHERENT) & (drive.omega * step_s < 2 * np.pi * _HIGHEST))
    at = np.intersect1d(at, drive.strongest)
    for part in _PARTS:
        inside = at[drive.omega[at] <= part * drive.omega[at[-1]]] if len(at) else at
        if len(inside) >= _FEWEST and _turns(u[inside], a[inside], drive.omega[inside]):
            return True
    return False


def _turns(u: ComplexArray, a: ComplexArray, omega: FloatArray) -> bool:
    """Whether an acceleration follows its torque as a load's does, with the resonance well among the lines."""
    s = 1j * omega / float(omega.max())
    weight = 1 / np.abs(u) ** 2
    rest, found = _solve(u, a, weight, np.stack([1 / s, np.ones(len(s)), s, s**2], axis=1))
    plain, _ = _solve(u, a, weight, np.stack([1 / s, np.ones(len(s)), s], axis=1))
    return bool(rest < _SURELY_GOOD and rest < _BETTER * plain and found[1] and found[3] / found[1] > _TURNED)
