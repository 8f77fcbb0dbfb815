"""Two responses held against each other, within what both are known to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f

from robid.arrays import FloatArray
from robid.frf.alignment import Aligned, align
from robid.frf.frf import Frf
from robid.frf.overlap import mean_correlation
from robid.frf.quality import dropped_lines, middle

LEVEL = 0.95


@dataclass(frozen=True)
class ElementDifference:
    """How far the second response is from the first in one element.

    Attributes:
        output: Name of the output.
        input: Name of the input.
        lines: Lines compared, over all configurations.
        decibels: Median of the second's magnitude over the first's [dB].
        degrees: Median of the second's phase less the first's [degrees].
        relative: Median of the difference's magnitude over the first's.
        share_within: Share of the lines whose difference is within the band that both uncertainties make; 0.95 is
            expected where they agree. NaN where one is unknown.
        ratio: Mean over the lines of the difference's square over its variance; NaN where that is unknown.
        limit: What `ratio` exceeds in 5 % of the comparisons of responses that agree in all elements.
    """

    output: str
    input: str
    lines: int
    decibels: float
    degrees: float
    relative: float
    share_within: float
    ratio: float
    limit: float

    @property
    def agrees(self) -> bool | None:
        """Whether the element agrees; None where that is unknown."""
        return None if np.isnan(self.ratio) else self.ratio <= self.limit


@dataclass(frozen=True)
class Comparison:
    """Two responses held against each other.

    Attributes:
        aligned: Both at the same lines.
        elements: The difference of each element, over all configurations.
        each: The same for each pair of configurations; the limits are for one of them at a time.
        notes: What the reader must know.
    """

    aligned: Aligned
    elements: tuple[ElementDifference, ...]
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
    correlation = max(_overlap(first), _overlap(second))
    freedom = _freedom(aligned, first.degrees_of_freedom, second.degrees_of_freedom)
    whole = _differences(first, aligned, freedom, correlation)
    each = tuple(
        _differences(first, _pair(aligned, index), freedom[index : index + 1], correlation)
        for index in range(len(aligned.pairs))
    )
    return Comparison(aligned, whole, each, _notes(first, second, aligned))


def _pair(aligned: Aligned, index: int) -> Aligned:
    chosen = slice(index, index + 1)
    return replace(
        aligned,
        pairs=aligned.pairs[chosen],
        first=aligned.first[chosen],
        second=aligned.second[chosen],
        first_variance=aligned.first_variance[chosen],
        second_variance=aligned.second_variance[chosen],
    )


def _overlap(frf: Frf) -> float:
    """How many lines share the information of one, from the correlation of neighbours."""
    if frf.line_correlation is None:
        return 1.0
    shared = mean_correlation(frf.line_correlation, np.logical_not(dropped_lines(frf).all(axis=2)))
    return float(1 + 2 * (shared.mean(axis=0) ** 2).sum())


def _freedom(aligned: Aligned, first: float, second: float) -> FloatArray:
    """Complex degrees of freedom of the difference's variance, line by line (n_pair, n_line, n_out, n_in)."""
    one, other = aligned.first_variance, aligned.second_variance
    square = one**2 / max(first, np.finfo(float).tiny) + other**2 / max(second, np.finfo(float).tiny)
    return np.asarray(np.divide((one + other) ** 2, square, out=np.full(one.shape, np.nan), where=square > 0))


def _differences(
    first: Frf, aligned: Aligned, freedom: FloatArray, correlation: float
) -> tuple[ElementDifference, ...]:
    n_out, n_in = len(aligned.outputs), len(aligned.inputs)
    difference = np.abs(aligned.second - aligned.first)
    size = np.abs(aligned.first)
    relative = np.divide(difference, size, out=np.full(size.shape, np.nan), where=size > 0)
    turned = aligned.second * aligned.first.conj()
    moved = np.where(np.isfinite(turned) & (turned != 0), turned, np.nan)
    decibels = 20 * np.log10(np.abs(moved)) - 40 * np.log10(size, out=np.full(size.shape, np.nan), where=size > 0)
    variance = aligned.first_variance + aligned.second_variance
    square = np.divide(difference**2, variance, out=np.full(size.shape, np.nan), where=variance > 0)
    limit = freedom * np.expm1(-np.log1p(-LEVEL) / freedom)
    found = []
    for row, column in np.ndindex(n_out, n_in):
        here = (slice(None), slice(None), row, column)
        known = np.isfinite(square[here])
        ratios, lines = square[here][known], int(np.isfinite(difference[here]).sum())
        found.append(
            ElementDifference(
                output=first.output_names[aligned.outputs[row][0]],
                input=first.input_names[aligned.inputs[column][0]],
                lines=lines,
                decibels=middle(decibels[here]),
                degrees=middle(np.rad2deg(np.angle(moved[here]))),
                relative=middle(relative[here]),
                share_within=float(np.mean(ratios <= limit[here][known])) if known.any() else float("nan"),
                ratio=float(ratios.mean()) if known.any() else float("nan"),
                limit=_limit(len(ratios) / correlation, middle(freedom[here]), n_out * n_in),
            )
        )
    return tuple(found)


def _limit(lines: float, freedom: float, elements: int) -> float:
    """Quantile of the mean of that many ratios, so that all elements together fail in 5 % of the cases."""
    if lines <= 0 or np.isnan(freedom):
        return float("nan")
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
            "Where an uncertainty holds noise alone, as of one realization, friction and other nonlinearities make"
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
