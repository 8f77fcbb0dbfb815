"""A signal of which only a band and a resolution are said: noise, a production trajectory, a hammer blow."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from robid.arrays import IntArray, option

FEWEST_LINES = 4  # Frequencies of a band below which there is no response to speak of


@dataclass(frozen=True, kw_only=True)
class ArbitraryOptions:
    """A signal of logs that need not repeat, and of which no line is known; the estimator `local` reads it."""

    signal: Literal["arbitrary"] = option("arbitrary", "A signal that need not repeat, in logs only.")
    low_hz: float = field(metadata={"description": "Lowest frequency of the response [Hz].", "gt": 0})
    high_hz: float = field(metadata={"description": "Highest frequency of the response [Hz].", "gt": 0})
    resolution_hz: float = field(
        metadata={
            "description": "Distance of the response's frequencies, and width of the band around each that is averaged"
            " [Hz].",
            "gt": 0,
        }
    )

    decides_lines: ClassVar[tuple[str, ...]] = ("signal", "low_hz", "high_hz", "resolution_hz")
    inject: ClassVar[Literal["speed_reference"]] = "speed_reference"
    seed: ClassVar[None] = None

    @property
    def period_s(self) -> float:
        """Length of the segments of a log that have this resolution [s]."""
        return 1 / self.resolution_hz

    def segment_samples(self, sampling_period_s: float) -> int:
        """Returns the samples of a segment, rounded."""
        return max(round(self.period_s / sampling_period_s), 1)

    def lines(self, sampling_period_s: float) -> IntArray:
        """Returns the lines of a segment that lie in the band."""
        segment_s = self.segment_samples(sampling_period_s) * sampling_period_s
        lowest, highest = self.low_hz * segment_s, self.high_hz * segment_s
        return np.arange(max(int(np.ceil(lowest - 1e-6)), 1), int(np.floor(highest + 1e-6)) + 1)

    def problems(self, sampling_period_s: float) -> list[str]:
        """Finds what keeps a log of this sampling period [s] from having such a response."""
        problems = []
        nyquist_hz = 0.5 / sampling_period_s
        if self.low_hz >= self.high_hz:
            problems.append(f"low_hz {self.low_hz:g} is not below high_hz {self.high_hz:g} (swap them)")
        elif len(self.lines(sampling_period_s)) < FEWEST_LINES:
            finer = (self.high_hz - self.low_hz) / FEWEST_LINES
            problems.append(
                f"the band {self.low_hz:g} to {self.high_hz:g} Hz has fewer than {FEWEST_LINES} frequencies"
                f" {self.resolution_hz:g} Hz apart (lower resolution_hz to {finer:.3g})"
            )
        if self.high_hz + self.resolution_hz > nyquist_hz:
            problems.append(
                f"high_hz {self.high_hz:g} is not a resolution below the Nyquist frequency {nyquist_hz:g} Hz"
                f" (lower high_hz)"
            )
        return problems
