"""Two responses brought to the same elements, configurations and lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.distortion import interpolate_response, interpolation_error
from robid.frf.frf import Frf
from robid.frf.quality import dropped_lines
from robid.signals.quantities import Channel, channel_names

Pairs: TypeAlias = tuple[tuple[int, int], ...]
How: TypeAlias = Literal["common", "first", "second"]

_SAME_POSITION = 1e-3  # Distance of joint positions up to which two configurations are the same [rad, or m]
_SAME_FREQUENCY = 1e-6
_ENOUGH = 0.5  # Share of the lines of the sparser response that must be common for no interpolation

_REMEDY = (
    "compare campaigns of the same channels; where these are described wrongly, correct their `unit`, `quantity` and"
    " `side` under `acquire`, or `estimate.outputs`, and estimate again"
)


@dataclass(frozen=True)
class Aligned:
    """Two responses at the same lines, NaN where one told too little.

    Attributes:
        pairs: Indices of the configurations that belong together.
        outputs: Indices of the outputs that do.
        inputs: Indices of the inputs that do.
        frequency_hz (n_line,): The lines [Hz].
        how: Whether they are common to both, or which response was interpolated to the other's.
        first (n_pair, n_line, n_out, n_in): The first response.
        second (n_pair, n_line, n_out, n_in): The second response.
        first_variance (n_pair, n_line, n_out, n_in): Its variance, interpolation included; NaN where unknown.
        second_variance (n_pair, n_line, n_out, n_in): The same of the second.
    """

    pairs: Pairs
    outputs: Pairs
    inputs: Pairs
    frequency_hz: FloatArray
    how: How
    first: ComplexArray
    second: ComplexArray
    first_variance: FloatArray
    second_variance: FloatArray


def align(first: Frf, second: Frf) -> Aligned:
    """Brings two responses together.

    Lines are those that both have, where these are at least half of the sparser response's in the common band; else
    the denser response is interpolated to them (cubics that do not overshoot), and what its lines left out in turn
    show of the error counts as deviation.

    Raises:
        DataError: If channels of one name differ, or there is no common element, configuration or band.
    """
    outputs, inputs = _elements(first, second)
    pairs = pair_configurations(first, second)
    frequency_hz, how = _lines(first.frequency_hz, second.frequency_hz)
    one = _brought(first, [a for a, _ in pairs], [a for a, _ in outputs], [a for a, _ in inputs], frequency_hz)
    other = _brought(second, [b for _, b in pairs], [b for _, b in outputs], [b for _, b in inputs], frequency_hz)
    return Aligned(pairs, outputs, inputs, frequency_hz, how, one[0], other[0], one[1], other[1])


def pair_configurations(first: Frf, second: Frf) -> Pairs:
    """Pairs configurations at the same joint positions; two that are the only ones belong together anyway.

    Raises:
        DataError: If there is none.
    """
    mine, theirs = first.configurations, second.configurations
    if len(mine) == len(theirs) == 1:
        return ((0, 0),)
    if mine.shape[1] != theirs.shape[1]:
        what = f"one has {mine.shape[1]} joints in its configurations, the other {theirs.shape[1]}"
        raise DataError(what, remedy="compare campaigns of one robot")
    left, pairs = list(range(len(theirs))), []
    for index, position in enumerate(mine):
        same = [other for other in left if np.abs(theirs[other] - position).max(initial=0.0) <= _SAME_POSITION]
        if same:
            left.remove(same[0])
            pairs.append((index, same[0]))
    if not pairs:
        what = f"none of the {len(mine)} and {len(theirs)} configurations is at the same joint positions"
        raise DataError(what, remedy="compare campaigns that were measured in the same configurations")
    return tuple(pairs)


def _elements(first: Frf, second: Frf) -> tuple[Pairs, Pairs]:
    """Pairs the channels of one name.

    Raises:
        DataError: If they are something else, or there is none on one side.
    """
    sides = (
        ("output", first.output_channels, second.output_channels),
        ("input", first.input_channels, second.input_channels),
    )
    problems, found = [], []
    for side, mine, theirs in sides:
        names = channel_names(theirs)
        pairs = tuple((index, names.index(one.name)) for index, one in enumerate(mine) if one.name in names)
        problems += [
            f"{side} `{mine[a].name}` is {_told(mine[a])} in the first, but {_told(theirs[b])} in the second"
            for a, b in pairs
            if mine[a] != theirs[b]
        ]
        if not pairs:
            listed = " and ".join(", ".join(channel_names(channels)) for channels in (mine, theirs))
            problems.append(f"they have no {side} in common ({listed})")
        found.append(pairs)
    if problems:
        raise DataError("; ".join(problems), remedy=_REMEDY)
    return found[0], found[1]


def _told(channel: Channel) -> str:
    return f"{channel.side} {channel.title} [{channel.unit}]"


def _lines(first: FloatArray, second: FloatArray) -> tuple[FloatArray, How]:
    """Frequencies to compare at, and how the responses come to them.

    Raises:
        DataError: If the bands do not overlap.
    """
    slack = 1 + _SAME_FREQUENCY
    low, high = max(first[0], second[0]) / slack, min(first[-1], second[-1]) * slack
    mine, theirs = (each[(each >= low) & (each <= high)] for each in (first, second))
    if not (mine.size and theirs.size):
        bands = " and ".join(f"{each[0]:.4g} to {each[-1]:.4g} Hz" for each in (first, second))
        raise DataError(f"their bands do not overlap: {bands}", remedy="compare campaigns whose bands overlap")
    common = mine[np.abs(theirs[_nearest(theirs, mine)] - mine) <= _SAME_FREQUENCY * mine]
    if len(common) >= _ENOUGH * min(len(mine), len(theirs)):
        return common, "common"
    return (theirs, "first") if len(theirs) <= len(mine) else (mine, "second")


def _nearest(values: FloatArray, wanted: FloatArray) -> FloatArray:
    return np.asarray(np.abs(values[:, None] - wanted).argmin(axis=0))


def _brought(
    frf: Frf, configurations: list[int], outputs: list[int], inputs: list[int], frequency_hz: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Response and variance (n_pair, n_line, n_out, n_in) of some elements at some frequencies."""
    chosen = np.ix_(configurations, range(len(frf.lines)), outputs, inputs)
    response, lost = frf.response[chosen], dropped_lines(frf)[configurations][:, :, inputs]
    variance = frf.element_variance()[chosen] if frf.degrees_of_freedom > 0 else np.full(response.shape, np.nan)
    at = _nearest(frf.frequency_hz, frequency_hz)
    if np.allclose(frf.frequency_hz[at], frequency_hz, rtol=_SAME_FREQUENCY, atol=0):
        told = np.where(lost[:, at, None], np.nan, response[:, at])
        return told, np.where(lost[:, at, None], np.nan, variance[:, at])
    found = np.full((len(configurations), len(frequency_hz), *response.shape[2:]), np.nan + 0j)
    spread = np.full(found.shape, np.nan)
    for pair, motor in np.ndindex(len(configurations), len(inputs)):
        kept = ~lost[pair, :, motor]
        if kept.sum() > 1:
            own = np.ix_(np.flatnonzero(kept), np.arange(len(outputs)), [motor])
            here = (pair, slice(None), slice(None), slice(motor, motor + 1))
            column, deviations = response[pair][own], variance[pair][own]
            found[here], spread[here] = _interpolated(frf.frequency_hz[kept], column, deviations, frequency_hz)
    return found, spread


def _interpolated(
    frequency_hz: FloatArray, response: ComplexArray, variance: FloatArray, wanted: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Response (n_line, n_out, n_in) in between, and its variance with that of the interpolation."""
    between = interpolate_response(frequency_hz, response, wanted)
    error = interpolation_error(frequency_hz, response, wanted)
    own = np.apply_along_axis(lambda values: np.interp(np.log(wanted), np.log(frequency_hz), values), 0, variance)
    return between, np.asarray(own + error**2)
