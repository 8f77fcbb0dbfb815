"""Descent of the poles and the delay to a minimum of the weighted residual."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.response.basis import parted
from robid.models.external.response.denominator import Denominator, denominator_of
from robid.models.external.response.lines import Lines
from robid.models.external.response.residual import Degrees, State, as_real, derivatives, evaluate, project
from robid.results.levenberg import Normal, minimise

_LEAST = 1e-9  # that a factor's coefficients may have where poles are kept stable
_ROUNDS = 3


class _Walk:
    """The cost and its quadratic model where a descent goes; the last point is kept, since both are asked for."""

    def __init__(self, lines: Lines, start: State, *, delayed: bool) -> None:
        self.lines, self.start, self.delayed, self.here, self.best = lines, start, delayed, start, start
        self.parameters = start.parameters if delayed else start.denominator.coefficients

    def at(self, parameters: FloatArray) -> State:
        """The state at the parameters."""
        if parameters is not self.parameters and not np.array_equal(parameters, self.parameters):
            first, n_moving = self.start.denominator, self.start.denominator.n_moving
            delay = float(parameters[-1]) if self.delayed else self.start.delay
            denominator = Denominator(first.integrators, first.sizes, parameters[:n_moving])
            self.here = evaluate(self.lines, denominator, delay, self.start.degrees)
            if self.here.cost < self.best.cost:
                self.best = self.here
        self.parameters = parameters
        return self.here

    def cost(self, parameters: FloatArray) -> float:
        """The cost there."""
        return self.at(parameters).cost

    def normal(self, parameters: FloatArray) -> Normal:
        """The cost and its Gauss-Newton model there."""
        return normal_of(self.at(parameters), self.lines, delayed=self.delayed)


def normal_of(state: State, lines: Lines, *, delayed: bool) -> Normal:
    """Builds the Gauss-Newton model of the cost, numerators eliminated."""
    J = as_real(project(state, derivatives(state, lines.turn if delayed else None)))
    r = as_real(parted(state.residual[:, None]))[0]
    return Normal(state.cost, J @ r, J @ J.T)


def descend(
    lines: Lines,
    denominator: Denominator,
    delay: float,
    degrees: Degrees,
    *,
    longest: float | None = None,
    stable: bool = False,
    max_iterations: int = 30,
    tolerance: float = 1e-4,
) -> State:
    """Descends from a denominator and a delay, in the lines' units, with numerators of given degrees.

    The delay stays unless a `longest` one is given; `stable` keeps poles so, and `tolerance` is the relative decrease
    of the cost at which the descent ends.
    """
    lower = np.full(denominator.n_moving, _LEAST if stable else -np.inf)
    coefficients = np.maximum(denominator.coefficients, lower)
    first = evaluate(lines, replace(denominator, coefficients=coefficients), delay, degrees)
    if denominator.n_moving == 0 and longest is None:
        return first
    walk, start, upper = _Walk(lines, first, delayed=longest is not None), coefficients, np.full(len(lower), np.inf)
    if longest is not None:
        start, lower, upper = np.append(start, delay), np.append(lower, 0.0), np.append(upper, longest)
    # Data that a part of the model explains exactly leave nothing to descend on, and a Hessian that is none.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"), suppress(np.linalg.LinAlgError):
        minimise(
            walk.cost,
            walk.normal,
            start,
            cost_tolerance=tolerance,
            max_iterations=max_iterations,
            max_step=np.inf,
            lower=lower,
            upper=upper,
        )
    return walk.best


def polish(lines: Lines, state: State, *, longest: float | None, stable: bool) -> State:
    """Descends to the end, from factors built anew of the poles: what became two real poles meets its neighbours."""
    for _ in range(_ROUNDS):
        before = state.cost
        denominator = denominator_of(state.denominator.moving_poles(), state.denominator.integrators)
        found = descend(
            lines,
            denominator,
            state.delay,
            state.degrees,
            longest=longest,
            stable=stable,
            max_iterations=100,
            tolerance=1e-12,
        )
        state = found if found.cost <= state.cost else state
        if before - state.cost <= 1e-9 * before:
            break
    return state
