"""What a linear robot would not show at excited and silent lines; what stands in for lines that tell too little."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import median_filter

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.spectra import Blocks

Lines: TypeAlias = IntArray | FloatArray
_SHORTEST = 4


class SilentLevels(NamedTuple):
    """Output residual (n_silent, n_out) at lines that were not excited, as amplitudes of one experiment."""

    level: FloatArray  # RMS of `Y - G U` over realizations and experiments
    noise: FloatArray | None  # Part of it that the periods show to be noise, or None with a single period
    interpolation: FloatArray  # What the interpolation error of G alone may amount to


def silent_lines(excited: IntArray) -> IntArray:
    """All lines of the band that are not excited."""
    return np.setdiff1d(np.arange(excited.min(), excited.max() + 1), excited)


def silent_levels(silent: Blocks, lines: IntArray, response: ComplexArray) -> SilentLevels:
    """Residual at silent lines, corrected for feedback; empty without any.

    What appears at a silent line was made by the robot (nonlinearity, noise) and fed back by the controller as
    input; `Y - G U` takes out the linear robot's answer to that input. Real and imaginary part of G's elements
    are interpolated over the logarithm of frequency by cubics that do not overshoot. That is wrong where a
    resonance is narrower than the lines' distance: `interpolation` tells how much.

    Args:
        silent: Spectra at the silent lines, compensated as those at the excited ones were.
        lines (n_freq,): Excited lines.
        response (n_freq, n_out, n_in): Response at the excited lines.
    """
    between = interpolate_response(lines, response, silent.lines)
    level = _rms(silent.outputs - between @ silent.inputs)
    noise = None
    if silent.scatter_freedom:
        # The part that periods differ by is noise; the rest of the level repeats, and is distortion.
        scatter = silent.output_scatter - between @ silent.input_scatter
        noise = np.sqrt((np.abs(scatter) ** 2).sum(axis=1).mean(axis=(0, -1)) / silent.scatter_freedom)
    error = interpolation_error(lines, response, silent.lines)
    power = (np.abs(silent.inputs) ** 2).mean(axis=(0, -1))
    by_error = np.sqrt(np.einsum("foi,fi->fo", error**2, power))
    return SilentLevels(level, None if noise is None else np.asarray(noise), np.asarray(by_error))


def interpolate_response(lines: Lines, response: ComplexArray, wanted: Lines) -> ComplexArray:
    """Response at lines, or frequencies, in between (n_wanted, n_out, n_in), see `silent_levels`.

    The ends are held outside.
    """
    if not len(wanted) or len(lines) < 2:
        return np.broadcast_to(response[:1], (len(wanted), *response.shape[1:])).copy()
    inside = np.log(np.clip(wanted, lines[0], lines[-1]))
    # Monotone cubics of real and imaginary part: no overshoot beside a resonance.
    parts = PchipInterpolator(np.log(lines), np.stack([response.real, response.imag], axis=-1))(inside)
    return np.asarray(parts[..., 0] + 1j * parts[..., 1])


def multiple_coherence(outputs: ComplexArray, covariance: ComplexArray | None) -> FloatArray:
    """Share (n_freq, n_out) of each output's power that the response explains; NaN without a covariance.

    Args:
        outputs (n_real, n_freq, n_out, n_exp): Output spectra.
        covariance (n_freq, n_out, n_out): Covariance of the output residual `Y - G U`, corrected for the freedom
            that the estimate took: total, or of the noise where a single realization leaves no residual; or None.
    """
    power = (np.abs(outputs) ** 2).mean(axis=(0, -1))
    if covariance is None:
        return np.full(power.shape, np.nan)
    lost = np.real(np.diagonal(covariance, axis1=-2, axis2=-1))
    return np.asarray(np.clip(1 - lost / np.maximum(power, np.finfo(float).tiny), 0, 1))


def explained_coherence(response: ComplexArray, inputs: ComplexArray, covariance: ComplexArray) -> FloatArray:
    """Multiple coherence (n_freq, n_out) of a local model: what the response makes of inputs, over it and residual.

    The outputs themselves hold the transient too, which is neither, and may be far larger than both.

    Args:
        response (n_freq, n_out, n_in): Response.
        inputs (n_freq, n_exp, width, n_in): Input spectra at the bins around each line.
        covariance (n_freq, n_out, n_out): Covariance of one experiment's output residual.
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
        # Every second line is left out in turn and guessed from the others, twice as far apart as the lines are.
        kept = np.union1d(np.arange(first, len(lines), 2), [0, len(lines) - 1])
        left = np.setdiff1d(np.arange(len(lines)), kept)
        guess = interpolate_response(lines[kept], response[kept], lines[left])
        error[left] = np.abs(guess - response[left])
    right = np.clip(np.searchsorted(lines, wanted), 1, len(lines) - 1)
    return np.asarray(np.maximum(error[right - 1], error[right]))


def _rms(spectra: ComplexArray) -> FloatArray:
    return np.asarray(np.sqrt((np.abs(spectra) ** 2).mean(axis=(0, -1))))


FEWEST = 4  # Lines that must tell of some input, unless there are fewer
_AROUND = 11  # Lines around each one whose median is the usual size of its response; at least a fifth of all of them
_SHOWN = 8
# Fields of an `Frf` that have a frequency axis, and which it is.
_BY_LINE = {
    "response": 1,
    "uncompensated_response": 1,
    "input_factor": 1,
    "total_covariance": 1,
    "noise_covariance": 1,
    "coherence": 1,
    "realization_error": 2,
    "sensitivity": 2,
}


def weak_inputs(response: ComplexArray, variance: FloatArray, limit: float) -> BoolArray:
    """Finds inputs (n_freq, n_in) of which a line tells too little: even their best response is not known to its size.

    The usual size is that of the lines around, so that an antiresonance, where little comes of much, tells all the
    same. Where no variance is known nothing is weak.

    Args:
        response (n_freq, n_out, n_in): Response.
        variance (n_freq, n_out, n_in): Its variance.
        limit: Standard deviation over the usual size from which a response counts as unknown.
    """
    # Odd, so that the median is centred.
    width = max(_AROUND, len(response) // 5) | 1
    size = median_filter(np.abs(response), (width, 1, 1), mode="nearest")
    ratio = np.divide(np.sqrt(variance), size, out=np.full(size.shape, np.inf), where=size > 0)
    return np.asarray((ratio.min(axis=1) > limit) & variance.any(axis=(0, 1)))


def require_lines(told: BoolArray, frequency_hz: FloatArray, limit: float, where: str) -> None:
    """Refuses a response of which too few lines tell of any input.

    Args:
        told (n_freq, n_in): Whether each line tells enough of each input.
        frequency_hz (n_freq,): The lines.
        limit: As in `weak_inputs`.
        where: Place of the record.

    Raises:
        DataError: If too little is left.
    """
    needed, left = min(FEWEST, len(told)), int(told.sum(axis=0).max(initial=0))
    if left >= needed:
        return
    low, high = frequency_hz[[0, -1]]
    what = (
        f"D016 {left} of {len(told)} lines from {low:.3g} to {high:.3g} Hz tell enough of an input (a standard "
        "deviation"
        f" below {100 * limit:.0f} % of its response); {needed} are needed"
    )
    remedy = "excite more, record longer or more periods, or correct the lines or the band"
    raise DataError(what, where=where, remedy=remedy)


def completed(
    frf: Frf, dropped: BoolArray, lines: IntArray, frequency_hz: FloatArray, amplitude: ComplexArray, reach: int
) -> Frf:
    """Returns the response of one configuration at all of its lines, of which some tell too little.

    Args:
        frf: The response at the lines that could be estimated.
        dropped (n_freq, n_in): Inputs of which each line tells too little; all inputs where it was not estimated.
        lines (n_freq,): All lines.
        frequency_hz (n_freq,): Their frequencies [Hz].
        amplitude (n_freq, n_in, n_block): What the inputs are at all lines.
        reach: Next lines whose error may be correlated with a line's, of all lines.
    """
    at = np.searchsorted(lines, frf.lines)
    nearest = np.abs(lines[:, None] - frf.lines).argmin(axis=1)
    spread: dict[str, Any] = {name: getattr(frf, name) for name in _BY_LINE}
    held: dict[str, Any] = {
        name: None if value is None else value.take(nearest, _BY_LINE[name]) for name, value in spread.items()
    }
    held["response"] = _bridged(held["response"][0], dropped, lines)[None]
    if held["coherence"] is not None:
        held["coherence"][:, np.setdiff1d(np.arange(len(lines)), at)] = np.nan
    return replace(
        frf,
        **held,
        lines=lines,
        frequency_hz=frequency_hz,
        input_amplitude=amplitude[None],
        line_correlation=_spread(frf.line_correlation, at, len(lines), reach),
        dropped=dropped[None],
    )


def _bridged(response: ComplexArray, dropped: BoolArray, lines: IntArray) -> ComplexArray:
    """The response (n_freq, n_out, n_in), interpolated where an input is dropped."""
    whole = response.copy()
    for motor, lost in enumerate(dropped.T):
        kept = ~lost
        if lost.any() and kept.any():
            column = response[kept][:, :, motor : motor + 1]
            whole[lost, :, motor] = interpolate_response(lines[kept], column, lines[lost])[..., 0]
    return whole


def _spread(correlation: FloatArray | None, at: IntArray, n_freq: int, reach: int) -> FloatArray | None:
    """The correlation (1, n_freq, n_next) of lines with the next ones, among which are dropped ones."""
    if not reach or len(at) == n_freq:
        return correlation
    whole = np.zeros((1, n_freq, reach))
    for ahead in range(0 if correlation is None else min(correlation.shape[2], len(at) - 1)):
        here, there = at[: -ahead - 1], at[ahead + 1 :]
        near = there - here <= reach
        whole[0, here[near], (there - here - 1)[near]] = np.asarray(correlation)[0, : len(here), ahead][near]
    return whole


def lost_inputs(dropped: BoolArray, frequency_hz: FloatArray, names: tuple[str, ...]) -> str:
    """Says at which lines which inputs told too little, and how many of them.

    Args:
        dropped (n_freq, n_in): Inputs of which each line tells too little.
        frequency_hz (n_freq,): The lines [Hz].
        names: The inputs.
    """
    return f"too little is known of {_places(dropped, frequency_hz, names)}"


def hidden_inputs(
    hidden: BoolArray, frequency_hz: FloatArray, names: tuple[str, ...], needed_s: float | None
) -> tuple[str, str]:
    """Says which inputs act so near to an end of the log that their response looks like its transient, and a remedy.

    Args:
        hidden (n_freq, n_in): Inputs of which that is so.
        frequency_hz (n_freq,): The lines [Hz].
        names: The inputs.
        needed_s: Time to the log's ends from which they can be told apart; None of a signal with periods [s].
    """
    what = (
        f"D231 what {_places(hidden, frequency_hz, names)} does lies so near to the beginning or the end of the log "
        "that its"
        " response cannot be distinguished from the transient there"
    )
    if needed_s is None:
        settled = "leave out `estimator: local`, which a settled signal with periods does not need"
        return what, f"{settled}, or set `local_half_width_lines` larger"
    remedy = (
        f"begin the log {needed_s:.2g} s before the input moves and let it go on as long after it, lower the band's"
        " upper end (of a sweep), or state a coarser `resolution_hz`"
    )
    return what, remedy


def _places(chosen: BoolArray, frequency_hz: FloatArray, names: tuple[str, ...]) -> str:
    """Lists the lines of each input."""
    told = []
    for name, lost in zip(names, chosen.T, strict=True):
        if lost.any():
            shown = ", ".join(f"{value:.4g}" for value in frequency_hz[lost][:_SHOWN])
            more = ", ..." if lost.sum() > _SHOWN else ""
            told.append(f"{name} at {int(lost.sum())} of {len(lost)} lines ({shown}{more} Hz)")
    return "; ".join(told)
