"""What a reader of a response asks of its channels."""

from __future__ import annotations

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.signals.quantities import Wanted, describe


def require(frf: Frf, inputs: Wanted, outputs: Wanted, reader: str) -> None:
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
