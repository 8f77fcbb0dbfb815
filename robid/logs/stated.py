"""What was said of the period of a log."""

from __future__ import annotations

from dataclasses import dataclass

from robid.arrays import IntArray


@dataclass(frozen=True)
class Stated:
    """What was said of the period.

    Attributes:
        sampling_period_s: Sampling period of the log [s].
        samples: Samples of one period.
        periods: Periods that are used.
        dropped: Periods that are dropped before.
        lines (n_freq,): Lines that are excited.
        find: Whether they are only those among which the excited ones are looked for.
        listed: Whether the lines were listed one by one, so that neither a count nor a band says them.
    """

    sampling_period_s: float
    samples: int
    periods: int
    dropped: int
    lines: IntArray
    find: bool = False
    listed: bool = False

    @property
    def period_s(self) -> float:
        """The period [s]."""
        return self.samples * self.sampling_period_s
