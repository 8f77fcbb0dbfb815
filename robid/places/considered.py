"""What doubts that are not estimated leave open of the parameters."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.places.evidence import Evidence
from robid.places.saturation import inverted, saturated


def considered_covariance(evidence: Evidence, between: FloatArray, prior: FloatArray) -> FloatArray:
    """Covariance (n_own, n_own) by doubts that are alike in all places and stay at their nominal values.

    It adds to the covariance of the parameters themselves.

    Args:
        evidence: What each place says of the parameters and, after them, the doubts.
        between (n_own + n_doubt,): Variance of each between places; that of a doubt is what it differs there.
        prior (n_doubt, n_doubt): Covariance of what the doubts may be off in all places alike.

    Source:
        Schmidt (1966), considered parameters: `K C K'` with `K = -A^-1 Re(J^H W h)`.
    """
    n_own = len(evidence.pull) - len(prior)
    total = saturated(evidence, between).information.sum(axis=0)
    covariance, _ = inverted(total[:n_own, :n_own] + evidence.precision[:n_own, :n_own])
    gain = -covariance @ total[:n_own, n_own:]
    return np.asarray(gain @ prior @ gain.T)
