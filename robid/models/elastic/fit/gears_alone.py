"""What a gear alone may be: a fit's value is that of the gear with what lies in line with it."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from robid.models.elastic.fit.known_gears import HALF_MEAN, MOST_SHARE, Chain, chain_of
from robid.models.elastic.fit.solution import GearsAlone
from robid.results.estimate import Estimate
from robid.robot.description import Robot, Spring

WITH_CHAIN = "gear with what lies in line with it"
"""What a gear's fitted stiffness is."""


def most_share(share_std: float, confidence: float) -> float:
    """Share of the compliance in line with a gear that is exceeded with the rest of a level only."""
    return min(MOST_SHARE, float(norm.ppf(0.5 + 0.5 * confidence)) * share_std)


def gears_alone(robot: Robot, estimate: Estimate) -> GearsAlone | None:
    """Tells what the gears alone may be from the physical intervals and the prior share that is not theirs.

    Args:
        robot: The robot that the fit started from, whose joints say how large the share may be.
        estimate: What the fit found.

    Returns:
        Stiffness of each gear that is estimated, with intervals of the estimate's level; None without any.
    """
    springs = {f"{s.name}.stiffness": s for s in robot.springs if s.place == "transmission"}
    rows = [row for row, name in enumerate(estimate.names) if name in springs]
    if not rows:
        return None
    names = tuple(estimate.names[row] for row in rows)
    std = np.array([chain_of(robot, springs[name]).share_std for name in names])
    chain, lower, upper = (each[rows] for each in (estimate.middle, estimate.lower, estimate.upper))
    # With a share s of the chain's compliance in line with it, the gear is k / (1 - s). Nothing but the prior says
    # what s is, half a normal distribution: the gear is stiffer than the chain, never softer. Its lower end is the
    # chain's, where s is zero; upwards both variances add about it, that of s by its square's mean.
    share = np.array([most_share(each, estimate.confidence) for each in std.tolist()])
    above = np.hypot(np.log(np.maximum(upper / chain, 1.0)), -np.log(1 - share))
    value = chain / (1 - np.minimum(HALF_MEAN * std, MOST_SHARE))
    found = np.stack([value, lower, chain * np.exp(above)])
    quantile = float(norm.ppf(0.5 + 0.5 * estimate.confidence))
    for column, name in enumerate(names):
        if springs[name].stiffness_std is not None:
            half = 0.5 * np.log(upper[column] / lower[column]) / quantile
            log, own = _known(springs[name], chain_of(robot, springs[name]), np.log(chain[column]), half)
            found[:, column] = np.exp(log + own * quantile * np.array([0.0, -1.0, 1.0]))
    return GearsAlone(names, std, *found)


def _known(spring: Spring, chain: Chain, log_chain: float, std: float) -> tuple[float, float]:
    """Logarithm of the stiffness of a gear alone, and its deviation, where another fit has found that.

    Responses tell of the chain alone: what they add to the gear is its regression on the chain.

    Args:
        spring: The gear with what lies in line, as it was known beforehand.
        chain: What lies in line with it.
        log_chain: Logarithm of what the fit found.
        std: Its standard deviation.
    """
    prior = float(spring.stiffness_std or 0.0) ** 2
    own, std = max(prior - chain.std**2, 0.0), min(std, np.sqrt(prior))
    share = own / prior
    log = np.log(spring.stiffness / chain.factor) + share * (log_chain - np.log(spring.stiffness))
    return float(log), float(np.sqrt(own * (1 - share) + (share * std) ** 2))
