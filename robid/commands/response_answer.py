"""What `inspect` says of a file of frequency responses, for programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robid.arrays import Meaning
from robid.commands.output import Answer


@dataclass(frozen=True)
class ResponseAnswer(Answer, type="inspect-response"):
    """What is in a file of frequency responses, and how to read it."""

    file: Annotated[str, Meaning("The file.")]
    format: Annotated[str, Meaning("Its format.")]
    configurations: Annotated[int, Meaning("Responses of how many configurations are in it.")]
    inputs: Annotated[tuple[str, ...], Meaning("Names of the inputs in the file.")]
    outputs: Annotated[tuple[str, ...], Meaning("Names of the outputs in the file.")]
    lines: Annotated[int, Meaning("Lines of each response.")]
    lowest_hz: Annotated[float, Meaning("The lowest one [Hz].")]
    highest_hz: Annotated[float, Meaning("The highest one [Hz].")]
    error: Annotated[str, Meaning("What tells the error: `deviation`, `coherence` or `neighbours`.")]
    sampling_period_s: Annotated[float | None, Meaning("Sampling period that it states; null without one [s].")]
    proposal: Annotated[str, Meaning("The proposed experiment file.")]
