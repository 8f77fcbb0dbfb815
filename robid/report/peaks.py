"""Peaks and dips of responses that no model was fitted to, as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.frf.extrema import Peak, peaks_of
from robid.frf.frf import Frf
from robid.report.numbers import number_of, percent, significant
from robid.report.section import ColumnStyle, Row, Table

_LEVEL = 0.95
_STYLES: tuple[ColumnStyle, ...] = ("text", "text", "name", "text", "strong", "number", "number", "number")
_CAPTION = (
    "Peaks and dips of the magnitude that stand out of the noise. ± is half the {level} interval: the reading between"
    " the lines, and noise, alone where there is one realization. The damping ratio is that of a rational function"
    " through the lines around the peak (its pole) or dip (its zero), or a dash where these lines do not have its form."
    " Beside a near resonance it may be off by a factor of two. Magnitude: at the nearest line."
)


def peak_table(campaigns: Sequence[tuple[str, Frf]]) -> tuple[Table, ...]:
    """Tabulates the peaks and dips of some campaigns' responses; nothing where none stands out."""
    rows = [(name, peak) for name, frf in campaigns for peak in peaks_of(frf, _LEVEL)]
    if not rows:
        return ()
    heads = ("Campaign", "Configuration", "Element", "Kind", "Frequency [Hz]", "±", "Damping ratio", "Magnitude")
    return (
        Table(
            heads,
            tuple(_row(name, peak) for name, peak in rows),
            title="Resonances and antiresonances",
            caption=_CAPTION.format(level=percent(_LEVEL)),
            styles=_STYLES,
            fit="tall",
        ),
    )


def _row(campaign: str, peak: Peak) -> Row:
    element = peak.output if peak.output == peak.input else f"{peak.output} / {peak.input}"
    decibels = f"{significant(20 * float(np.log10(peak.magnitude)), 3)} dB"
    place = (campaign, number_of(peak.configuration), element, peak.kind)
    return Row((*place, *_known(peak.peak_hz, peak.peak_half_hz), significant(peak.damping, 2), decibels))


def _known(value: float, half_width: float) -> tuple[str, str]:
    """Writes a frequency with the digits that its interval leaves, and half the interval."""
    decimals = int(np.clip(1 - np.floor(np.log10(half_width)), 0, 4))
    return f"{value:.{decimals}f}", f"{half_width:.{decimals}f}"
