"""What the channels of a response are, and what its readers ask of them."""

from __future__ import annotations

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
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
        f"{reader} needs responses from {inputs} to {outputs}; this one is from {describe(frf.input_channels)} to"
        f" {describe(frf.output_channels)}"
    )
    remedy = (
        "name another campaign in `from`; where the channels are described wrongly, correct their `unit`, `quantity`"
        " and `side` under `acquire`, or `estimate.outputs`, and estimate again"
    )
    raise DataError(what, remedy=remedy)
