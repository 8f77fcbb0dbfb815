"""Two responses brought to the same elements and lines, and held against each other within what both are known to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from scipy.stats import f

from robid.arrays import ComplexArray, FloatArray, Meaning
from robid.errors import DataError
from robid.frf.distortion import interpolate_response, interpolation_error
from robid.frf.frf import Frf
from robid.frf.local import mean_correlation
from robid.frf.quality import dropped_lines, middle
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
    """Two responses at the same lines, NaN where one told too little."""

    pairs: Pairs  # Indices of the configurations that belong together
    outputs: Pairs  # Indices of the outputs that do
    inputs: Pairs  # Indices of the inputs that do
    frequency_hz: FloatArray  # (n_line,) The lines [Hz]
    how: How  # Whether they are common to both, or which response was interpolated to the other's
    first: ComplexArray  # (n_pair, n_line, n_out, n_in) The first response
    second: ComplexArray  # (n_pair, n_line, n_out, n_in) The second response
    first_variance: FloatArray  # (n_pair, n_line, n_out, n_in) Its variance, interpolation included; NaN where unknown
    second_variance: FloatArray  # (n_pair, n_line, n_out, n_in) The same of the second


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
        what = f"D006 one has {mine.shape[1]} joints in its configurations, the other {theirs.shape[1]}"
        raise DataError(what, remedy="compare campaigns of one robot")
    left, pairs = list(range(len(theirs))), []
    for index, position in enumerate(mine):
        same = [other for other in left if np.abs(theirs[other] - position).max(initial=0.0) <= _SAME_POSITION]
        if same:
            left.remove(same[0])
            pairs.append((index, same[0]))
    if not pairs:
        what = f"D007 none of the {len(mine)} and {len(theirs)} configurations is at the same joint positions"
        raise DataError(what, remedy="compare campaigns that were measured in the same configurations")
    return tuple(pairs)


def _elements(first: Frf, second: Frf) -> tuple[Pairs, Pairs]:
    """Pairs the channels of one name; refuses those that are something else, and sides without any."""
    sides = (
        ("output", first.output_channels, second.output_channels),
        ("input", first.input_channels, second.input_channels),
    )
    problems, found = [], []
    for side, mine, theirs in sides:
        names = channel_names(theirs)
        pairs = tuple((index, names.index(one.name)) for index, one in enumerate(mine) if one.name in names)
        problems += [
            f"D008 {side} `{mine[a].name}` is {_told(mine[a])} in the first, but {_told(theirs[b])} in the second"
            for a, b in pairs
            if mine[a] != theirs[b]
        ]
        if not pairs:
            listed = " and ".join(", ".join(channel_names(channels)) for channels in (mine, theirs))
            problems.append(f"D009 they have no {side} in common ({listed})")
        found.append(pairs)
    if problems:
        raise DataError("; ".join(problems), remedy=_REMEDY)
    return found[0], found[1]


def _told(channel: Channel) -> str:
    return f"{channel.side} {channel.title} [{channel.unit}]"


def _lines(first: FloatArray, second: FloatArray) -> tuple[FloatArray, How]:
    """Frequencies to compare at, and how the responses come to them; refuses bands that do not overlap."""
    slack = 1 + _SAME_FREQUENCY
    low, high = max(first[0], second[0]) / slack, min(first[-1], second[-1]) * slack
    mine, theirs = (each[(each >= low) & (each <= high)] for each in (first, second))
    if not (mine.size and theirs.size):
        bands = " and ".join(f"{each[0]:.4g} to {each[-1]:.4g} Hz" for each in (first, second))
        raise DataError(f"D010 their bands do not overlap: {bands}", remedy="compare campaigns whose bands overlap")
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
    # Variances are interpolated linearly over the logarithm of frequency, which never leaves their range.
    own = np.apply_along_axis(lambda values: np.interp(np.log(wanted), np.log(frequency_hz), values), 0, variance)
    return between, np.asarray(own + error**2)


LEVEL = 0.95


@dataclass(frozen=True)
class ElementDifference:
    """How far the second response is from the first in one element."""

    output: Annotated[str, Meaning("Channel that answers.")]
    input: Annotated[str, Meaning("Channel that drives.")]
    lines: Annotated[int, Meaning("Lines compared, over all configurations.")]
    decibels: Annotated[float, Meaning("Median of the second's magnitude over the first's [dB].")]
    degrees: Annotated[float, Meaning("Median of the second's phase less the first's [degrees].")]
    relative: Annotated[float, Meaning("Median of the difference's magnitude over the first's.")]
    share_within: Annotated[
        float,
        Meaning(
            "Share of the lines whose difference is within the band that both uncertainties make; 0.95 is expected"
            " where they agree. Not a number where one is unknown."
        ),
    ]
    ratio: Annotated[
        float, Meaning("Mean over the lines of the difference's square over its variance; not a number as above.")
    ]
    limit: Annotated[
        float, Meaning("What `ratio` exceeds in 5 % of the comparisons of responses that agree in all elements.")
    ]
    agrees: Annotated[bool | None, Meaning("Whether `ratio` is within `limit`; null where that is unknown.")]


@dataclass(frozen=True)
class Comparison:
    """Two responses held against each other."""

    aligned: Aligned
    elements: tuple[ElementDifference, ...]  # The difference of each element, over all configurations
    # The same for each pair of configurations; the limits are for one of them at a time
    each: tuple[tuple[ElementDifference, ...], ...]
    notes: tuple[str, ...]

    @property
    def agree(self) -> bool | None:
        """Whether all elements agree; None where that is unknown."""
        told = [element.agrees for element in self.elements]
        return None if None in told else all(told)


def compare(first: Frf, second: Frf) -> Comparison:
    """Compares two responses, element by element.

    At a line, `|G2 - G1|^2 / (v1 + v2)` of responses that agree is F distributed with 2 and 2 nu degrees of freedom,
    nu by Satterthwaite from those of both variances. Their mean over N lines is held against F of 2 N and 2 nu, as if
    all lines shared one variance estimate: that errs towards agreement. Lines whose windows overlap count as fewer.

    Args:
        first: What the second is held against.
        second: The other.

    Raises:
        DataError: If they have nothing in common, or channels of one name are something else.

    Source:
        Satterthwaite (1946); Bonferroni over the elements.
    """
    aligned = align(first, second)
    # Lines that share data count as fewer: the limit on the mean has that many fewer degrees of freedom.
    correlation = max(_overlap(first), _overlap(second))
    freedom = _freedom(aligned, first.degrees_of_freedom, second.degrees_of_freedom)
    whole = _differences(first, aligned, freedom, correlation)
    each = tuple(
        _differences(first, _pair(aligned, index), freedom[index : index + 1], correlation)
        for index in range(len(aligned.pairs))
    )
    return Comparison(aligned, whole, each, _notes(first, second, aligned))


def _pair(aligned: Aligned, index: int) -> Aligned:
    by_pair = ("pairs", "first", "second", "first_variance", "second_variance")
    chosen: dict[str, Any] = {name: getattr(aligned, name)[index : index + 1] for name in by_pair}
    return replace(aligned, **chosen)


def _overlap(frf: Frf) -> float:
    """How many lines share the information of one, from the correlation of neighbours."""
    if frf.line_correlation is None:
        return 1.0
    shared = mean_correlation(frf.line_correlation, np.logical_not(dropped_lines(frf).all(axis=2)))
    # The variance of a mean of correlated squares grows by 1 + 2 sum rho^2; squares correlate as rho^2.
    return float(1 + 2 * (shared.mean(axis=0) ** 2).sum())


def _freedom(aligned: Aligned, first: float, second: float) -> FloatArray:
    """Complex degrees of freedom of the difference's variance, line by line (n_pair, n_line, n_out, n_in)."""
    one, other = aligned.first_variance, aligned.second_variance
    # Satterthwaite: v1 + v2 has (v1 + v2)^2 / (v1^2 / nu1 + v2^2 / nu2) degrees of freedom.
    square = one**2 / max(first, np.finfo(float).tiny) + other**2 / max(second, np.finfo(float).tiny)
    return np.asarray(np.divide((one + other) ** 2, square, out=np.full(one.shape, np.nan), where=square > 0))


def _differences(
    first: Frf, aligned: Aligned, freedom: FloatArray, correlation: float
) -> tuple[ElementDifference, ...]:
    n_out, n_in = len(aligned.outputs), len(aligned.inputs)
    difference = np.abs(aligned.second - aligned.first)
    size = np.abs(aligned.first)
    relative = np.divide(difference, size, out=np.full(size.shape, np.nan), where=size > 0)
    # The phase of G2 conj(G1) is the difference of the phases, free of their branches.
    turned = aligned.second * aligned.first.conj()
    moved = np.where(np.isfinite(turned) & (turned != 0), turned, np.nan)
    decibels = 20 * np.log10(np.abs(moved)) - 40 * np.log10(size, out=np.full(size.shape, np.nan), where=size > 0)
    variance = aligned.first_variance + aligned.second_variance
    square = np.divide(difference**2, variance, out=np.full(size.shape, np.nan), where=variance > 0)
    # Quantile of F with 2 and 2 nu degrees of freedom, as in `Frf.radius_factor`.
    limit = freedom * np.expm1(-np.log1p(-LEVEL) / freedom)
    found = []
    for row, column in np.ndindex(n_out, n_in):
        here = (slice(None), slice(None), row, column)
        known = np.isfinite(square[here])
        ratios, lines = square[here][known], int(np.isfinite(difference[here]).sum())
        ratio = float(ratios.mean()) if known.any() else float("nan")
        largest = _limit(len(ratios) / correlation, middle(freedom[here]), n_out * n_in)
        found.append(
            ElementDifference(
                output=first.output_names[aligned.outputs[row][0]],
                input=first.input_names[aligned.inputs[column][0]],
                lines=lines,
                decibels=middle(decibels[here]),
                degrees=middle(np.rad2deg(np.angle(moved[here]))),
                relative=middle(relative[here]),
                share_within=float(np.mean(ratios <= limit[here][known])) if known.any() else float("nan"),
                ratio=ratio,
                limit=largest,
                agrees=None if np.isnan(ratio) else bool(ratio <= largest),
            )
        )
    return tuple(found)


def _limit(lines: float, freedom: float, elements: int) -> float:
    """Quantile of the mean of that many ratios, so that all elements together fail in 5 % of the cases."""
    if lines <= 0 or np.isnan(freedom):
        return float("nan")
    # Bonferroni: each of n elements is tested at 5 % / n.
    return float(f.isf((1 - LEVEL) / elements, 2 * max(lines, 1.0), 2 * freedom))


def _notes(first: Frf, second: Frf, aligned: Aligned) -> tuple[str, ...]:
    """What keeps two responses from agreeing that no noise explains, and what was left out."""
    notes = []
    for side, mine, theirs in (
        ("outputs", first.output_names, second.output_names),
        ("inputs", first.input_names, second.input_names),
    ):
        alone = [name for name in (*mine, *theirs) if name not in mine or name not in theirs]
        notes += [f"Only one of them has the {side} {', '.join(alone)}."] if alone else []
    sizes = len(first.configurations), len(second.configurations)
    if len(aligned.pairs) < max(sizes):
        notes.append(
            f"{len(aligned.pairs)} of {sizes[0]} and {sizes[1]} configurations are at the same positions;"
            " the others are left out."
        )
    if sizes == (1, 1) and not _same_place(first, second):
        notes.append("They were measured at different joint positions.")
    for what, one, other in (
        ("sampling periods", f"{first.sampling_period_s:g} s", f"{second.sampling_period_s:g} s"),
        ("input holds", first.input_hold, second.input_hold),
        ("compensations of friction", first.compensation or "unknown", second.compensation or "unknown"),
        ("covariances", _held(first), _held(second)),
    ):
        notes += [f"Their {what} differ: {one} and {other}."] if one != other else []
    if "noise alone" in (_held(first), _held(second)):
        notes.append(
            "Where an uncertainty contains noise alone, as of one realization, friction and other nonlinearities make"
            " responses differ by more."
        )
    return tuple(notes)


def _same_place(first: Frf, second: Frf) -> bool:
    mine, theirs = first.configurations, second.configurations
    return mine.shape == theirs.shape and bool(np.allclose(mine, theirs, atol=1e-3))


def _held(frf: Frf) -> str:
    if frf.total_covariance is not None:
        return "noise and distortion"
    return "noise alone" if frf.noise_covariance is not None else "unknown"
