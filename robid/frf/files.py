"""What files of responses that were measured elsewhere hold, as the check of them found it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robid.arrays import FloatArray, IntArray, Quantity


@dataclass(frozen=True)
class ResponseFiles:
    """Files of a campaign's responses."""

    names: Annotated[tuple[str, ...], Quantity("1", "file", "Paths as written")]
    sha256: Annotated[tuple[str, ...], Quantity("1", "file", "Hash of each file's content")]
    size_bytes: Annotated[IntArray, Quantity("1", "file", "Size of each file")]
    configurations: Annotated[FloatArray, Quantity("rad; m", "configuration joint", "Arm-side joints")]
    n_line: int  # Lines of each response
    lowest_hz: float  # The lowest one [Hz]
    highest_hz: float  # The highest one [Hz]
    covariance: str  # Where the error of the responses comes from: `stated`, `coherence`, `neighbours`
    notes: Annotated[tuple[str, ...], Quantity("1", "note", "What the reader is to know")] = ()
