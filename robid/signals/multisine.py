"""Orthogonal random-phase multisines: spectra, time signals and low crest factors."""

from __future__ import annotations

import numpy as np
from scipy.fft import fft, ifft, irfft, next_fast_len
from scipy.optimize import minimize

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape

CREST_EXPONENTS = (4, 8, 16, 32)
"""Rising exponents p of the L2p norm whose minimum approaches the lowest peak."""


def orthogonal_matrix(size: int) -> ComplexArray:
    """Returns `T_il = exp(2 pi j (i-1)(l-1)/n)`, (n, n), with `T T^H = n I`."""
    index = np.arange(size)
    return np.asarray(np.exp(2j * np.pi * (np.outer(index, index) % size) / size))


def multisine(amplitude: FloatArray, phase: FloatArray) -> ComplexArray:
    """Spreads one multisine per motor over an orthogonal block of experiments.

    Args:
        amplitude (n_motor, n_lines): Amplitude of each line [any unit].
        phase (n_real, n_motor, n_lines): Phases, new in each realization [rad].

    Returns:
        Complex amplitudes `R = R_diag T` (n_real, n_exp, n_lines, n_motor), n_exp = n_motor; the signal is the
        real part of their sum over the lines.

    Source:
        Wernholt and Moberg (2008), sec. 4; METHODS sec. 2.
    """
    n_motor, n_lines = amplitude.shape
    check_shape("phase", phase, "n_real n_motor n_lines", n_motor=n_motor, n_lines=n_lines)
    diagonal = amplitude * np.exp(1j * phase)
    return np.asarray(np.einsum("rik,ie->reki", diagonal, orthogonal_matrix(n_motor)))


def time_signal(spectrum: ComplexArray, lines: IntArray, n_sample: int) -> FloatArray:
    """Returns one period (..., n_sample, n_channel) of complex amplitudes (..., n_lines, n_channel) at `lines`."""
    full = np.zeros((*spectrum.shape[:-2], n_sample // 2 + 1, spectrum.shape[-1]), complex)
    full[..., lines, :] = spectrum * (n_sample / 2)
    return np.asarray(irfft(full, n=n_sample, axis=-2))


def crest_factor(signal: FloatArray) -> FloatArray:
    """Returns peak over RMS along the sample axis of (..., n_sample, n_channel)."""
    return np.asarray(np.abs(signal).max(axis=-2) / np.sqrt(np.mean(signal**2, axis=-2)))


def reduce_crest(
    phases: FloatArray, amplitudes: FloatArray, lines: IntArray, shifts: FloatArray, *, iterations: int
) -> FloatArray:
    """Lowers the peak of a multisine and of its phase-shifted copies at once.

    Minimises the L2p norm over all copies for rising p by L-BFGS with the analytic gradient. One complex FFT
    serves every copy, since they are `Re(z exp(j shift))` of one analytic signal; a signal of odd lines repeats
    with opposite sign after half a period, which halves the grid.

    Args:
        phases (n_lines,): Starting phases [rad].
        amplitudes (n_lines,): Amplitudes [any unit].
        lines (n_lines,): DFT lines.
        shifts (n_shift,): Phase added to all lines in each copy [rad].
        iterations: Iterations at each exponent p; 0 returns the start.

    Returns:
        Phases (n_lines,) [rad]; never with a larger peak than the start's on the evaluation grid.

    Source:
        Guillaume, Schoukens, Pintelon and Kollar (1991), Crest-factor minimization using nonlinear Chebyshev
        approximation methods (the L2p norm).
    """
    if iterations == 0:
        return phases
    norm = _BlockNorm(amplitudes, lines, shifts)
    best, best_peak = phases, norm.peak(phases)
    current = phases
    options = {"maxiter": iterations, "maxcor": 20}
    for exponent in CREST_EXPONENTS:
        current = minimize(norm, current, args=(exponent,), jac=True, method="L-BFGS-B", options=options).x
        peak = norm.peak(current)
        if peak < best_peak:
            best, best_peak = current, peak
    return np.asarray(best)


class _BlockNorm:
    """Logarithm of the L2p norm of a multisine and its phase-shifted copies, with its gradient."""

    def __init__(self, amplitudes: FloatArray, lines: IntArray, shifts: FloatArray) -> None:
        odd = bool(np.all(lines % 2 == 1))
        stride, offset = (2, 1) if odd else (1, 0)
        # Four samples per Nyquist interval of the highest line.
        self.size = next_fast_len(int(np.ceil(8 * lines.max() / stride)))
        self.twiddle = np.exp(2j * np.pi * offset * np.arange(self.size) / (stride * self.size))
        self.bins = (lines - offset) // stride
        self.amplitudes = amplitudes / np.sqrt(np.sum(amplitudes**2) / 2)
        # A copy shifted by pi has the same absolute values.
        angles = np.unique(np.round(np.mod(shifts, np.pi), 9))
        self.rotations = np.exp(1j * angles[angles < np.pi - 1e-8])[:, None]

    def _signals(self, phases: FloatArray) -> tuple[ComplexArray, FloatArray]:
        coefficients = self.amplitudes * np.exp(1j * phases)
        spectrum = np.zeros(self.size, complex)
        spectrum[self.bins] = coefficients
        analytic = ifft(spectrum, norm="forward") * self.twiddle
        return coefficients, np.real(self.rotations * analytic)

    def peak(self, phases: FloatArray) -> float:
        """Largest absolute value over all copies, relative to the RMS."""
        return float(np.abs(self._signals(phases)[1]).max())

    def __call__(self, phases: FloatArray, exponent: int) -> tuple[float, FloatArray]:
        coefficients, signals = self._signals(phases)
        scale = np.abs(signals).max()
        scaled = signals / scale
        powers = scaled ** (2 * exponent - 1)
        total = float(np.sum(powers * scaled))
        force = np.sum(powers * self.rotations, axis=0) * self.twiddle
        # sum_t force(t) exp(j w_k t) is the conjugate of the forward transform of conj(force).
        projected = np.conj(fft(np.conj(force)))[self.bins]
        gradient = np.real(1j * coefficients * projected) / (scale * total)
        value = np.log(scale) + np.log(total / signals.size) / (2 * exponent)
        return float(value), np.asarray(gradient)
