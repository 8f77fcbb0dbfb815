"""Whether the experiments of each block tell the motors apart."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.blocks import NEEDS_REFERENCE, NEEDS_SQUARE_BLOCKS
from robid.frf.dropped import FEWEST
from robid.frf.spectra import Blocks
from robid.signals.quantities import shown
from robid.signals.record import Record

_CONDITION_LIMIT = 1e6
_NOTHING = 1e-12  # Power of a line, relative to the usual one, below which not even rounding is told from it


def solvable_lines(record: Record, blocks: Blocks, estimator: str) -> BoolArray:
    """Finds the lines (n_freq,) whose experiments excite every input, in the torque or in the reference if needed.

    Args:
        record: The record that they are from.
        blocks: Its spectra at the excited lines.
        estimator: The estimator that averages them.

    Raises:
        DataError: If there are too few experiments, or too few such lines, with the worst frequency.
    """
    n_real, _, n_in, n_exp = blocks.inputs.shape
    square = estimator in NEEDS_SQUARE_BLOCKS
    if n_exp != n_in if square else n_real * n_exp < n_in:
        message = f"{n_exp} experiments per block cannot separate {n_in} inputs"
        remedy = "record as many experiments per realization as there are motors, or use the estimator `local_periodic`"
        raise DataError(message, where=place_of(record), remedy=remedy)
    told = carrying_lines(blocks.inputs) & (_condition(blocks.inputs, square=square) < _CONDITION_LIMIT)
    remedy = "excite all motors, or check that the lines are those played"
    _require(record, told, "the experiments do not", remedy)
    if estimator not in NEEDS_REFERENCE:
        return told
    instrument = _reference(record, blocks, estimator)
    told &= _condition(instrument, square=square) < _CONDITION_LIMIT
    remedy = "choose `logarithmic`, or check the imported reference"
    _require(record, told, f"estimator `{estimator}`: the reference does not", remedy)
    return told


def carrying_lines(inputs: ComplexArray) -> BoolArray:
    """Finds the lines (n_freq,) at which every input (n_real, n_freq, n_in, n_exp) has some power at all."""
    power = (np.abs(inputs) ** 2).sum(axis=(0, 3))
    return np.asarray((power > _NOTHING * np.median(power, axis=0)).all(axis=1))


def _require(record: Record, told: BoolArray, who: str, remedy: str) -> None:
    """Refuses a record of which too few lines can be solved."""
    needed, left = min(FEWEST, len(told)), int(told.sum())
    if left >= needed:
        return
    frequency = record.frequency_hz[int(np.argmin(told))]
    message = (
        f"{who} excite every motor at {frequency:.3g} Hz: {left} of {len(told)} lines tell all of them apart, {needed}"
        " are needed"
    )
    raise DataError(message, where=place_of(record), remedy=remedy)


def _reference(record: Record, blocks: Blocks, estimator: str) -> ComplexArray:
    if blocks.reference is None:
        remedy = "choose `logarithmic`, or import what was injected with the log"
        raise DataError(
            f"estimator `{estimator}` needs the reference, which the record lacks",
            where=place_of(record),
            remedy=remedy,
        )
    return blocks.reference


def _condition(inputs: ComplexArray, *, square: bool) -> FloatArray:
    """Condition (n_freq,) of the worst of the blocks (n_real, n_freq, n_in, n_exp), or of all of them together."""
    if square:
        return np.asarray(np.nan_to_num(np.linalg.cond(inputs, 1).max(axis=0), nan=np.inf))
    power = (inputs @ np.swapaxes(inputs, -1, -2).conj()).sum(axis=0)
    return np.asarray(np.nan_to_num(np.sqrt(np.linalg.cond(power, 1)), nan=np.inf))


def place_of(record: Record) -> str:
    """Says which configuration a record is of."""
    configuration = record.require_periods("A frequency response")[0]
    return f"configuration at {shown(configuration, record.joint_units)}"
