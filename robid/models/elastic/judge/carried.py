"""What a fit freed of what a robot carries and how its torques are scaled, for what mean torques are held against."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray, IntArray
from robid.models.elastic.fit.nuisance.kinds import freeable_nuisances, moved_robot, torque_slopes
from robid.results.estimate import Estimate
from robid.results.plausible.carrier import Carrier, Fitted
from robid.robot.description import Robot
from robid.robot.parameters import DOUBT

_SHARE = 0.01


def fitted_carrier(robot: Robot, estimate: Estimate) -> Fitted | None:
    """Returns a robot with the masses, torque constants and counterbalances that a fit freed.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        estimate: What the fit found.

    Returns:
        The robot, and how far it may be off: as far as the intervals reach, correlated as the estimates are; None
        where the fit freed nothing of the kind.
    """
    doubts = [doubt for doubt in freeable_nuisances(robot) if doubt.name in estimate.names] * (DOUBT in estimate.kinds)
    if not doubts:
        return None
    rows = np.array([estimate.names.index(doubt.name) for doubt in doubts])
    amounts = estimate.value[rows] - np.array([estimate.stated[doubt.name] for doubt in doubts])
    slopes = torque_slopes(doubts, len(robot.joints))

    def carrier(off: FloatArray) -> Carrier:
        return Carrier(moved_robot(robot, doubts, off), np.exp(-off @ slopes))

    directions = _deviations(estimate, rows).T
    return Fitted(carrier(amounts), tuple(carrier(amounts + _SHARE * each) for each in directions), _SHARE)


def _deviations(estimate: Estimate, rows: IntArray) -> FloatArray:
    """Independent directions (n, n_direction) of one standard deviation each in which estimates may be off."""
    value = estimate.value[rows]
    ends = np.maximum(np.abs(estimate.lower[rows] - value), np.abs(estimate.upper[rows] - value))
    covariance = estimate.covariance[np.ix_(rows, rows)]
    own = np.sqrt(covariance.diagonal())
    related = np.eye(len(rows)) if (own <= 0).any() else covariance / np.outer(own, own)
    size, turned = np.linalg.eigh(related)
    spread = turned * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(ends[:, None] / norm.ppf(0.5 + 0.5 * estimate.confidence) * spread)
