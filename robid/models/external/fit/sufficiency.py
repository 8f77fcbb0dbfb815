"""What shots must have to be fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from robid.errors import DataError

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot
    from robid.models.external.fit.problem import Structure

_SAMPLES_PER_PARAMETER = 5
_STILL = 1e-12  # of the largest value, a motion that is none


def check_block(shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure) -> None:
    """Refuses shots that cannot tell a block of that structure.

    Raises:
        ValueError: If the structure is none.
        DataError: If nothing moves, or the record is too short.
    """
    if not 0 <= structure.zeros < structure.poles:
        message = f"there must be fewer zeros than poles, not {structure.zeros} zeros and {structure.poles} poles"
        raise ValueError(message)
    if not shots:
        raise DataError("there is no shot to fit", where="record", remedy="name a campaign with these channels")
    for kind, columns in (("input", inputs), ("output", outputs)):
        for column in columns:
            signals = [(shot.inputs if kind == "input" else shot.outputs)[:, column] for shot in shots]
            if not all(np.isfinite(each).all() for each in signals):
                message = f"{kind} {column} has samples that are no numbers"
                raise DataError(message, where=shots[0].name, remedy="cut the record to what was measured")
            if all(np.ptp(each) <= _STILL * np.abs(each).max(initial=0.0) for each in signals):
                message = f"{kind} {column} does not move in any shot"
                raise DataError(message, where=shots[0].name, remedy="excite it, or leave the channel out")
    n_sample = sum(len(shot.outputs) for shot in shots)
    n_free = structure.poles + len(inputs) * (structure.zeros + 1)
    n_free += structure.poles * sum(shot.start == "free" for shot in shots)
    if n_sample < _SAMPLES_PER_PARAMETER * n_free:
        message = f"{n_sample} samples are too few for {structure.poles} poles and {structure.zeros} zeros"
        raise DataError(message, where=shots[0].name, remedy="record longer, or ask for fewer poles")
    shortest = min(len(shot.outputs) for shot in shots)
    if structure.delay_samples + structure.moving_average >= shortest:
        message = f"a delay of {structure.delay_samples} samples leaves nothing of a shot of {shortest}"
        raise DataError(message, where=shots[0].name, remedy="record longer, or lower `max_delay_samples`")
    _check_excitation(shots, inputs, outputs, structure)


def _check_excitation(
    shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure
) -> None:
    """Refuses commands with fewer lines than the structure has parameters to tell from them."""
    for column in inputs:
        lines = 0
        for shot in shots:
            power = np.abs(np.fft.rfft(shot.inputs[:, column])) ** 2
            lines += int(np.sum(power > 1e-6 * power.max(initial=np.finfo(float).tiny)))
        needed = -(-(structure.zeros + 1 + -(-structure.poles // len(outputs))) // 2)
        if lines < needed:
            message = f"input {column} excites {lines} frequencies, of which {structure.poles} poles need {needed}"
            raise DataError(message, where=shots[0].name, remedy="excite more frequencies, or ask for fewer poles")
