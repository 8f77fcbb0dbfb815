"""What an estimator reads of a record: spectra less the removed torque, and windows of neighbouring bins or lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.blocks import NEEDS_REFERENCE, place_of
from robid.frf.channels import to_accelerations
from robid.frf.compensation import Disturbance, disturbance, no_disturbance, record_motion
from robid.frf.distortion import silent_lines
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks, record_blocks, robust_blocks
from robid.robot.friction import TorqueLaw
from robid.signals.record import Record


@dataclass(frozen=True)
class Windows:
    """Neighbouring bins that each line's model is fitted to."""

    index: IntArray  # (n_freq, width) Position of each bin among the blocks' lines
    offset: FloatArray  # (n_freq, width) Distance from the line, at most 1
    lines: IntArray  # (n_freq,) Position of the lines themselves

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
    # A transient polynomial takes its coefficients from each experiment, the response's from all together.
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


def _bin_windows(lines: IntArray, half: int, highest: int) -> tuple[IntArray, Windows]:
    """Windows of `half` neighbouring DFT bins on each side of some lines (n_freq,), and the bins needed, rising.

    They shift inwards near the band's ends; bins from `highest` on are not available.
    """
    _check_fit(highest - 1, half, "bins")
    # Windows shift inwards at the ends of the band; the line is then not in the middle.
    window = np.clip(lines - half, 1, highest - 2 * half - 1)[:, None] + np.arange(2 * half + 1)
    bins = np.unique(window)
    return bins, _windows(bins, np.searchsorted(bins, window), np.searchsorted(bins, lines))


def _line_windows(lines: IntArray, half: int) -> Windows:
    """Windows over neighbouring excited lines, shifted inwards at the ends of the band."""
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


LOCAL = ("local", "local_periodic")  # Estimators that fit the response over neighbouring bins or lines
READS_REFERENCE = frozenset({*NEEDS_REFERENCE, *LOCAL})  # Estimators that look at what was injected, if it was recorded


@dataclass(frozen=True)
class Spectra:
    """What an estimator reads: blocks without the removed torque, that torque, silent lines and windows over lines."""

    blocks: Blocks
    removed: Disturbance
    silent: Blocks
    windows: Windows | None = None

    @property
    def removed_torque(self) -> ComplexArray:
        """The removed torque at the lines (n_real, n_freq, n_in, n_exp)."""
        return self.removed.torque if self.windows is None else self.removed.torque[:, self.windows.lines]

    @property
    def at_lines(self) -> Blocks:
        """The blocks at the lines themselves."""
        return self.blocks if self.windows is None else self.blocks.select(self.windows.lines)

    def at(self, chosen: BoolArray) -> Spectra:
        """Returns what is read of some of the lines."""
        if self.windows is not None:
            return replace(self, windows=self.windows.at(chosen))
        index = np.flatnonzero(chosen)
        return replace(self, blocks=self.blocks.select(index), removed=self.removed.select(index))

    def around(self, spectrum: ComplexArray, record: Record) -> ComplexArray:
        """A spectrum (n_real, n_bin, n_channel, n_exp) at the lines; of an arbitrary signal its RMS in the windows."""
        if self.windows is None:
            return spectrum
        if not record.is_arbitrary:
            return spectrum[:, self.windows.lines]
        # An arbitrary signal has a random size at each bin: its power is that of the window.
        power = (np.abs(spectrum[:, self.windows.index]) ** 2).mean(axis=2)
        return np.asarray(np.exp(1j * np.angle(spectrum[:, self.windows.lines])) * np.sqrt(power))

    def amplitude(self, record: Record) -> ComplexArray:
        """Inputs at the lines (n_freq, n_in, n_block); of an arbitrary signal with the power of a whole resolution."""
        inputs = self.around(self.blocks.inputs, record) * np.sqrt(max(record.segments, 1))
        return np.concatenate(list(inputs), axis=-1)


def read_spectra(
    record: Record, options: EstimateOptions, laws: tuple[TorqueLaw, ...] | None, delay_s: float
) -> Spectra:
    """Transforms the record at the lines that the estimator reads and at the silent ones."""
    n_freq = len(record.excited_lines)
    lines = np.concatenate([record.excited_lines, silent_of(record)])
    accelerations = to_accelerations(record, options)
    transform = partial(record_blocks, with_reference=options.estimator in READS_REFERENCE, accelerations=accelerations)
    blocks = transform(record, lines)
    removed = _removed(record, lines, laws, delay_s)
    # Silent and excited lines are transformed together: the torque laws run over all samples once.
    silent = _without(blocks, removed).select(np.arange(n_freq, len(lines)))
    blocks, removed, windows = blocks.select(np.arange(n_freq)), removed.select(np.arange(n_freq)), None
    if options.estimator == "robust_local":
        blocks = robust_blocks(record, record.excited_lines, options, accelerations=accelerations)
    if options.estimator in LOCAL:
        n_in, n_out = len(record.input_names), len(record.output_names)
        half = half_width(options, record.inputs.shape[1] * record.inputs.shape[2], n_in, n_out, record.segments)
        if options.estimator == "local_periodic":
            windows = _line_windows(record.excited_lines, half)
        else:
            source = record.as_one_period()
            lines, windows = _bin_windows(source.excited_lines, half, source.inputs.shape[4] // 2)
            blocks = transform(source, lines)
            removed = _removed(source, lines, laws, delay_s)
    if not (np.isfinite(blocks.inputs).all() and np.isfinite(blocks.outputs).all()):
        message = "D022 the record contains NaN or infinite samples"
        raise DataError(message, where=place_of(record), remedy="acquire the record again")
    return Spectra(_without(blocks, removed), removed, silent, windows)


def _removed(record: Record, lines: IntArray, laws: tuple[TorqueLaw, ...] | None, delay_s: float) -> Disturbance:
    """Torque of the laws along the motion at some lines, zero without laws."""
    return no_disturbance(record, lines) if laws is None else disturbance(record_motion(record, lines, delay_s), laws)


def _without(blocks: Blocks, removed: Disturbance) -> Blocks:
    return replace(blocks, inputs=blocks.inputs - removed.torque)


def silent_of(record: Record) -> IntArray:
    """Lines of the band that are not excited; an arbitrary signal leaves none."""
    return np.zeros(0, int) if record.is_arbitrary else silent_lines(record.excited_lines)
