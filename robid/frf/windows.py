"""Windows of neighbouring bins or lines that local models are fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.options import EstimateOptions


@dataclass(frozen=True)
class Windows:
    """Neighbouring bins that each line's model is fitted to.

    Attributes:
        index (n_freq, width): Position of each bin among the blocks' lines.
        offset (n_freq, width): Distance from the line, at most 1.
        lines (n_freq,): Position of the lines themselves.
    """

    index: IntArray
    offset: FloatArray
    lines: IntArray

    def at(self, chosen: BoolArray) -> Windows:
        """Returns the windows around some of the lines."""
        return Windows(self.index[chosen], self.offset[chosen], self.lines[chosen])

    @property
    def reach(self) -> int:
        """Largest number of lines from one to another whose windows share a bin."""
        first, width = self.index[:, 0], self.index.shape[1]
        return int((np.searchsorted(first, first + width) - np.arange(len(first)) - 1).max(initial=0))

    def rows(self, spectra: ComplexArray) -> ComplexArray:
        """Reorders block spectra (n_real, n_bin, n_channel, n_exp) to (n_freq, n_real n_exp, width, n_channel)."""
        around = spectra[:, self.index].transpose(1, 0, 4, 2, 3)
        return around.reshape(len(self.lines), -1, *around.shape[3:])

    def joined(self, spectra: ComplexArray) -> ComplexArray:
        """Reorders several block spectra (n, n_real, n_bin, n_channel, n_exp) to (n, 1, n_freq, n_channel, n_row)."""
        n_freq, n_channel = len(self.lines), spectra.shape[3]
        joined = np.empty(
            (len(spectra), n_freq, self.index.shape[1] * spectra.shape[1] * spectra.shape[4], n_channel), complex
        )
        for target, each in zip(joined, spectra, strict=True):
            target[:] = self.rows(each).reshape(n_freq, -1, n_channel)
        return np.swapaxes(joined, 2, 3)[:, None]


def half_width(options: EstimateOptions, n_exp: int, n_in: int, n_out: int, segments: int = 0) -> int:
    """Returns the bins on each side: as set, else the fewest that leave enough freedom.

    Enough is as much as there are outputs for `local`, whose bias falls with the width, and as much as there are
    coefficients for `local_periodic`, which also has to average the noise.

    Args:
        options: Orders of the local model.
        n_exp: Experiments of all realizations.
        n_in: Inputs.
        n_out: Outputs.
        segments: Bins of one resolution of an arbitrary signal, all of which count; 0 for any other.

    Raises:
        DataError: If the width that was set leaves no freedom.
    """
    short = options.estimator == "local"
    own = (options.local_order + 1) * short
    common = (options.local_order + 1) * n_in + options.local_denominator
    needed = own + (common + (n_out if short else max(n_out, common))) / n_exp
    # The polynomials themselves need a bin per coefficient.
    needed = max(needed, own + 1, options.local_order + 1 + options.local_denominator)
    fewest = int(np.ceil((needed - 1) / 2))
    if options.local_half_width_lines is None:
        return max(fewest, segments // 2)
    width = 2 * options.local_half_width_lines + 1
    if width < options.local_order + 1 or n_exp * (width - own) <= common:
        message = f"D029 {width} bins of {n_exp} experiments leave no freedom beside the local model's coefficients"
        raise DataError(message, remedy=f"set `local_half_width_lines` to {fewest} or more, or lower `local_order`")
    return options.local_half_width_lines


def bin_windows(lines: IntArray, half: int, highest: int) -> tuple[IntArray, Windows]:
    """Windows of neighbouring DFT bins around some of them.

    Args:
        lines (n_freq,): Bins at the centres.
        half: Bins on each side; near the band's ends the window shifts inwards.
        highest: First bin that is not available.

    Returns:
        The bins needed, rising, and the windows over them.

    Raises:
        DataError: If the windows do not fit.
    """
    _check_fit(highest - 1, half, "bins")
    window = np.clip(lines - half, 1, highest - 2 * half - 1)[:, None] + np.arange(2 * half + 1)
    bins = np.unique(window)
    return bins, _windows(bins, np.searchsorted(bins, window), np.searchsorted(bins, lines))


def line_windows(lines: IntArray, half: int) -> Windows:
    """Windows over neighbouring excited lines, shifted inwards at the ends of the band.

    Raises:
        DataError: If the windows do not fit.
    """
    _check_fit(lines.size, half, "excited lines")
    centre = np.arange(lines.size)
    first = np.clip(centre - half, 0, lines.size - 2 * half - 1)
    return _windows(lines, first[:, None] + np.arange(2 * half + 1), centre)


def _windows(bins: IntArray, index: IntArray, lines: IntArray) -> Windows:
    distance = (bins[index] - bins[lines][:, None]).astype(float)
    return Windows(index, distance / np.maximum(np.abs(distance).max(axis=1, keepdims=True), 1), lines)


def _check_fit(available: int, half: int, kind: str) -> None:
    if available < 2 * half + 1:
        message = f"D030 a local model needs {2 * half + 1} neighbouring {kind}, but there are {available}"
        raise DataError(message, remedy="excite more lines, record longer or more experiments, or lower `local_order`")
