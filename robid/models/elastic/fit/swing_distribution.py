"""How far a cubic spring's expected slope departs from that under a normal swing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft

from robid.arrays import ComplexArray, FloatArray, IntArray

_REACH = 2  # of the highest excited line: further up the robot hardly follows


@dataclass(frozen=True)
class Swinging:
    """A cubic spring in one configuration, swinging about its rest under an excitation.

    Attributes:
        rest: Deflection at rest [rad].
        cubic: Cubic coefficient [N m/rad^3].
        amplitude (n_freq, n_block): Deflection at the excited lines, DFT sums over samples [rad].
        lines (n_freq,): The excited lines.
        compliance (n_line,): Deflection by a torque pair on the spring at lines 0, 1, 2, ... [rad/(N m)].
    """

    rest: float
    cubic: float
    amplitude: ComplexArray
    lines: IntArray
    compliance: ComplexArray


def swing_shape(spring: Swinging, weight: FloatArray) -> float:
    """Finds `Rest.shape` of a spring, a mean over the lines with weights (n_freq,).

    At one line, the nonlinear torque of the swing regressed on the swing, over what a normal one gives. The torque at
    lines that are not excited moves the spring there too, by its compliance, and that motion mixes back into the
    excited lines: about a bent rest it lowers the slope by some `(3 k3 d0)^2 v` times the compliance.
    """
    count = scipy.fft.next_fast_len(6 * int(spring.lines.max()) + 1, real=True)
    spectrum = np.zeros((count // 2 + 1, spring.amplitude.shape[1]), complex)
    spectrum[spring.lines] = spring.amplitude
    signal = scipy.fft.irfft(spectrum, count, axis=0) * count
    free = np.zeros(len(spectrum), complex)
    free[: spring.compliance.size] = spring.compliance
    free[spring.lines] = free[0] = 0.0
    torque = scipy.fft.rfft(_bent(spring, signal), axis=0)
    moved = signal - spring.cubic * scipy.fft.irfft(free[:, None] * torque, count, axis=0)
    mixed = scipy.fft.rfft(_bent(spring, moved), axis=0)[spring.lines] / count
    known = spring.amplitude
    slope = np.real(mixed * known.conj()).sum(axis=-1) / (np.abs(known) ** 2).sum(axis=-1)
    return float((weight * slope).sum() / weight.sum() / (3 * (signal**2).mean()))


def _bent(spring: Swinging, swing: FloatArray) -> FloatArray:
    """Torque over the cubic coefficient, but for the part that is linear in the swing."""
    return np.asarray(swing * swing * (3 * spring.rest + swing))


def spring_compliance(
    matrices: tuple[FloatArray, FloatArray, FloatArray], springs: IntArray, omega: FloatArray
) -> ComplexArray:
    """Deflection (n_line, n_spring) that a torque pair on a spring makes there [rad/(N m)].

    Args:
        matrices: Mass, damping and stiffness (n, n) of one configuration.
        springs (n_spring,): Coordinates of the springs.
        omega (n_line,): Angular frequencies [rad/s].
    """
    mass, damping, stiffness = matrices
    found = np.zeros((omega.size, springs.size), complex)
    line = omega[1:, None, None]
    right = np.broadcast_to(np.eye(len(mass))[:, springs], (omega.size - 1, len(mass), springs.size))
    solved = np.linalg.solve(stiffness - line**2 * mass + 1j * line * damping, right)
    found[1:] = solved[:, springs, np.arange(springs.size)]
    return found


def line_frequencies(frequency_hz: FloatArray, lines: IntArray) -> FloatArray:
    """Angular frequencies (n_line,) of all lines up to where a spring's own torque is followed [rad/s]."""
    step = frequency_hz[-1] / lines[-1]
    return np.asarray(2 * np.pi * step * np.arange(_REACH * int(lines.max()) + 1))
