"""What an estimator reads of a record: spectra at its lines, less the removed torque, and windows over lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robid.arrays import BoolArray, ComplexArray, IntArray
from robid.errors import DataError
from robid.frf.block_checks import place_of
from robid.frf.blocks import NEEDS_REFERENCE
from robid.frf.channels import to_accelerations
from robid.frf.compensation import Disturbance, disturbance, no_disturbance, record_motion
from robid.frf.distortion import silent_lines
from robid.frf.local import LOCAL
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks, record_blocks
from robid.frf.transient import robust_blocks
from robid.frf.windows import Windows, bin_windows, half_width, line_windows
from robid.robot.friction import TorqueLaw
from robid.signals.record import Record

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
    silent = _without(blocks, removed).select(np.arange(n_freq, len(lines)))
    blocks, removed, windows = blocks.select(np.arange(n_freq)), removed.select(np.arange(n_freq)), None
    if options.estimator == "robust_local":
        blocks = robust_blocks(record, record.excited_lines, options, accelerations=accelerations)
    if options.estimator in LOCAL:
        n_in, n_out = len(record.input_names), len(record.output_names)
        half = half_width(options, record.inputs.shape[1] * record.inputs.shape[2], n_in, n_out, record.segments)
        if options.estimator == "local_periodic":
            windows = line_windows(record.excited_lines, half)
        else:
            source = record.as_one_period()
            lines, windows = bin_windows(source.excited_lines, half, source.inputs.shape[4] // 2)
            blocks = transform(source, lines)
            removed = _removed(source, lines, laws, delay_s)
    if not (np.isfinite(blocks.inputs).all() and np.isfinite(blocks.outputs).all()):
        message = "the record holds NaN or infinite samples"
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
