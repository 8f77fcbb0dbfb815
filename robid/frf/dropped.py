"""Lines that tell too little of an input: which they are, and what stands in their place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.distortion import interpolate_response
from robid.frf.frf import Frf

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
    """Finds inputs of which a line tells too little: even their best known response is not known to its usual size.

    The usual size is that of the lines around, so that an antiresonance, where little comes of much, tells all the
    same. Where no variance is known nothing is weak.

    Args:
        response (n_freq, n_out, n_in): Response.
        variance (n_freq, n_out, n_in): Its variance.
        limit: Standard deviation over the usual size from which a response counts as unknown.

    Returns:
        (n_freq, n_in).
    """
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
        f"{left} of {len(told)} lines from {low:.3g} to {high:.3g} Hz tell enough of an input (a standard deviation"
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
    return f"too little was told of {_places(dropped, frequency_hz, names)}"


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
        f"what {_places(hidden, frequency_hz, names)} does lies so near to the beginning or the end of the log that its"
        " response cannot be told from the transient there"
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
