"""What was said of the period of a log, and how a message says settings."""

from __future__ import annotations

from collections.abc import Mapping
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
        differs: Whether other logs that are read by the same settings have other clocks.
    """

    sampling_period_s: float
    samples: int
    periods: int
    dropped: int
    lines: IntArray
    find: bool = False
    listed: bool = False
    differs: bool = False

    @property
    def period_s(self) -> float:
        """The period [s]."""
        return self.samples * self.sampling_period_s


def set_all(settings: Mapping[str, str]) -> str:
    """Writes settings as a sentence: `Set a to 1, b to 2 and c to 3.`."""
    texts = [f"{name} to {value}" for name, value in settings.items()]
    return f"Set {', '.join(texts[:-1])} and {texts[-1]}." if len(texts) > 1 else f"Set {texts[0]}."
