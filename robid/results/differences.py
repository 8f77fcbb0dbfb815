"""Parameters of two fits beside each other, and which differ by more than their intervals allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.stats import norm

from robid.arrays import Meaning
from robid.results.estimate import Estimate
from robid.robot.parameters import FRICTION_KIND

FALSE_ALARMS = 0.05
"""Share of comparisons of two fits of one robot in which chance alone lets a parameter differ."""


@dataclass(frozen=True)
class ParameterDifference:
    """One parameter in two fits; intervals are those of what predicts."""

    name: Annotated[str, Meaning("Name of the parameter.")]
    kind: Annotated[str, Meaning("Kind of the parameter, as `stiffness`.")]
    unit: Annotated[str, Meaning("SI unit of all values.")]
    first: Annotated[float, Meaning("Estimate of the first fit.")]
    first_interval: Annotated[tuple[float, float], Meaning("Its interval, of what predicts.")]
    second: Annotated[float, Meaning("Estimate of the other fit.")]
    second_interval: Annotated[tuple[float, float], Meaning("Its interval, of what predicts.")]
    relative: Annotated[float, Meaning("The other over the first, less one; the difference where the first is zero.")]
    ratio: Annotated[float, Meaning("Difference over the root of the sum of both squared half widths.")]
    limit: Annotated[float, Meaning("Ratio from which on they differ.")]
    differs: Annotated[
        bool | None, Meaning("Whether they differ by more than the intervals allow; null where an interval is unknown.")
    ]
    identified: Annotated[bool, Meaning("Whether both fits identify it.")]

    @property
    def is_nuisance(self) -> bool:
        """Whether it is friction or ripple that a fit estimates along."""
        return self.kind == FRICTION_KIND


def differences(first: Estimate, other: Estimate) -> tuple[ParameterDifference, ...]:
    """Compares the parameters that two fits share, in the order of the first.

    Intervals of what predicts are compared: what the robot file has wrong is alike in both and says nothing of a
    difference. Half widths are those towards each other. The limit is Bonferroni's: of two fits of one robot some
    parameter differs in one of twenty comparisons.

    Args:
        first: What one fit found.
        other: What the other found, of parameters in the same units.
    """
    shared = [name for name in first.names if name in other.names]
    # Half widths are quantiles of each fit's level; the limit is that of all parameters together, over it.
    level = norm.ppf(0.5 + 0.5 * min(first.confidence, other.confidence))
    limit = float(norm.ppf(1 - 0.5 * FALSE_ALARMS / max(len(shared), 1)) / level)
    return tuple(_difference(first, other, name, limit) for name in shared)


def _difference(first: Estimate, other: Estimate, name: str, limit: float) -> ParameterDifference:
    row, column = first.names.index(name), other.names.index(name)
    one, two = float(first.value[row]), float(other.value[column])
    own, its = _interval(first, row), _interval(other, column)
    half = np.hypot(*((own[1] - one, two - its[0]) if two >= one else (one - own[0], its[1] - two)))
    ratio = abs(two - one) / half if half > 0 else (0.0 if two == one else np.inf)
    return ParameterDifference(
        name=name,
        kind=first.kinds[row],
        unit=first.units[row],
        first=one,
        first_interval=own,
        second=two,
        second_interval=its,
        relative=two / one - 1 if one else two - one,
        ratio=float(ratio),
        limit=limit,
        differs=bool(ratio > limit) if np.isfinite(half) else None,
        identified=bool(first.identified[row] and other.identified[column]),
    )


def _interval(estimate: Estimate, row: int) -> tuple[float, float]:
    low, high = estimate.effective_interval
    return float(low[row]), float(high[row])
