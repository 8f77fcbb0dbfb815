"""How often intervals hold what they are to hold, and how wide they are: plain arithmetic on intervals of springs.

Springs are compared by their logarithms: half an interval from `lower` to `upper` is `log(upper / lower) / 2` wide.
Arrays are (n_robot, n_spring); NaN is a spring that is not counted for a robot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray

_QUANTILE = 0.95
_LEAST = 1e-300


@dataclass(frozen=True)
class Intervals:
    """Intervals of springs.

    Attributes:
        value (n_robot, n_spring): The values that they belong to.
        lower (n_robot, n_spring): Lower ends.
        upper (n_robot, n_spring): Upper ends.
    """

    value: FloatArray
    lower: FloatArray
    upper: FloatArray

    @property
    def half_width(self) -> FloatArray:
        """Half widths (n_robot, n_spring), relative."""
        return np.asarray(0.5 * np.log(np.maximum(self.upper, _LEAST) / np.maximum(self.lower, _LEAST)))


@dataclass(frozen=True)
class Held:
    """Errors of springs against the half widths that are to hold them.

    Attributes:
        inside (n_robot, n_spring): Whether an interval holds what it is to hold.
        counted (n_robot, n_spring): Which of them count.
        error (n_robot, n_spring): Errors, relative.
        half_width (n_robot, n_spring): Half widths.
    """

    inside: BoolArray
    counted: BoolArray
    error: FloatArray
    half_width: FloatArray

    @property
    def coverage(self) -> float:
        """Share of all counted springs of all robots inside their intervals; NaN where none is counted."""
        return float(self.inside[self.counted].mean()) if self.counted.any() else np.nan

    @property
    def coverage_std(self) -> float:
        """Monte Carlo deviation of `coverage`, robots being independent and the springs of one robot not."""
        known = self.counted.sum(axis=1)
        robots = int((known > 0).sum())
        if robots < 2:
            return np.nan
        off = np.where(self.counted, self.inside - self.coverage, 0.0).sum(axis=1)
        return float(np.sqrt(robots / (robots - 1) * (off**2).sum()) / known.sum())

    @property
    def each_spring(self) -> FloatArray:
        """Share of the robots (n_spring,) inside; NaN for springs that are never counted."""
        count = self.counted.sum(axis=0)
        inside = (self.inside & self.counted).sum(axis=0)
        return np.asarray(np.divide(inside, count, out=np.full(count.shape, np.nan), where=count > 0))

    @property
    def worst(self) -> float:
        """The lowest share of any spring; NaN where none is counted."""
        known = self.each_spring[np.isfinite(self.each_spring)]
        return float(known.min()) if known.size else np.nan

    @property
    def width_ratio(self) -> float:
        """Median over the springs of the median half width over the 95 % quantile of the absolute error."""
        ratios = []
        for column in np.flatnonzero(self.counted.any(axis=0)):
            rows = self.counted[:, column]
            quantile = float(np.quantile(np.abs(self.error[rows, column]), _QUANTILE))
            ratios.append(float(np.median(self.half_width[rows, column])) / max(quantile, _LEAST))
        return float(np.median(ratios)) if ratios else np.nan


def physical(found: Intervals, truth: FloatArray, counted: BoolArray) -> Held:
    """Holds intervals against the springs themselves.

    Args:
        found: The intervals.
        truth (n_robot, n_spring): True springs.
        counted (n_robot, n_spring): Which of them count.
    """
    known = counted & np.isfinite(truth) & np.isfinite(found.lower)
    inside = (found.lower <= truth) & (truth <= found.upper)
    return Held(inside & known, known, _log_ratio(found.value, truth, known), found.half_width)


def effective(found: Intervals, reference: Intervals, counted: BoolArray) -> Held:
    """Holds intervals against those of the same robots in other places, the root of both squared.

    Args:
        found: The intervals.
        reference: Those in the places of the reference.
        counted (n_robot, n_spring): Which of them count.
    """
    known = counted & np.isfinite(found.lower) & np.isfinite(reference.lower)
    error = _log_ratio(found.value, reference.value, known)
    half_width = np.hypot(found.half_width, reference.half_width)
    return Held((np.abs(error) <= half_width) & known, known, error, half_width)


def worst_half_widths(found: Intervals, truth: FloatArray, counted: BoolArray) -> FloatArray:
    """Largest distance (n_robot,) of a true spring from the middle of its interval, in half widths; NaN without any."""
    known = counted & np.isfinite(truth) & np.isfinite(found.lower)
    middle = np.sqrt(np.maximum(found.lower, _LEAST)) * np.sqrt(np.maximum(found.upper, _LEAST))
    off = np.abs(_log_ratio(middle, truth, known)) / np.maximum(found.half_width, _LEAST)
    return np.asarray(np.where(known.any(axis=1), np.where(known, off, 0.0).max(axis=1, initial=0.0), np.nan))


def _log_ratio(value: FloatArray, other: FloatArray, known: BoolArray) -> FloatArray:
    ratio = np.divide(value, other, out=np.ones_like(value), where=known)
    return np.asarray(np.where(known, np.log(np.maximum(ratio, _LEAST)), np.nan))
