"""Whether the experiments of each block tell the motors apart."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.blocks import NEEDS_REFERENCE, NEEDS_SQUARE_BLOCKS
from robid.frf.spectra import Blocks
from robid.signals.positions import shown
from robid.signals.record import Record

_CONDITION_LIMIT = 1e6


def check_blocks(record: Record, blocks: Blocks, estimator: str) -> None:
    """Refuses blocks whose experiments do not excite every input, in the torque or in the reference that is needed.

    Args:
        record: The record that they are from.
        blocks: Its spectra at the excited lines.
        estimator: The estimator that averages them.

    Raises:
        DataError: If they do not, with the worst frequency.
    """
    n_real, _, n_in, n_exp = blocks.inputs.shape
    square = estimator in NEEDS_SQUARE_BLOCKS
    if n_exp != n_in if square else n_real * n_exp < n_in:
        message = f"{n_exp} experiments per block cannot separate {n_in} inputs"
        remedy = "record as many experiments per realization as there are motors, or use the estimator `local_periodic`"
        raise DataError(message, where=place_of(record), remedy=remedy)
    condition = _condition(blocks.inputs, square=square)
    worst = int(np.argmax(condition))
    if condition[worst] > _CONDITION_LIMIT:
        frequency = record.frequency_hz[worst]
        message = f"the experiments do not excite every motor at {frequency:.3g} Hz (condition {condition[worst]:.1e})"
        remedy = "excite all motors, or check that the lines are those played"
        raise DataError(message, where=place_of(record), remedy=remedy)
    if estimator in NEEDS_REFERENCE:
        _check_reference(record, blocks, estimator)


def _check_reference(record: Record, blocks: Blocks, estimator: str) -> None:
    if blocks.reference is None:
        remedy = "choose `logarithmic`, or import what was injected with the log"
        raise DataError(
            f"estimator `{estimator}` needs the reference, which the record lacks",
            where=place_of(record),
            remedy=remedy,
        )
    lost = ~(_condition(blocks.reference, square=estimator in NEEDS_SQUARE_BLOCKS) < _CONDITION_LIMIT)
    if lost.any():
        frequency = record.frequency_hz[int(np.argmax(lost))]
        message = f"estimator `{estimator}`: the reference does not excite every motor at {frequency:.3g} Hz"
        raise DataError(message, where=place_of(record), remedy="choose `logarithmic`, or check the imported reference")


def _condition(inputs: ComplexArray, *, square: bool) -> FloatArray:
    """Condition (n_freq,) of the worst of the blocks (n_real, n_freq, n_in, n_exp), or of all of them together."""
    if square:
        return np.asarray(np.linalg.cond(inputs, 1).max(axis=0))
    power = (inputs @ np.swapaxes(inputs, -1, -2).conj()).sum(axis=0)
    return np.asarray(np.sqrt(np.linalg.cond(power, 1)))


def place_of(record: Record) -> str:
    """Says which configuration a record is of."""
    configuration = record.require_periods("A frequency response")[0]
    return f"configuration at {shown(configuration, record.joint_units)}"
