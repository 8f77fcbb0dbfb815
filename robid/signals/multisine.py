"""Orthogonal random-phase multisines: spectra and time signals."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft
from scipy.linalg import hadamard

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape

_SQUARES_MODULO_5 = (0, 1, -1, -1, 1)  # whether an index is a square modulo 5 (1), is none (-1), or is 0


def orthogonal_matrix(size: int) -> ComplexArray:
    """Returns a matrix (n, n) with entries of magnitude 1 and `T T^H = n I`.

    Entries of few phases leave each motor few different signals in a block, and so a lower crest factor:
    Hadamard's +-1 where n is a power of two, +-1 and +-j for n = 6 (`I + jC` with Paley's conference matrix C),
    else the DFT matrix `exp(2 pi j (i-1)(l-1)/n)`.

    Source:
        Dobrowiecki, Schoukens and Guillaume (2006), Optimized excitation signals for MIMO frequency response
        function measurements; Paley (1933) for C.
    """
    if size & (size - 1) == 0:
        return np.asarray(hadamard(size), complex)
    index = np.arange(size)
    if size == 6:
        conference = np.ones((6, 6))
        conference[0, 0] = 0
        conference[1:, 1:] = np.take(_SQUARES_MODULO_5, (index[:5, None] - index[:5]) % 5)
        return np.eye(6) + 1j * conference
    return np.asarray(np.exp(2j * np.pi * (np.outer(index, index) % size) / size))


def multisine(amplitude: FloatArray, phase: FloatArray, turn: FloatArray | None = None) -> ComplexArray:
    """Spreads one multisine per motor over an orthogonal block of experiments.

    Args:
        amplitude (n_motor, n_lines): Amplitude of each line [any unit].
        phase (n_real, n_motor, n_lines): Phases, new in each realization [rad].
        turn (n_real, n_exp, n_lines): Phases that all motors have in common in an experiment [rad]; none by default.

    Returns:
        Complex amplitudes `R = R_diag T D` (n_real, n_exp, n_lines, n_motor), n_exp = n_motor, D diagonal with the
        turns; the signal is the real part of their sum over the lines.

    Source:
        Wernholt and Moberg (2008), sec. 4; METHODS sec. 2.
    """
    n_motor, n_lines = amplitude.shape
    check_shape("phase", phase, "n_real n_motor n_lines", n_motor=n_motor, n_lines=n_lines)
    diagonal = amplitude * np.exp(1j * phase)
    block = np.einsum("rik,ie->reki", diagonal, orthogonal_matrix(n_motor))
    if turn is None:
        return np.asarray(block)
    check_shape("turn", turn, "n_real n_exp n_lines", n_real=len(phase), n_exp=n_motor, n_lines=n_lines)
    return np.asarray(block * np.exp(1j * turn)[..., None])


def time_signal(spectrum: ComplexArray, lines: IntArray, n_sample: int) -> FloatArray:
    """Returns one period (..., n_sample, n_channel) of complex amplitudes (..., n_lines, n_channel) at `lines`."""
    full = np.zeros((*spectrum.shape[:-2], n_sample // 2 + 1, spectrum.shape[-1]), complex)
    full[..., lines, :] = spectrum * (n_sample / 2)
    return np.asarray(irfft(full, n=n_sample, axis=-2))


def crest_factor(signal: FloatArray) -> FloatArray:
    """Returns peak over RMS along the sample axis of (..., n_sample, n_channel)."""
    return np.asarray(np.abs(signal).max(axis=-2) / np.sqrt(np.mean(signal**2, axis=-2)))
