"""What to propose as a log's mapping: its channels, what was played, and which part of it to use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robid.arrays import IntArray
from robid.logs.inspection.channels import Entry
from robid.logs.inspection.repetition import Shared
from robid.logs.lines import band_of, format_lines

_LISTED = 40
"""Lines that are listed one by one."""

_DENSE = 0.9
"""Share of a band's lines from which all of them are meant."""

_ARBITRARY = 0.02
"""Share of the band up to Nyquist from which a signal that does not repeat is more than a trajectory."""

_SEGMENTS = 20
"""Segments into which a signal that does not repeat is cut."""

_RESOLVED = 0.25
"""Share of the frequency that halves the energy of several inputs up to which a resolution tells something."""

_FREQUENCIES = 400
"""Frequencies of its response at most."""

Settings: TypeAlias = dict[str, str | float | int | list[int]]


@dataclass(frozen=True)
class Excitation:
    """What was played, as settings, and what to check about it."""

    settings: Settings
    checks: tuple[str, ...] = ()

    @property
    def is_arbitrary(self) -> bool:
        """Whether only a band and a resolution are said."""
        return self.settings.get("signal") == "arbitrary"


@dataclass(frozen=True)
class Proposal:
    """A mapping that is proposed.

    Attributes:
        inputs: What drives.
        outputs: What was measured.
        references: What was commanded besides.
        excitation: What was played; None for one shot.
        periods: Periods to use, None where there are none.
        drop_periods: Periods to drop before.
        take_last: Whether periods are counted from the end.
        resample: Clock to resample to; empty for none.
        one_shot: Whether the log is a record without a response.
        part_s: From where to where it is used, None for all of it [s].
    """

    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    references: tuple[Entry, ...]
    excitation: Excitation | None
    periods: int | None = None
    drop_periods: int = 0
    take_last: bool = False
    resample: str = ""
    one_shot: bool = False
    part_s: tuple[float, float] | None = None


def propose_lines(shared: Shared, lines: IntArray, step_s: float) -> Excitation:
    """Proposes period, band and lines of a signal that repeats.

    Args:
        shared: How it repeats.
        lines (n_line,): Lines that carry energy.
        step_s: Sampling period [s].
    """
    period_s, dense = float(f"{shared.whole * step_s:.9g}"), _dense_part(lines)
    told = (f"lines with energy: {format_lines(lines)}; the period was measured to {shared.samples:.6g} samples",)
    low, high = int(dense[0]), int(dense[-1])
    if len(lines) == 1:
        around = _band(period_s, 0.5 * low, 1.5 * low)
        return Excitation({**around, "grid": "full", "lines": [low]}, told)
    grids = {"odd": np.arange(low, high + 1, 2) if low % 2 else dense[:0], "full": np.arange(low, high + 1)}
    for grid, meant in grids.items():
        if len(np.intersect1d(meant, lines)) >= _DENSE * max(len(meant), len(lines)):
            return Excitation({**_band(period_s, low, high), "lines": "all", "grid": grid}, told)
    settings: Settings = {**_band(period_s, int(lines[0]), int(lines[-1])), "grid": "full"}
    return Excitation({**settings, "lines": lines.tolist() if len(lines) <= _LISTED else "found"}, told)


def _band(period_s: float, low: float, high: float) -> Settings:
    """Period and band of some lines, its ends rounded outwards."""
    lowest, highest = band_of(low, high, period_s)
    return {"period_s": period_s, "low_hz": lowest, "high_hz": highest}


def _dense_part(lines: IntArray) -> IntArray:
    """The lines without single ones far off the others, as distortion has them."""
    kept = lines
    while len(kept) > _DENSE * len(lines):
        steps = np.diff(kept)
        if len(steps) < 2 or kept[-1] - kept[0] <= len(steps) / _DENSE * np.median(steps):
            return kept
        kept = kept[1:] if steps[0] > steps[-1] else kept[:-1]
    return lines


def propose_band(band: tuple[float, float], duration_s: float, n_input: int) -> Excitation:
    """Proposes band and resolution of a signal that does not repeat.

    Args:
        band: Where its energy is [Hz].
        duration_s: How long it lasts [s].
        n_input: Inputs to be told apart.
    """
    resolution = _resolution(band, duration_s, n_input)
    low, high = max(float(f"{band[0]:.3g}"), resolution), float(f"{band[1]:.3g}")
    told: tuple[str, ...] = ("nothing repeats; band by where the inputs have their energy",)
    if n_input > 1:
        told += ("for a rigid model, which reads large motions, say `one_shot: true` below `acquire` in place of this",)
    return Excitation({"signal": "arbitrary", "low_hz": low, "high_hz": high, "resolution_hz": resolution}, told)


def is_broad(band: tuple[float, float], step_s: float, duration_s: float) -> bool:
    """Returns whether a signal's band [Hz] is wide enough for a frequency response."""
    return band[1] > _ARBITRARY * 0.5 / step_s and (band[1] - band[0]) * duration_s > 4 * _SEGMENTS


def is_resolved(band: tuple[float, float], middle_hz: float, duration_s: float, n_input: int) -> bool:
    """Returns whether the resolution that tells some inputs apart is finer than what half of their energy needs.

    Args:
        band: Where the energy is [Hz].
        middle_hz: Frequency below which half of it is, of the slowest input [Hz].
        duration_s: How long the log lasts [s].
        n_input: Inputs to be told apart.
    """
    return n_input == 1 or _resolution(band, duration_s, n_input) < _RESOLVED * middle_hz


def _resolution(band: tuple[float, float], duration_s: float, n_input: int) -> float:
    return float(f"{max(_SEGMENTS * n_input / duration_s, (band[1] - band[0]) / _FREQUENCIES):.2g}")
