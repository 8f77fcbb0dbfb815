"""Responses of several campaigns as one, along the configuration axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from math import gcd, lcm
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray, places_of
from robid.errors import DataError
from robid.frf.distortion import completed
from robid.frf.frf import Frf
from robid.frf.friction import with_friction_moved

_SAME = ("input_channels", "output_channels", "input_hold", "sampling_period_s", "coefficient_names")
_SILENT = ("silent_level", "silent_noise", "silent_interpolation")
_COMMON_PERIODS = 60  # Longest common period of several grids of lines, in periods of any of them
_SAME_FREQUENCY = 1e-6  # Relative difference of frequencies that are the same line


def join(frfs: Sequence[Frf], names: Sequence[str]) -> Frf:
    """Joins responses of the same robot, such as those of two amplitudes or of two bands.

    Where their lines differ, all have the lines of all: one that was not excited is a dropped line, as one that tells
    too little, see `Frf.dropped`. What is known of silent lines is left out then.

    Compensated torque coefficients are the robot's own and shared: each response is moved to where the first one's
    were subtracted, exactly as a fit moves them.

    Args:
        frfs: The responses; configurations may be the same. What only some of them have is left out.
        names: What to call each in an error.

    Raises:
        DataError: If they differ in channels or compensation, or their lines have no common grid.
    """
    first = frfs[0]
    _check_alike(frfs, names)
    blocks = max((frf.input_amplitude.shape[-1] for frf in frfs if frf.input_amplitude is not None), default=0)
    told: tuple[str, ...] = ()
    aligned = [_aligned(frf, first, blocks) for frf in frfs]
    if not all(_same_lines(frf, first) for frf in frfs):
        told = (_lines_note(frfs, names),)
        aligned = _on_all_lines(aligned, names)
    aligned = _equally_correlated(aligned)
    return replace(
        aligned[0],
        **_concatenated(aligned),
        coefficient_relative_std=np.max([frf.coefficient_relative_std for frf in frfs], axis=0),
        total_degrees_of_freedom=min(frf.total_degrees_of_freedom for frf in frfs),
        noise_degrees_of_freedom=min(frf.noise_degrees_of_freedom for frf in frfs),
        notes=(*dict.fromkeys(note for frf in frfs for note in frf.notes), *told),
    )


def _check_alike(frfs: Sequence[Frf], names: Sequence[str]) -> None:
    for other, name in zip(frfs[1:], names[1:], strict=True):
        differing = [key for key in _SAME if getattr(other, key) != getattr(frfs[0], key)]
        if differing:
            message = f"D017 `{name}` cannot be joined to `{names[0]}`: {', '.join(differing).replace('_', ' ')} differ"
            raise DataError(
                message, where=name, remedy="give both campaigns the same channels, or fit them on their own"
            )


def _concatenated(frfs: Sequence[Frf]) -> dict[str, Any]:
    """Everything with a configuration axis, one response after the other; None for what only some have."""
    whole: dict[str, Any] = {}
    for key in places_of(Frf, "configuration"):
        parts = [getattr(frf, key) for frf in frfs]
        if key == "dropped" and any(part is not None for part in parts):
            parts = [_none_dropped(frf) if frf.dropped is None else frf.dropped for frf in frfs]
        alike = all(part is not None and part.shape[1:] == parts[0].shape[1:] for part in parts)
        whole[key] = np.concatenate(parts) if alike else None
    return whole


def _same_lines(frf: Frf, first: Frf) -> bool:
    same = frf.frequency_hz.shape == first.frequency_hz.shape
    return same and bool(np.allclose(frf.frequency_hz, first.frequency_hz, rtol=_SAME_FREQUENCY, atol=0))


def _equally_correlated(frfs: Sequence[Frf]) -> list[Frf]:
    """Responses whose correlation of lines reaches equally far, with zeros where it does not."""
    held = [frf.line_correlation for frf in frfs]
    reach = max((each.shape[2] for each in held if each is not None), default=0)
    made = []
    for frf, own in zip(frfs, held, strict=True):
        whole = np.zeros((*frf.response.shape[:2], reach))
        if own is not None:
            whole[:, :, : own.shape[2]] = own
        made.append(replace(frf, line_correlation=whole if reach else None))
    return made


def _none_dropped(frf: Frf) -> BoolArray:
    return np.zeros((len(frf.response), len(frf.lines), frf.response.shape[3]), bool)


def _on_all_lines(frfs: Sequence[Frf], names: Sequence[str]) -> list[Frf]:
    """Responses at the lines of all of them, counted on a grid that holds them all."""
    period_s = _common_period(frfs, names)
    counted = [np.round(frf.frequency_hz * period_s).astype(int) for frf in frfs]
    lines = np.unique(np.concatenate(counted))
    reach = max(_reach(frf, np.searchsorted(lines, own)) for frf, own in zip(frfs, counted, strict=True))
    return [_at_lines(frf, own, lines, lines / period_s, reach) for frf, own in zip(frfs, counted, strict=True)]


def _reach(frf: Frf, at: IntArray) -> int:
    """Lines of all over which the errors of a response's own lines, at these places, are correlated."""
    # Errors are correlated over so many own lines; how far these are apart on the common grid is the reach.
    count = 0 if frf.line_correlation is None else min(frf.line_correlation.shape[2], len(at) - 1)
    return int((at[count:] - at[:-count]).max()) if count else 0


def _at_lines(frf: Frf, own: IntArray, lines: IntArray, frequency_hz: FloatArray, reach: int) -> Frf:
    """One response at further lines, dropped in all of its configurations."""
    at = np.searchsorted(lines, own)
    silent: dict[str, Any] = dict.fromkeys(_SILENT)
    rows = []
    for row in range(len(frf.response)):
        part = replace(frf.select([row]), lines=own, silent_lines=np.zeros(0, int), **silent)
        dropped = np.ones((len(lines), frf.response.shape[3]), bool)
        dropped[at] = False if part.dropped is None else part.dropped[0]
        held = part.input_amplitude
        amplitude = np.zeros((len(lines), *((*frf.response.shape[3:], 0) if held is None else held.shape[2:])), complex)
        if held is not None:
            amplitude[at] = held[0]
        made = completed(part, dropped, lines, frequency_hz, amplitude, reach)
        rows.append(made if held is not None else replace(made, input_amplitude=None))
    return join(rows, [""] * len(rows)) if len(rows) > 1 else rows[0]


def _common_period(frfs: Sequence[Frf], names: Sequence[str]) -> float:
    """Shortest period whose lines are those of all responses [s]; refused if it is much longer than theirs."""
    # Of an arbitrary signal the log's whole length is counted, of which its resolution needs a part.
    periods_s = [float(frf.lines[-1] / np.gcd.reduce(frf.lines) / frf.frequency_hz[-1]) for frf in frfs]
    # Periods as small fractions of the first one: their lines have a common grid in the least common multiple.
    ratios = [Fraction(period_s / periods_s[0]).limit_denominator(_COMMON_PERIODS) for period_s in periods_s]
    common = Fraction(lcm(*(one.numerator for one in ratios)), gcd(*(one.denominator for one in ratios)))
    off = [abs(float(one) * periods_s[0] / period_s - 1) for one, period_s in zip(ratios, periods_s, strict=True)]
    if max(off) > _SAME_FREQUENCY or max(float(common / one) for one in ratios) > _COMMON_PERIODS:
        shown = ", ".join(f"`{name}` {period_s:.9g} s" for name, period_s in zip(names, periods_s, strict=True))
        message = f"D018 the lines have no common grid: {shown} are the periods"
        remedy = (
            "give the campaigns periods (`period_s`, or one over `resolution_hz`) that are small whole multiples of one"
            " time, or fit them apart"
        )
        raise DataError(message, where=names[-1], remedy=remedy)
    return float(common) * periods_s[0]


def _lines_note(frfs: Sequence[Frf], names: Sequence[str]) -> str:
    each = ", ".join(
        f"{name} {len(frf.lines)} from {frf.frequency_hz[0]:.4g} to {frf.frequency_hz[-1]:.4g} Hz"
        for name, frf in zip(names, frfs, strict=True)
    )
    return f"The campaigns have different lines: {each}; where one was not excited its response is left out."


def _aligned(frf: Frf, first: Frf, blocks: int) -> Frf:
    """The response with the first one's torque coefficients subtracted, and as many experiments as all have."""
    if frf.input_amplitude is not None:
        missing = [(0, 0)] * 3 + [(0, blocks - frf.input_amplitude.shape[-1])]
        frf = replace(frf, input_amplitude=np.pad(frf.input_amplitude, missing, constant_values=np.nan))
    if frf.coefficient_offset is None or first.coefficient_offset is None or not frf.coefficient_names:
        return frf
    return with_friction_moved(frf, first.coefficient_offset - frf.coefficient_offset)
