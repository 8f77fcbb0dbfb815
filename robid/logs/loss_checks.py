"""Says where a log without time stamps lost samples, and which settings use only what lies before, between or after."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.losses import Loss, find_losses
from robid.logs.period import measure_repetition
from robid.logs.stated import Stated
from robid.logs.timing import Clock

_BESIDE = 32
"""Part of a period by which a gap of the time and a loss may be apart and be one."""


@dataclass(frozen=True)
class Part:
    """Which part of a log is looked at.

    Attributes:
        start: Its first sample in the log.
        last: Whether the last periods are used, not the first ones after those dropped.
        matched: Whether the periods are counted from there on, as they matched what was played.
    """

    start: int = 0
    last: bool = False
    matched: bool = False

    def used(self, length: int, stated: Stated) -> tuple[int, int]:
        """First sample of the log that is used of a part of some length, and the one after the last."""
        wanted = stated.periods * stated.samples
        if self.last:
            return max(self.start + length - wanted, 0), self.start + length
        first = (self.start if self.matched else 0) + stated.dropped * stated.samples
        return first, first + wanted


def part_losses(steady: FloatArray, stated: Stated, part: Part) -> tuple[list[Loss], FloatArray]:
    """Losses of samples that touch what is used, by samples of the log; else the channel up to the first beside it.

    Args:
        steady (n_sample,): An excited channel.
        stated: What was said of its period.
        part: Which part of the log it is.
    """
    found = measure_repetition(steady, stated.samples, stated.lines)
    measured = None if found.samples is None else found.samples * found.multiple(stated.samples)
    losses = [
        Loss(part.start + one.after, one.samples) for one in find_losses(steady, stated.samples, stated.lines, measured)
    ]
    first, stop = part.used(len(steady), stated)
    inside = [one for one in losses if first <= one.after < stop - 1]
    if inside or not losses:
        return losses if inside else [], steady
    end = min((one.after + 1 for one in losses if one.after >= stop - 1), default=part.start + len(steady))
    return [], steady[max(first - part.start, 0) : end - part.start]


def lost_samples(
    where: str, losses: list[Loss], length: int, stated: Stated, part: Part, clock: Clock | None
) -> list[DataError]:
    """Names the samples after which some are lost, unless the log's own time names them anyhow."""
    first, stop = part.used(length, stated)
    inside = [one for one in losses if first <= one.after < stop - 1]
    gaps = [] if clock is None else [gap for gap in clock.gaps.tolist() if (gap + 1 - first) % stated.samples]
    inside = [one for one in inside if not any(abs(gap - one.after) * _BESIDE < stated.samples for gap in gaps)]
    if not inside:
        return []
    told = ", ".join(f"{_counted(one.samples)} after about sample {one.after}" for one in inside)
    what = f"Its periods are whole, but move apart on the way, as no other clock makes them: {told}."
    return [
        DataError(what, where=f"{where}, about sample {inside[0].after}", remedy=_remedy(losses, length, stated, part))
    ]


def _counted(samples: int) -> str:
    noun, many = ("sample", abs(samples)) if abs(samples) == 1 else ("samples", abs(samples))
    return f"{many} {noun} {'missing' if samples > 0 else 'too many'}"


def _remedy(losses: list[Loss], length: int, stated: Stated, part: Part) -> str:
    """Settings that use the longest part without a loss."""
    size, total = stated.samples, part.start + length
    origin = part.start if part.matched else 0
    edges = [origin, *(one.after + 1 for one in losses), total]
    choices: list[tuple[int, str]] = []
    for begin, end in pairwise(edges):
        dropped = max(-(-(begin - origin) // size), stated.dropped)
        periods = (end - origin) // size - dropped
        settings = [*(["take to first"] if part.last else [])]
        settings += [f"drop_periods to {dropped}"] if dropped != stated.dropped else []
        choices.append((periods, _sentence([*settings, f"periods to {periods}"])))
    # Counted from the end, what follows the last loss may hold one more.
    periods = min((total - edges[-2]) // size, total // size - stated.dropped)
    if not part.matched:
        choices.append((periods, _sentence([*([] if part.last else ["take to last"]), f"periods to {periods}"])))
    most, settings_told = max(choices, key=lambda choice: choice[0])
    if most < 1:
        return "Record again: no whole period lies between the losses."
    return f"{settings_told}: the longest part without a loss. Do not resample: that would spread the loss."


def _sentence(settings: list[str]) -> str:
    return f"Set {', '.join(settings[:-1])} and {settings[-1]}" if len(settings) > 1 else f"Set {settings[0]}"
