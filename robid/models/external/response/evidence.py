"""What evidence a further pole, numerator coefficient or delay must bring, in units of the cost.

A pole that is not there may lie anywhere: the most that it takes from the cost is the largest of about as many chi-
square variables as it has distinguishable places, each with one degree of freedom per numerator coefficient that comes
with it. The Bayesian information criterion, ln(n_row) per coefficient, is close to that for one element; for many
elements it asks for several times as much, since a pole's coefficients are many and its place is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from robid.models.external.response.lines import Lines
from robid.models.external.response.residual import State

_CHANCE_OF_POLE = 0.001  # of a pair that is not there, at all its places
_CHANCE_OF_COEFFICIENT = 0.02  # of a common numerator coefficient that is not there
_CHANCE_OF_MISFIT = 0.01
_TURNS = 2.0  # more that a delay must bring, since it is searched over several turns of the phase
_SLOW = 5.5  # decrease of the cost that speaks for a slow pole against an integrator


@dataclass(frozen=True)
class Evidence:
    """Prices of parameters."""

    per_pole: float  # of a pole with a numerator coefficient for every element
    per_coefficient: float  # of one numerator coefficient
    per_place: float  # what an exact integrator costs less than a pole that may lie anywhere
    per_delay: float  # of a delay
    scale: float = 1.0  # by what costs are divided: above one where no model explains the data

    def price(self, state: State, *, delayed: bool) -> float:
        """The price of a model's parameters."""
        n_pole, n_element = state.denominator.n_pole, len(state.degrees)
        n_coefficient = sum(state.degrees) + n_element
        own = n_pole * (self.per_pole - n_element * self.per_coefficient) + n_coefficient * self.per_coefficient
        return own - self.per_place * state.denominator.integrators + self.per_delay * delayed

    def score(self, state: State, *, delayed: bool) -> float:
        """Cost and price together: of two models that with the lower one has the evidence."""
        return state.cost / self.scale + self.price(state, delayed=delayed)


def make_evidence(lines: Lines, scale: float = 1.0) -> Evidence:
    """Returns the prices for a response."""
    n_element, n_freq = lines.n_element, len(lines.x)
    pair = float(chi2.isf(_CHANCE_OF_POLE / n_freq, 2 * n_element + 1))
    coefficient = float(chi2.isf(_CHANCE_OF_COEFFICIENT, n_element)) / n_element
    one = float(np.log(max(lines.n_row, 3)))
    return Evidence(max(pair / 2, n_element * coefficient + one), coefficient, _SLOW, one + _TURNS, scale)


def n_parameter(state: State, *, delayed: bool) -> int:
    """Number of parameters that were estimated."""
    return sum(state.degrees) + len(state.degrees) + state.denominator.n_moving + delayed


def misfit_of(lines: Lines, state: State, *, delayed: bool) -> tuple[float, float]:
    """Returns cost over its expectation, and the chance of a cost at least as high were model and variance right."""
    freedom = lines.n_row - n_parameter(state, delayed=delayed)
    if freedom <= 0:
        return 1.0, 1.0
    return state.cost / freedom, float(chi2.sf(state.cost, freedom))


def scale_of(lines: Lines, state: State, *, delayed: bool) -> float:
    """Returns by what variances are too small for a model, 1 where its cost is within chance."""
    ratio, chance = misfit_of(lines, state, delayed=delayed)
    return ratio if chance < _CHANCE_OF_MISFIT and ratio > 1 else 1.0
