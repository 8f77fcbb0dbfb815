"""Low crest factors: phases that flatten a multisine over a block of experiments, and the motion it causes."""

from __future__ import annotations

import numpy as np
from scipy.fft import fft, ifft, next_fast_len
from scipy.optimize import minimize

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.signals.waveforms import orthogonal_matrix

LEVELS = (2, 3, 4, 5, 6, 7, 9)
"""Rising exponents 2^level of the norm whose minimum approaches the lowest peak."""

_SAMPLES_PER_PERIOD = 16  # samples in one period of the highest line; with 8 of them a peak between two is 2 % higher


def reduce_crest(
    phases: FloatArray, amplitudes: FloatArray, lines: IntArray, shifts: FloatArray, *, iterations: int
) -> tuple[FloatArray, float]:
    """Lowers the peak of a multisine and of its phase-shifted copies at once.

    Minimises the L2p norm over all copies for rising p by L-BFGS with the analytic gradient. One complex FFT
    serves every copy, since they are `Re(z exp(j shift))` of one analytic signal; a signal of odd lines repeats
    with opposite sign after half a period, which halves the grid.

    Args:
        phases (n_lines,): Starting phases [rad].
        amplitudes (n_lines,): Amplitudes [any unit].
        lines (n_lines,): DFT lines.
        shifts (n_shift,) or (n_shift, n_lines): Phase added to all lines, or to each, in each copy [rad].
        iterations: Iterations at each exponent; 0 returns the start.

    Returns:
        Phases (n_lines,) [rad] and their crest factor, never above the start's, on the evaluation grid.

    Source:
        Guillaume, Schoukens, Pintelon and Kollar (1991), Crest-factor minimization using nonlinear Chebyshev
        approximation methods (the L2p norm).
    """
    norm = (_CopiesNorm if shifts.ndim == 1 else _TurnedNorm)(amplitudes, lines, shifts)
    return _descend(norm, phases, iterations)


def reduce_crest_with_motion(
    phases: FloatArray,
    amplitudes: FloatArray,
    lines: IntArray,
    response: ComplexArray,
    turn: FloatArray | None = None,
    *,
    iterations: int,
) -> FloatArray:
    """Lowers the peaks of all motors' multisines and of the motion they cause, over the experiments of a block.

    Args:
        phases (n_motor, n_lines): Starting phases [rad].
        amplitudes (n_motor, n_lines): Amplitudes [any unit].
        lines (n_lines,): DFT lines.
        response (n_lines, n_out, n_motor): From references to motion [any unit].
        turn (n_exp, n_lines): Phases that all motors have in common in an experiment [rad]; none by default.
        iterations: Iterations at each exponent; 0 returns the start.

    Returns:
        Phases (n_motor, n_lines) [rad]; the largest peak over RMS of all signals is never above the start's.
    """
    norm = _BlockNorm(amplitudes, lines, response, turn)
    return _descend(norm, phases.ravel(), iterations)[0].reshape(phases.shape)


class _Norm:
    """Logarithm of the L2p norm of multisines on a fine grid; phases to coefficients is left to the kinds."""

    def __init__(self, lines: IntArray) -> None:
        odd = bool(np.all(lines % 2 == 1))
        stride, offset = (2, 1) if odd else (1, 0)
        self.size = next_fast_len(int(np.ceil(_SAMPLES_PER_PERIOD * lines.max() / stride)))
        self.twiddle = np.exp(2j * np.pi * offset * np.arange(self.size) / (stride * self.size))
        self.bins = (lines - offset) // stride

    def analytic(self, coefficients: ComplexArray) -> ComplexArray:
        """Analytic signals (..., size) of complex amplitudes (..., n_lines)."""
        spectrum = np.zeros((*coefficients.shape[:-1], self.size), complex)
        spectrum[..., self.bins] = coefficients
        return np.asarray(ifft(spectrum, norm="forward") * self.twiddle)

    def project(self, force: ComplexArray | FloatArray) -> ComplexArray:
        """Transpose of `analytic`, by the forward transform of the conjugate."""
        return np.asarray(np.conj(fft(np.conj(force * self.twiddle)))[..., self.bins])

    def signals(self, phases: FloatArray) -> FloatArray:
        """Signals (..., size) of unit mean square."""
        raise NotImplementedError

    def gradient(self, phases: FloatArray, force: FloatArray) -> FloatArray:
        """Derivative of the signals weighted by a force of their shape."""
        raise NotImplementedError

    def peak(self, phases: FloatArray) -> float:
        """Largest absolute value over all signals."""
        return float(np.abs(self.signals(phases)).max())

    def __call__(self, phases: FloatArray, level: int) -> tuple[float, FloatArray]:
        """Value and gradient of the norm with exponent 2^level."""
        signals = self.signals(phases)
        scale = float(np.abs(signals).max())
        odd = signals / scale
        even = odd * odd
        for _ in range(level - 1):
            odd *= even
            even *= even
        total = float(even.sum())
        value = np.log(scale) + np.log(total / signals.size) / 2**level
        return float(value), self.gradient(phases, odd) / (scale * total)


class _CopiesNorm(_Norm):
    """One motor's multisine in all experiments: copies that are shifted in phase."""

    def __init__(self, amplitudes: FloatArray, lines: IntArray, shifts: FloatArray) -> None:
        super().__init__(lines)
        self.amplitudes = amplitudes / np.sqrt(np.sum(amplitudes**2) / 2)
        # A copy shifted by pi has the same absolute values.
        angles = np.unique(np.round(np.mod(shifts, np.pi), 9))
        self.rotations = np.exp(1j * angles[angles < np.pi - 1e-8])[:, None]

    def signals(self, phases: FloatArray) -> FloatArray:
        return np.real(self.rotations * self.analytic(self.amplitudes * np.exp(1j * phases)))

    def gradient(self, phases: FloatArray, force: FloatArray) -> FloatArray:
        projected = self.project(np.sum(force * self.rotations, axis=0))
        return np.real(1j * self.amplitudes * np.exp(1j * phases) * projected)


class _TurnedNorm(_Norm):
    """One motor's multisine in all experiments: copies whose every line is shifted by its own phase."""

    def __init__(self, amplitudes: FloatArray, lines: IntArray, shifts: FloatArray) -> None:
        super().__init__(lines)
        self.rotated = amplitudes / np.sqrt(np.sum(amplitudes**2) / 2) * np.exp(1j * shifts)

    def signals(self, phases: FloatArray) -> FloatArray:
        return np.real(self.analytic(self.rotated * np.exp(1j * phases)))

    def gradient(self, phases: FloatArray, force: FloatArray) -> FloatArray:
        return np.asarray(np.real(1j * self.rotated * np.exp(1j * phases) * self.project(force)).sum(axis=0))


class _BlockNorm(_Norm):
    """All motors' multisines and the motion they cause in all experiments of a block."""

    def __init__(
        self, amplitudes: FloatArray, lines: IntArray, response: ComplexArray, turn: FloatArray | None = None
    ) -> None:
        super().__init__(lines)
        n_motor = len(amplitudes)
        check_shape("response", response, "n_lines n_out n_motor", n_lines=len(lines), n_motor=n_motor)
        self.turns = orthogonal_matrix(n_motor)[:, :, None] * amplitudes[:, None]
        if turn is not None:
            self.turns = self.turns * np.exp(1j * turn)
        motion = np.sqrt(np.sum(np.abs(response) ** 2 * (amplitudes.T[:, None] ** 2), axis=(0, 2)) / 2)
        size = np.sqrt(np.sum(amplitudes**2, axis=1) / 2)
        alone = np.broadcast_to(np.diag(1 / size), (len(lines), n_motor, n_motor))
        self.mix = np.moveaxis(np.concatenate([alone, response / motion[:, None]], axis=1), 0, -1)

    def signals(self, phases: FloatArray) -> FloatArray:
        return np.real(self.analytic(np.einsum("oik,iek->oek", self.mix, self._coefficients(phases), optimize=True)))

    def gradient(self, phases: FloatArray, force: FloatArray) -> FloatArray:
        projected: ComplexArray = np.einsum("oik,oek->iek", self.mix, self.project(force), optimize=True)
        return np.asarray(np.real(1j * self._coefficients(phases) * projected).sum(axis=1).ravel())

    def _coefficients(self, phases: FloatArray) -> ComplexArray:
        return np.asarray(self.turns * np.exp(1j * phases.reshape(len(self.turns), 1, -1)))


def _descend(norm: _Norm, start: FloatArray, iterations: int) -> tuple[FloatArray, float]:
    best, best_peak = start, norm.peak(start)
    current = start
    options = {"maxiter": iterations, "maxcor": 20}
    for level in LEVELS if iterations else ():
        current = minimize(norm, current, args=(level,), jac=True, method="L-BFGS-B", options=options).x
        peak = norm.peak(current)
        if peak < best_peak:
            best, best_peak = current, peak
    return np.asarray(best), best_peak
