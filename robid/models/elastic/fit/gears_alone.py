"""What a gear alone may be: a fit's value is that of the gear with what lies in line with it."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from robid.models.elastic.fit.solution import GearsAlone
from robid.results.estimate import Estimate
from robid.robot.description import Robot

WITH_CHAIN = "gear with what lies in line with it"
"""What a gear's fitted stiffness is."""
_MOST = 0.9  # of a gear's compliance that may lie in line with it
_HALF_MEAN = np.sqrt(2 / np.pi)  # of half a normal distribution


def most_share(share_std: float, confidence: float) -> float:
    """Share of the compliance in line with a gear that is exceeded with the rest of a level only."""
    return min(_MOST, float(norm.ppf(0.5 + 0.5 * confidence)) * share_std)


def gears_alone(robot: Robot, estimate: Estimate) -> GearsAlone | None:
    """Tells what the gears alone may be from the physical intervals and the prior share that is not theirs.

    Args:
        robot: The robot that the fit started from, whose joints say how large the share may be.
        estimate: What the fit found.

    Returns:
        Stiffness of each gear that is estimated, with intervals of the estimate's level; None without any.
    """
    joints = {f"{s.name}.stiffness": s.joint for s in robot.springs if s.place == "transmission"}
    rows = [row for row, name in enumerate(estimate.names) if name in joints]
    if not rows:
        return None
    names = tuple(estimate.names[row] for row in rows)
    std = np.array([robot.joints[joints[name]].nuisance_std.chain_compliance for name in names])
    chain, lower, upper = (each[rows] for each in (estimate.middle, estimate.lower, estimate.upper))
    # With a share s of the chain's compliance in line with it, the gear is k / (1 - s). Nothing but the prior says
    # what s is, half a normal distribution: the gear is stiffer than the chain, never softer. Its lower end is the
    # chain's, where s is zero; upwards both variances add about it, that of s by its square's mean.
    share = np.array([most_share(each, estimate.confidence) for each in std.tolist()])
    above = np.hypot(np.log(np.maximum(upper / chain, 1.0)), -np.log(1 - share))
    value = chain / (1 - np.minimum(_HALF_MEAN * std, _MOST))
    return GearsAlone(names, std, value, lower, chain * np.exp(above))
