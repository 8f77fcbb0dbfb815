"""Resonances of campaigns that measured one robot configuration, pooled: what another campaign would find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray, IntArray
from robid.models.elastic.judge.local_model import half_width
from robid.models.elastic.judge.resonances import SAME_CONFIGURATION, SAME_EXTREMUM, ResonanceTable


@dataclass(frozen=True)
class Measured:
    """Resonances of some configurations, and the campaign that measured each.

    Attributes:
        table: The resonances.
        configurations (n_conf, n_joint): Positions of the joints [rad, or m].
        campaigns: Name of each configuration's campaign.
    """

    table: ResonanceTable
    configurations: FloatArray
    campaigns: tuple[str, ...]


@dataclass(frozen=True)
class Repeat:
    """One resonance in several measurements of one robot configuration.

    Attributes:
        row: Its first row in the own table.
        campaigns: Campaign of each measurement that shows it.
        peaks_hz (n,): Where each has its peak, or dip [Hz].
        mean_hz (2,): Mean peak, and mean pole or zero; NaN where fewer than two measurements have one [Hz].
        half_hz (2,): Half width about it of the interval that holds another measurement's [Hz].
    """

    row: int
    campaigns: tuple[str, ...]
    peaks_hz: FloatArray
    mean_hz: FloatArray
    half_hz: FloatArray


def pool_repeats(
    own: Measured, others: Sequence[Measured], confidence: float
) -> tuple[ResonanceTable, tuple[Repeat, ...]]:
    """Pools the resonances of campaigns that measured the same configurations of one robot.

    Args:
        own: Those of one fit.
        others: Those of others; of a campaign that is known already nothing is taken again.
        confidence: Level of the intervals.

    Returns:
        The own table, its intervals of what was measured widened to what further campaigns scatter, and every
        resonance that several measurements show.
    """
    lines = _lines(own, ())
    seen = set(own.campaigns)
    for other in others:
        lines += _lines(other, seen)
        seen |= set(other.campaigns)
    count, grouped = own.table.measured_hz.size, set[int]()
    half = np.array([line.half_hz for line in lines[:count]]).reshape(count, 2)
    repeats = []
    for row, line in enumerate(lines[:count]):
        same = _repeats(row, lines)
        if same.size > 1 and any(lines[index].campaign not in own.campaigns for index in same):
            half[row] = _pooled_half([line], [lines[index] for index in same], confidence)
        if same.size > 1 and row not in grouped:
            grouped |= set(same.tolist())
            repeats.append(_repeat(row, [lines[index] for index in same], confidence))
    return _widened(own.table, half), tuple(repeats)


@dataclass(frozen=True)
class _Line:
    """A row of a table with all that tells whether it repeats another."""

    campaign: str
    measurement: tuple[str, int]
    place: FloatArray
    channel: str
    kind: str
    hz: FloatArray
    half_hz: FloatArray


def _lines(measured: Measured, seen: Sequence[str] | set[str]) -> list[_Line]:
    table, nowhere = measured.table, np.full(measured.table.measured_hz.size, np.nan)
    pole, high = (nowhere if each is None else each for each in (table.pole_hz, table.pole_upper_hz))
    hz = np.stack([table.measured_hz, pole], axis=1)
    half = np.stack([table.upper_hz, high], axis=1) - hz
    found = []
    for row, configuration in enumerate(table.configuration.tolist()):
        campaign, place = measured.campaigns[configuration], measured.configurations[configuration]
        if campaign not in seen:
            names = table.channel[row], table.kind[row]
            found.append(_Line(campaign, (campaign, configuration), place, *names, hz[row], half[row]))
    return found


def _repeats(row: int, lines: Sequence[_Line]) -> IntArray:
    """The line of each measurement of the same configuration that is nearest to one, itself among them."""
    here = lines[row]
    best: dict[tuple[str, int], tuple[float, int]] = {}
    for index, line in enumerate(lines):
        if (line.channel, line.kind) != (here.channel, here.kind) or line.place.shape != here.place.shape:
            continue
        distance = float(abs(line.hz[0] / here.hz[0] - 1))
        same = np.abs(line.place - here.place).max(initial=0.0) <= SAME_CONFIGURATION
        if same and distance <= SAME_EXTREMUM and distance < best.get(line.measurement, (np.inf, 0))[0]:
            best[line.measurement] = distance, index
    return np.array(sorted(index for _, index in best.values()), dtype=int)


def _repeat(row: int, lines: Sequence[_Line], confidence: float) -> Repeat:
    found = np.array([line.hz for line in lines])
    there = np.isfinite(found).sum(axis=0)
    mean = np.full(2, np.nan)
    mean[there > 1] = np.nanmean(found[:, there > 1], axis=0)
    # What another measurement finds differs from the mean by the errors of both.
    half = _pooled_half(lines, lines, confidence) * np.sqrt(1 + 1 / np.maximum(there, 1))
    half = np.where(there > 1, half, np.nan)
    return Repeat(row, tuple(line.campaign for line in lines), found[:, 0], mean, half)


def _pooled_half(of: Sequence[_Line], lines: Sequence[_Line], confidence: float) -> FloatArray:
    """Half widths (2,) that hold the intervals of some lines and the scatter of all."""
    normal = float(norm.ppf(0.5 + 0.5 * confidence))
    pooled = np.full(2, np.nan)
    for which in (0, 1):
        own = np.array([line.half_hz[which] for line in of])
        hz = np.array([line.hz[which] for line in lines])
        own, hz = own[np.isfinite(own)], hz[np.isfinite(hz)]
        if own.size:
            scatter = [(float(hz.var(ddof=1)), hz.size - 1.0)] if hz.size > 1 else []
            pooled[which] = half_width(((own.max() / normal) ** 2, np.inf), scatter, confidence)
    return pooled


def _widened(table: ResonanceTable, half: FloatArray) -> ResonanceTable:
    peaks = replace(table, lower_hz=table.measured_hz - half[:, 0], upper_hz=table.measured_hz + half[:, 0])
    if table.pole_hz is None:
        return peaks
    return replace(peaks, pole_lower_hz=table.pole_hz - half[:, 1], pole_upper_hz=table.pole_hz + half[:, 1])
