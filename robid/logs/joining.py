"""Joins the records of single experiments and shots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.signals.record import Record


def join_shots(records: list[Record], n_experiment: int = 1) -> Record:
    """Joins repeated shots, realization by realization, cut to the shortest, which is noted."""
    lengths = {record.inputs.shape[4] for record in records}
    shortest = min(lengths)
    cut = [
        replace(
            record,
            inputs=record.inputs[..., :shortest, :],
            outputs=record.outputs[..., :shortest, :],
            reference=None if record.reference is None else record.reference[..., :shortest, :],
        )
        for record in records
    ]
    joined = join_experiments(cut, n_experiment)
    told = f"The shots have {shortest} to {max(lengths)} samples; all were cut to the shortest."
    return joined if len(lengths) == 1 else replace(joined, notes=(*joined.notes, told))


def join_experiments(records: list[Record], n_experiment: int) -> Record:
    """Joins records of single experiments in one configuration.

    Args:
        records: One record of each experiment, realization by realization.
        n_experiment: Experiments in a realization.

    Returns:
        The record (1, n_real, n_exp, ...), its angles relative to the first experiment's offset.
    """
    first = records[0]
    if len(records) == 1:
        return first

    def joined(parts: list[FloatArray]) -> FloatArray:
        return np.stack(parts).reshape(1, -1, n_experiment, *parts[0].shape[3:])

    offset = first.output_offset
    return replace(
        first,
        inputs=joined([record.inputs for record in records]),
        outputs=joined([record.outputs + (record.output_offset - offset) for record in records]),
        reference=None
        if first.reference is None
        else joined([r.reference for r in records if r.reference is not None]),
        notes=tuple(dict.fromkeys(note for record in records for note in record.notes)),
    )
