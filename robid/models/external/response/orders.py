"""Best poles of every order: upwards from starts and from the residual, then downwards by removal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.response.denominator import Denominator
from robid.models.external.response.descent import descend
from robid.models.external.response.evidence import Evidence, misfit_of
from robid.models.external.response.lines import Lines
from robid.models.external.response.residual import Degrees, State, evaluate
from robid.models.external.response.starts import grown, grown_by_one, relocated, spread_poles, without_each

_COARSE = 1e-3  # relative decrease of the cost per step, at which a start is given up or kept
_FINE = 1e-6
_BEYOND = 3  # orders without evidence after which no more are tried
_EXPLAINED = 1e-3  # chance of a cost, above which it is explained


@dataclass(frozen=True)
class Limits:
    """What all models of a search have in common."""

    integrators: int  # exact ones
    relative_degree: int  # least poles less zeros
    zeros: int | None  # degree of all numerators, if it is given
    longest: float | None  # longest delay, in the lines' units, of those estimated; None where the delay is fixed
    stable: bool

    @property
    def delayed(self) -> bool:
        """Whether the delay is estimated."""
        return self.longest is not None

    def degrees(self, n_pole: int, n_element: int) -> Degrees:
        """The richest numerators of an order."""
        degree = max(n_pole - self.relative_degree, 0)
        return (degree if self.zeros is None else min(self.zeros, degree),) * n_element


@dataclass
class Orders:
    """The best model of each order so far."""

    lines: Lines
    limits: Limits
    evidence: Evidence
    delays: Sequence[float]  # delays to start from, in the lines' units
    also: Mapping[int, State] = field(default_factory=dict)  # models of each order to start from besides
    best: dict[int, State] = field(default_factory=dict)

    def score(self, n_pole: int) -> float:
        """Cost and price of an order."""
        return self.evidence.score(self.best[n_pole], delayed=self.limits.delayed)

    def try_from(self, denominator: Denominator, delay: float, *, fine: bool = False) -> State:
        """Descends from somewhere and keeps what is better."""
        n_pole = denominator.n_pole
        found = descend(
            self.lines,
            denominator,
            delay,
            self.limits.degrees(n_pole, self.lines.n_element),
            longest=self.limits.longest,
            stable=self.limits.stable,
            max_iterations=60 if fine else 25,
            tolerance=_FINE if fine else _COARSE,
        )
        if n_pole not in self.best or found.cost < self.best[n_pole].cost:
            self.best[n_pole] = found
        return found

    def refine(self, n_pole: int) -> None:
        """Descends further from the best model of an order."""
        state = self.best[n_pole]
        self.try_from(state.denominator, state.delay, fine=True)

    def leading(self) -> int:
        """The order with the best score."""
        return min(self.best, key=self.score)

    def explained(self) -> bool:
        """Whether the order with the best score explains the data."""
        return misfit_of(self.lines, self.best[self.leading()], delayed=self.limits.delayed)[1] > _EXPLAINED

    def search(self, last: int, *, to_end: bool = False) -> None:
        """Finds models of rising order, until evidence asks for no more and the data are explained; then of falling."""
        for n_pole in range(self.limits.integrators, last + 1):
            for denominator, delay in self._starts(n_pole):
                self.try_from(denominator, delay)
            self.refine(n_pole)
            if not to_end and n_pole >= self.leading() + _BEYOND and self.explained():
                break
        self.downwards()

    def _starts(self, n_pole: int) -> Iterable[tuple[Denominator, float]]:
        lines, integrators = self.lines, self.limits.integrators
        degrees = self.limits.degrees(n_pole, lines.n_element)
        first = spread_poles(lines, n_pole - integrators, integrators)
        for delay in self.delays:
            yield relocated(lines, first, delay, degrees, stable=self.limits.stable).denominator, delay
        if n_pole in self.also:
            yield self.also[n_pole].denominator, self.also[n_pole].delay if self.limits.delayed else self.delays[0]
        if n_pole - 1 in self.best:
            below = self.best[n_pole - 1]
            yield grown_by_one(lines, below), below.delay
        if n_pole - 2 in self.best:
            below = self.best[n_pole - 2]
            for denominator in grown(lines, below):
                yield denominator, below.delay

    def downwards(self) -> None:
        """Removes from each model the pole or pair that is missed least, and descends from there."""
        for n_pole in sorted(self.best, reverse=True):
            state = self.best[n_pole]
            fewer: dict[int, list[State]] = {}
            for denominator in without_each(state.denominator):
                if denominator.n_pole in self.best:
                    degrees = self.limits.degrees(denominator.n_pole, self.lines.n_element)
                    found = evaluate(self.lines, denominator, state.delay, degrees)
                    fewer.setdefault(denominator.n_pole, []).append(found)
            for count, states in fewer.items():
                before = self.best[count].cost
                for one in sorted(states, key=lambda each: each.cost)[:2]:
                    self.try_from(one.denominator, one.delay)
                if self.best[count].cost < before:
                    self.refine(count)


def delay_starts(lines: Lines, limits: Limits, n_pole: int, step: float = np.pi / 2) -> list[float]:
    """Returns delays to start from, where relocated poles explain the data best.

    The grid turns the phase of the highest line by `step` [rad]; between its points a descent finds its way.
    """
    unit, longest = float(lines.turn[-1]), limits.longest or 0.0
    grid = np.minimum(np.arange(0.0, longest + step / unit, step / unit), longest)
    costs = delay_costs(lines, limits, n_pole, grid)
    return [float(delay) for delay in grid[np.argsort(costs)[:2]]]


def delay_costs(lines: Lines, limits: Limits, n_pole: int, delays: FloatArray) -> list[float]:
    """Returns the costs to which relocated poles come at each delay."""
    degrees = limits.degrees(n_pole, lines.n_element)
    first = spread_poles(lines, n_pole - limits.integrators, limits.integrators)
    return [relocated(lines, first, float(delay), degrees, 4, stable=limits.stable).cost for delay in delays]
