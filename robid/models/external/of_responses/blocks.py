"""Blocks of channels with common poles, and the response of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.response.data import MeasuredResponse


@dataclass(frozen=True)
class Block:
    """Channels with common poles: every output by every input."""

    name: str
    outputs: tuple[int, ...]
    inputs: tuple[int, ...]

    def channels(self) -> Iterator[tuple[int, int]]:
        """Outputs and inputs, inputs fastest."""
        return ((out, one) for out in self.outputs for one in self.inputs)


def blocks_of(frf: Frf, options: ExternalOptions) -> list[Block]:
    """The blocks that the options ask for.

    Raises:
        DataError: If a pair is not in the response, or no channel is.
    """
    outputs, inputs = frf.output_names, frf.input_names
    if options.matrix == "full":
        return [Block("matrix", tuple(range(len(outputs))), tuple(range(len(inputs))))]
    pairs = options.pairs or tuple((name, name) for name in inputs if name in outputs)
    if not pairs and len(outputs) == len(inputs) == 1:
        pairs = ((inputs[0], outputs[0]),)
    missing = [f"{out} per {one}" for one, out in pairs if one not in inputs or out not in outputs]
    if missing or not pairs:
        there = f"inputs {', '.join(inputs)}; outputs {', '.join(outputs)}"
        lacking = missing[0] if missing else "output with the name of an input"
        remedy = "name `pairs` of input and output, or `matrix: full`"
        raise DataError(f"D637 the response has no {lacking} ({there})", where="pairs", remedy=remedy)
    return [
        Block(one if one == out else f"{out} by {one}", (outputs.index(out),), (inputs.index(one),))
        for one, out in pairs
    ]


def measured_of(frf: Frf, block: Block, period: float | None) -> MeasuredResponse:
    """The response of a block, unknown where a line tells too little of an input."""
    variance = frf.element_variance()[0]
    chosen = np.ix_(np.arange(frf.frequency_hz.size), np.array(block.outputs), np.array(block.inputs))
    known = np.isfinite(variance) & (variance > 0)
    return MeasuredResponse(
        frf.frequency_hz,
        frf.response[0][chosen],
        np.where(known, variance, np.inf)[chosen],
        period,
        "none" if period is None else "zoh",
    )
