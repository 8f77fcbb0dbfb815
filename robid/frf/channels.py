"""What the channels of a response are, and what its readers ask of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.frf.saturation import saturated_shares
from robid.signals.quantities import DRIVES, Channel, UsableChannels, describe
from robid.signals.record import Record


def response_channels(record: Record, options: EstimateOptions) -> tuple[Channel, ...]:
    """Returns what the outputs of a record's response are."""
    kept = not to_accelerations(record, options)
    return tuple(channel if kept else channel.acceleration for channel in record.output_channels)


def to_accelerations(record: Record, options: EstimateOptions) -> bool:
    """Whether motions become accelerations before the response is estimated."""
    if options.outputs == "auto":
        return all(channel.quantity in DRIVES for channel in record.input_channels)
    return options.outputs == "acceleration"


def require(frf: Frf, inputs: UsableChannels, outputs: UsableChannels, reader: str) -> None:
    """Refuses a response whose channels are not what its reader can use.

    Args:
        frf: The response.
        inputs: What its inputs must be.
        outputs: What its outputs must be.
        reader: Who reads it, as the subject of a sentence.

    Raises:
        DataError: If they are something else, saying what is wanted and what is there.
    """
    if inputs.accepts(frf.input_channels) and outputs.accepts(frf.output_channels):
        return
    what = (
        f"D014 {reader} needs responses from {inputs} to {outputs}; this one is from {describe(frf.input_channels)} to"
        f" {describe(frf.output_channels)}"
    )
    remedy = (
        "name another campaign in `from`; where the channels are described wrongly, correct their `unit`, `quantity`"
        " and `side` under `acquire`, or `estimate.outputs`, and estimate again"
    )
    raise DataError(what, remedy=remedy)


def channel_levels(record: Record) -> dict[str, Any]:
    """Returns means of inputs and outputs, how far the outputs move about theirs, and how long each is at a limit.

    Args:
        record: Record of a single configuration; the configuration axis is kept.
    """
    n_sample, offset = record.outputs[0, ..., 0].size, record.output_offset
    mean = record.outputs.mean(axis=(1, 2, 3, 4))
    # Without a copy of the samples, of which there may be many.
    square = np.einsum("crepno,crepno->co", record.outputs, record.outputs) / n_sample
    inputs, outputs = saturated_shares(record)
    return {
        "mean_input": record.inputs.mean(axis=(1, 2, 3, 4)),
        "mean_output": mean + offset,
        "motion_rms": np.sqrt(np.maximum(square - mean**2, 0.0)),
        "saturated_inputs": inputs[None],
        "saturated_outputs": outputs[None],
    }
