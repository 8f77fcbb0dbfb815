"""Gears as a fit with encoders on both of their sides found them, for fits that take them as known beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from robid.results.estimate import Estimate


@dataclass(frozen=True)
class KnownGear:
    """A gear alone, without what lies in line with it. Of a gear that slides, N/m and m stand for N m/rad and rad."""

    stiffness: float  # Stiffness without load, middle of its interval [N m/rad]
    stiffness_std: float  # Standard deviation of its logarithm
    cubic: float | None = None  # Cubic coefficient, None where it is not identified [N m/rad^3]
    cubic_std: float = 0.0  # Its standard deviation [N m/rad^3]
    slip: float | None = None  # Torque at which its hysteresis slips, None where it is not identified [N m]
    slip_std: float = 0.0  # Its standard deviation [N m]


def known_gears(estimate: Estimate, joints: Mapping[str, str]) -> dict[str, KnownGear]:
    """Returns the gears whose stiffness is identified, by the name of their spring.

    Deviations are those of the physical intervals, whose ends are a normal quantile away from their middle: of a
    stiffness in its logarithm.

    Args:
        estimate: What a fit of family `transmission` found.
        joints: The joint of each spring of the robot.
    """
    quantile, ends = float(norm.ppf(0.5 + 0.5 * estimate.confidence)), (estimate.lower, estimate.upper)
    identified = dict(zip(estimate.names, estimate.identified.tolist(), strict=True))
    lower, upper, value = (dict(zip(estimate.names, each.tolist(), strict=True)) for each in (*ends, estimate.value))
    found: dict[str, KnownGear] = {}
    for name, kind in zip(estimate.names, estimate.kinds, strict=True):
        if kind != "stiffness" or not identified[name]:
            continue
        spring = name.removesuffix(".stiffness")
        steps = f"{joints.get(spring, spring)}.stiffness_"
        low, high = np.log(lower[name]), np.log(upper[name])
        gear = KnownGear(float(np.exp(0.5 * (low + high))), float(0.5 * (high - low) / quantile))
        for field, more in (("cubic", f"{spring}.cubic"), ("slip", f"{joints.get(spring, spring)}.slip")):
            if identified.get(more, False):
                middle, half = 0.5 * (lower[more] + upper[more]), 0.5 * (upper[more] - lower[more])
                gear = replace(gear, **{field: middle, f"{field}_std": half / quantile})
        found[spring] = _with_steps(gear, [value[name] for name in estimate.names if name.startswith(steps)])
    return found


def _with_steps(gear: KnownGear, stiffness: Sequence[float]) -> KnownGear:
    """A gear whose stiffness rises in steps [N m/rad]: under an unknown load it is anywhere between its first and last.

    Its logarithm is taken as evenly distributed there.
    """
    if not stiffness:
        return gear
    ratio = np.log(max(stiffness) / gear.stiffness)
    std = float(np.hypot(gear.stiffness_std, ratio / np.sqrt(12)))
    return replace(gear, stiffness=float(gear.stiffness * np.exp(0.5 * ratio)), stiffness_std=std)
