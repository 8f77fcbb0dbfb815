"""Resonances and antiresonances of the motors' own responses against the model, and what repeated measurements pool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.stats import norm, t

from robid.arrays import FloatArray, IntArray, Quantity
from robid.frf.extrema import KINDS, realization_variance
from robid.frf.frf import Frf
from robid.frf.local_model import Kind, half_width
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.extrema import MATCH, Element, Elements, ExtremumPair, pair_extrema
from robid.models.elastic.judge.fitted import (
    FittedModel,
    Modes,
    damping_ratio,
    fitted_model,
    frequency_std,
    poles,
    zeros,
)
from robid.robot.description import Robot

SAME_CONFIGURATION = 1e-3
"""Largest distance of joints' positions in configurations that repeat each other [rad, or m]."""
SAME_EXTREMUM = 0.05
"""Largest relative distance between repeats of one extremum."""


@dataclass(frozen=True)
class ResonanceTable:
    """Resonances and antiresonances, one per row: a peak beside a peak, a pole beside a pole."""

    configuration: Annotated[IntArray, Quantity("1", "resonance", "Index of the configuration")]
    channel: Annotated[tuple[str, ...], Quantity("1", "resonance", "Motor whose own response has it")]
    kind: Annotated[tuple[str, ...], Quantity("1", "resonance", "Resonance or antiresonance")]
    measured_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "Measured peak or dip")]
    lower_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "Lower end of its interval")]
    upper_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "Upper end of its interval")]
    model_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "The model's peak or dip, read as the measured one")]
    mode_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "The model's own pole or zero there")]
    mode_lower_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "Lower end of its interval")]
    mode_upper_hz: Annotated[FloatArray, Quantity("Hz", "resonance", "Upper end of its interval")]
    damping: Annotated[FloatArray, Quantity("1", "resonance", "Damping ratio of the model's pole or zero")]
    # Pole or zero of the local model of the measurement, as an undamped frequency; NaN where the magnitude is all that
    # the lines show; None in tables of old
    pole_hz: Annotated[FloatArray | None, Quantity("Hz", "resonance", "Measured pole or zero, of a local model")] = None
    pole_lower_hz: Annotated[FloatArray | None, Quantity("Hz", "resonance", "Lower end of its interval")] = None
    pole_upper_hz: Annotated[FloatArray | None, Quantity("Hz", "resonance", "Upper end of its interval")] = None


@dataclass(frozen=True)
class _Mode:
    """A pole or zero of the fitted model."""

    root: complex = complex(np.nan, np.nan)
    frequency_hz: float = np.nan
    reach_hz: float = np.nan
    damping: float = np.nan


@dataclass(frozen=True)
class _Row:
    """A pair, the freedom of its own variance, and variances of peak and pole as realizations show, with theirs."""

    configuration: int
    channel: str
    kind: Kind
    pair: ExtremumPair
    own_freedom: float
    realizations: tuple[tuple[float, float], float] | None
    mode: _Mode

    @property
    def found_hz(self) -> tuple[float, float]:
        """Measured peak, and pole or zero [Hz]."""
        return self.pair.measured.peak_hz, self.pair.measured.frequency_hz


def tabulate_resonances(
    robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float
) -> ResonanceTable:
    """Finds resonances and antiresonances of each motor's own response and their counterparts in the model.

    Extrema of the measured magnitude that stand out of the noise, and out of what its lines scatter where there is one
    realization, are refined by a local rational model; so are the model's, on the same lines, so that what the
    neighbouring modes add to both cancels. The interval holds the largest of what the response's covariance gives,
    with the reading between lines, what leaving out each realization changes, and what configurations that repeat
    each other scatter.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: Frequency responses, of the fit or of another campaign.
        options: Options of the fit; `confidence` is the level of the intervals.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The table, ordered by configuration, motor and frequency.

    Raises:
        DataError: If the data and the model do not belong together.
    """
    fitted = fitted_model(robot, solution, frf, options, delay_s)
    own_factor = float(norm.ppf(0.5 + 0.5 * options.confidence))
    covariance = _own_covariance(solution, fitted, options.confidence)
    elements = Elements(fitted, frf, scattering=True)
    rows: list[_Row] = []
    for configuration in range(frf.response.shape[0]):
        free = _own_modes(fitted, covariance, poles(*fitted.linear, configuration), configuration, own_factor)
        for motor, name in enumerate(frf.input_names):
            if name in frf.output_names:
                # With its motor locked, a motor's own response has its zeros where the rest of the robot has poles.
                locked = zeros(*fitted.linear, configuration, motor)
                fixed = _own_modes(fitted, covariance, locked, configuration, own_factor)
                element = elements.at(configuration, frf.output_names.index(name), motor)
                rows += _rows(element, configuration, name, {"resonance": free, "antiresonance": fixed})
    return _table(rows, _half_widths(rows, frf, options.confidence))


def _rows(element: Element, configuration: int, name: str, own: dict[Kind, list[_Mode]]) -> list[_Row]:
    """Pairs of one element by frequency, each with the model's own mode next to it."""
    pairs = ((kind, pair) for kind in KINDS for pair in pair_extrema(element, kind))
    found = [
        _Row(
            configuration,
            name,
            kind,
            pair,
            float(element.freedom[pair.line]),
            realization_variance(element, pair.estimate, pair.line, kind),
            _nearest(own[kind], pair),
        )
        for kind, pair in pairs
    ]
    return sorted(found, key=lambda row: row.pair.measured_hz)


def _half_widths(rows: list[_Row], frf: Frf, confidence: float) -> FloatArray:
    """Half widths (n_row, 2) of the intervals of peaks and of poles."""
    repeats = [_repeats(row, rows, frf.configurations) for row in rows]
    found = np.zeros((len(rows), 2))
    for index, row in enumerate(rows):
        for which, std in enumerate((row.pair.measured.peak_std_hz, row.pair.measured.std_hz)):
            scatter = [] if row.realizations is None else [(row.realizations[0][which], row.realizations[1])]
            same = repeats[index][:, which]
            scatter += [(float(same.var(ddof=1)), same.size - 1.0)] if same.size > 1 else []
            found[index, which] = half_width((std**2 + row.pair.reading_hz**2, row.own_freedom), scatter, confidence)
    return found


def _repeats(row: _Row, rows: list[_Row], configurations: FloatArray) -> FloatArray:
    """Peak and pole (n_repeat, 2) of one extremum in all configurations that repeat its own, itself among them."""
    here = configurations[row.configuration]
    best: dict[int, tuple[float, float]] = {}
    for other in rows:
        same = np.abs(configurations[other.configuration] - here).max(initial=0.0) <= SAME_CONFIGURATION
        if not same or (other.channel, other.kind) != (row.channel, row.kind):
            continue
        distance = abs(other.found_hz[0] / row.found_hz[0] - 1)
        known = best.get(other.configuration)
        nearer = known is None or distance < abs(known[0] / row.found_hz[0] - 1)
        if distance <= SAME_EXTREMUM and nearer:
            best[other.configuration] = other.found_hz
    return np.array(list(best.values()))


def _own_covariance(solution: ElasticSolution, fitted: FittedModel, confidence: float) -> FloatArray:
    """Covariance of the fitted model's parameters as wide as their intervals, of normal quantiles.

    What only this campaign has is known there.
    """
    own, tail = solution.internal, 0.5 + 0.5 * confidence
    freedom = solution.estimate.degrees_of_freedom if own.degrees_of_freedom is None else own.degrees_of_freedom
    wider = t.ppf(tail, freedom) / norm.ppf(tail)
    names = fitted.problem.parameters.names
    known = np.array([name in solution.estimate.names for name in names])
    order = [solution.estimate.names.index(name) for name in names if name in solution.estimate.names]
    covariance = np.zeros((len(names), len(names)))
    covariance[np.ix_(known, known)] = (own.covariance * np.outer(wider, wider))[np.ix_(order, order)]
    return covariance


def _own_modes(
    fitted: FittedModel, covariance: FloatArray, modes: Modes, configuration: int, factor: float
) -> list[_Mode]:
    reach = factor * frequency_std(fitted, covariance, modes, configuration)
    columns = modes.roots, np.abs(modes.roots) / (2 * np.pi), reach, damping_ratio(modes.roots)
    return [_Mode(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _nearest(modes: list[_Mode], pair: ExtremumPair) -> _Mode:
    """The mode next to the root that the model's local refinement found, if any is near."""
    if not modes or not np.isfinite(pair.model_hz):
        return _Mode()
    nearest = min(modes, key=lambda mode: abs(mode.root - pair.root))
    return nearest if abs(nearest.frequency_hz / pair.model_hz - 1) <= MATCH else _Mode()


def _table(rows: list[_Row], half: FloatArray) -> ResonanceTable:
    measured, pole = (np.array([row.found_hz[which] for row in rows]) for which in (0, 1))
    pole = np.where([row.pair.measured.is_root for row in rows], pole, np.nan)
    mode, mode_reach = (np.array([getattr(row.mode, key) for row in rows]) for key in ("frequency_hz", "reach_hz"))
    return ResonanceTable(
        configuration=np.array([row.configuration for row in rows], dtype=int),
        channel=tuple(row.channel for row in rows),
        kind=tuple(row.kind for row in rows),
        measured_hz=measured,
        lower_hz=measured - half[:, 0],
        upper_hz=measured + half[:, 0],
        model_hz=np.array([np.nan if row.pair.model is None else row.pair.model.peak_hz for row in rows]),
        mode_hz=mode,
        mode_lower_hz=mode - mode_reach,
        mode_upper_hz=mode + mode_reach,
        damping=np.array([row.mode.damping for row in rows]),
        pole_hz=pole,
        pole_lower_hz=pole - half[:, 1],
        pole_upper_hz=pole + half[:, 1],
    )


@dataclass(frozen=True)
class Measured:
    """Resonances of some configurations, and the campaign that measured each."""

    table: ResonanceTable  # The resonances
    configurations: FloatArray  # (n_conf, n_joint) Positions of the joints [rad, or m]
    campaigns: tuple[str, ...]  # Name of each configuration's campaign


@dataclass(frozen=True)
class Repeat:
    """One resonance in several measurements of one robot configuration."""

    row: int  # Its first row in the own table
    campaigns: tuple[str, ...]  # Campaign of each measurement that shows it
    peaks_hz: FloatArray  # (n,) Where each has its peak, or dip [Hz]
    mean_hz: FloatArray  # (2,) Mean peak, and mean pole or zero; NaN where fewer than two measurements have one [Hz]
    half_hz: FloatArray  # (2,) Half width about it of the interval that holds another measurement's [Hz]


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
        same = _of_same_configuration(row, lines)
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


def _of_same_configuration(row: int, lines: Sequence[_Line]) -> IntArray:
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
