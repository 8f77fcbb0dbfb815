"""Individuals of a robot that a study measures: what differs surely over them, and what fits state of each."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.fit.estimate import Estimate

_TIE_LEVEL = 0.95


def differs(one: FloatArray, other: FloatArray) -> bool:
    """Tells whether two figures differ by more than chance over the individuals, which both were measured on.

    Args:
        one (n_seed,): Figures of one model, above 0.
        other (n_seed,): Those of another.

    Returns:
        Whether 0 lies outside the 95 % interval of the mean logarithm of their ratio; never with one individual.
    """
    ratio = np.log(one / other)
    if ratio.size < 2:
        return False
    reach = student.ppf(0.5 + 0.5 * _TIE_LEVEL, ratio.size - 1) * ratio.std(ddof=1) / np.sqrt(ratio.size)
    return bool(abs(ratio.mean()) > reach)


def stated_std(estimate: Estimate) -> FloatArray:
    """Relative deviation (n_param,) whose normal interval is as wide as that of the fit."""
    quantile = norm.ppf(0.5 + 0.5 * estimate.confidence)
    return np.asarray((estimate.upper - estimate.lower) / (2 * quantile * np.abs(estimate.value)))
