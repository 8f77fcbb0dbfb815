"""What a linear robot would not show: coherence at the excited lines, distortion at the silent ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.interpolate import PchipInterpolator

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.spectra import Blocks

Lines: TypeAlias = IntArray | FloatArray
_SHORTEST = 4


@dataclass(frozen=True)
class SilentLevels:
    """Output residual at lines that were not excited, as amplitudes of one experiment.

    Attributes:
        level (n_silent, n_out): RMS of `Y - G U` over realizations and experiments.
        noise (n_silent, n_out): Part of it that the periods show to be noise, or None with a single period.
        doubt (n_silent, n_out): What the interpolation error of G alone may amount to.
    """

    level: FloatArray
    noise: FloatArray | None
    doubt: FloatArray


def silent_lines(excited: IntArray) -> IntArray:
    """All lines of the band that are not excited."""
    return np.setdiff1d(np.arange(excited.min(), excited.max() + 1), excited)


def silent_levels(silent: Blocks, lines: IntArray, response: ComplexArray) -> SilentLevels:
    """Residual at silent lines, corrected for feedback.

    What appears at a silent line was made by the robot (nonlinearity, noise) and fed back by the controller as
    input; `Y - G U` takes out the linear robot's answer to that input. Real and imaginary part of G's elements
    are interpolated over the logarithm of frequency by cubics that do not overshoot. That is wrong where a
    resonance is narrower than the lines' distance: `doubt` tells how much.

    Args:
        silent: Spectra at the silent lines, compensated as those at the excited ones were.
        lines (n_freq,): Excited lines.
        response (n_freq, n_out, n_in): Response at the excited lines.

    Returns:
        The levels; all empty without silent lines.
    """
    between = interpolate_response(lines, response, silent.lines)
    level = _rms(silent.outputs - between @ silent.inputs)
    noise = None
    if silent.scatter_freedom:
        scatter = silent.output_scatter - between @ silent.input_scatter
        noise = np.sqrt((np.abs(scatter) ** 2).sum(axis=1).mean(axis=(0, -1)) / silent.scatter_freedom)
    error = interpolation_error(lines, response, silent.lines)
    power = (np.abs(silent.inputs) ** 2).mean(axis=(0, -1))
    doubt = np.sqrt(np.einsum("foi,fi->fo", error**2, power))
    return SilentLevels(level, None if noise is None else np.asarray(noise), np.asarray(doubt))


def interpolate_response(lines: Lines, response: ComplexArray, wanted: Lines) -> ComplexArray:
    """Response at lines, or frequencies, in between (n_wanted, n_out, n_in), see `silent_levels`.

    The ends are held outside.
    """
    if not len(wanted) or len(lines) < 2:
        return np.broadcast_to(response[:1], (len(wanted), *response.shape[1:])).copy()
    inside = np.log(np.clip(wanted, lines[0], lines[-1]))
    parts = PchipInterpolator(np.log(lines), np.stack([response.real, response.imag], axis=-1))(inside)
    return np.asarray(parts[..., 0] + 1j * parts[..., 1])


def multiple_coherence(outputs: ComplexArray, covariance: ComplexArray | None) -> FloatArray:
    """Share of each output's power that the response explains, over experiments and realizations.

    Args:
        outputs (n_real, n_freq, n_out, n_exp): Output spectra.
        covariance (n_freq, n_out, n_out): Covariance of the output residual `Y - G U`, corrected for the freedom
            that the estimate took: total, or of the noise where a single realization leaves no residual; or None.

    Returns:
        (n_freq, n_out), within 0 and 1; NaN without a covariance.
    """
    power = (np.abs(outputs) ** 2).mean(axis=(0, -1))
    if covariance is None:
        return np.full(power.shape, np.nan)
    lost = np.real(np.diagonal(covariance, axis1=-2, axis2=-1))
    return np.asarray(np.clip(1 - lost / np.maximum(power, np.finfo(float).tiny), 0, 1))


def explained_coherence(response: ComplexArray, inputs: ComplexArray, covariance: ComplexArray) -> FloatArray:
    """Multiple coherence of a local model: what the response makes of the inputs, over that and the residual.

    The outputs themselves hold the transient too, which is neither, and may be far larger than both.

    Args:
        response (n_freq, n_out, n_in): Response.
        inputs (n_freq, n_exp, width, n_in): Input spectra at the bins around each line.
        covariance (n_freq, n_out, n_out): Covariance of one experiment's output residual.

    Returns:
        (n_freq, n_out), within 0 and 1.
    """
    made = inputs @ np.swapaxes(response, 1, 2)[:, None]
    power = (np.abs(made) ** 2).mean(axis=(1, 2))
    lost = np.real(np.diagonal(covariance, axis1=-2, axis2=-1))
    return np.asarray(power / np.maximum(power + lost, np.finfo(float).tiny))


def interpolation_error(lines: Lines, response: ComplexArray, wanted: Lines) -> FloatArray:
    """Magnitude (n_wanted, n_out, n_in) of the interpolation's error, at most that of lines twice as far apart."""
    if len(lines) < _SHORTEST or not len(wanted):
        return np.zeros((len(wanted), *response.shape[1:]))
    error = np.zeros(response.shape)
    for first in (0, 1):
        kept = np.union1d(np.arange(first, len(lines), 2), [0, len(lines) - 1])
        left = np.setdiff1d(np.arange(len(lines)), kept)
        guess = interpolate_response(lines[kept], response[kept], lines[left])
        error[left] = np.abs(guess - response[left])
    right = np.clip(np.searchsorted(lines, wanted), 1, len(lines) - 1)
    return np.asarray(np.maximum(error[right - 1], error[right]))


def _rms(spectra: ComplexArray) -> FloatArray:
    return np.asarray(np.sqrt((np.abs(spectra) ** 2).mean(axis=(0, -1))))
