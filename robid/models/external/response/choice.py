"""Choice of the structure: poles, then integrators, numerators' degrees and the delay, each by evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.models.external.response.denominator import denominator_of
from robid.models.external.response.descent import descend
from robid.models.external.response.evidence import Evidence, make_evidence, scale_of
from robid.models.external.response.lines import Lines
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.orders import Limits, Orders, delay_costs, delay_starts
from robid.models.external.response.residual import Degrees, State

_PERIODS = 5.0  # of the highest line, the longest delay searched
_LEADING = 1.2  # prices of a pole, by which a score may exceed the best for its structure to be looked at further
_MOST_INTEGRATORS = 2
_MORE = 2  # powers of numerators that are tried beyond those of the best structure
_RICH = 8  # poles of the models that delays are looked for with


@dataclass(frozen=True)
class Candidate:
    """A structure that was tried."""

    state: State
    score: float  # cost and price of its parameters
    longest: float | None  # longest delay allowed, in the lines' units; None where it was not estimated

    @property
    def delayed(self) -> bool:
        """Whether its delay was estimated."""
        return self.longest is not None

    @property
    def structure(self) -> tuple[int, Degrees, int, bool, float]:
        """Poles, degrees of numerators, integrators, and the delay where it was not estimated."""
        own = self.state
        return (
            own.denominator.n_pole,
            own.degrees,
            own.denominator.integrators,
            self.delayed,
            0.0 if self.delayed else own.delay,
        )


def choose(lines: Lines, options: ResponseFitOptions) -> list[Candidate]:
    """Finds the best structures, the one with the most evidence first."""
    evidence = make_evidence(lines)
    searches = _searches(lines, options, evidence)
    # Where no model explains the data, their variance is larger than stated: what is over is no evidence for more
    # poles.
    richest = min(
        (scale_of(lines, state, delayed=one.limits.delayed) for one in searches for state in one.best.values()),
        default=1.0,
    )
    evidence = replace(evidence, scale=richest)
    found: list[Candidate] = []
    for one in searches:
        one.evidence = evidence
        found += [
            _judged(state, one.limits, evidence)
            for n_pole, state in one.best.items()
            if options.poles in (None, n_pole)
        ]
    least = min(each.score for each in found)
    for one in searches:
        asked = one.best if options.poles is None else [options.poles]
        for n_pole in asked:
            if one.score(n_pole) < least + _LEADING * evidence.per_pole:
                found += _simplified(lines, one, n_pole, options)
    if options.zeros is None:
        found += _more_zeros(lines, min(found, key=lambda each: each.score), options, evidence)
    return sorted(found, key=lambda each: each.score)


def _searches(lines: Lines, options: ResponseFitOptions, evidence: Evidence) -> list[Orders]:
    """Searches all orders at the delay given, or without a delay and with one."""
    limits = Limits(options.integrators or 0, options.relative_degree, options.zeros, None, options.stable)
    most = min(options.max_poles, most_poles(lines, options)) if options.poles is None else options.poles
    unit = 1.0 if options.time == "discrete" else lines.delay_unit_s
    first = Orders(lines, limits, evidence, [(options.delay or 0.0) / unit])
    first.search(most, to_end=options.poles is not None)
    longest = _longest(lines, options)
    if options.delay is not None or longest <= 0 or lines.n_row <= lines.n_element + 2:
        return [first]
    leading = most if options.poles is not None else min(most, first.leading() + 1 if first.explained() else most)
    if options.time == "discrete":
        return [first, *_sampled_delays(lines, first, evidence, leading, longest)]
    free = replace(limits, longest=longest)
    delays = delay_starts(lines, free, max(min(leading, _RICH), limits.integrators))
    second = Orders(lines, free, evidence, delays, also=first.best)
    second.search(leading, to_end=options.poles is not None)
    return [first, second]


def most_poles(lines: Lines, options: ResponseFitOptions) -> int:
    """The most poles that the number of data allows, a delay besides and one datum left over."""
    # n poles, and n - relative_degree + 1 coefficients for each element, which its own data must determine.
    added = 1 - options.relative_degree
    together = (lines.n_row - 2 - lines.n_element * added) // (lines.n_element + 1)
    alone = 2 * int(np.count_nonzero(lines.weights, axis=1).min()) - 1 - added
    return max(min(together, alone), options.integrators or 0, 0)


def _judged(state: State, limits: Limits, evidence: Evidence) -> Candidate:
    return Candidate(state, evidence.score(state, delayed=limits.delayed), limits.longest)


def _longest(lines: Lines, options: ResponseFitOptions) -> float:
    """The longest delay searched, in the lines' units."""
    if options.max_delay_s is not None:
        return options.max_delay_s / lines.delay_unit_s
    return _PERIODS * 2 * np.pi / float(lines.turn[-1])


def _sampled_delays(lines: Lines, first: Orders, evidence: Evidence, leading: int, longest: float) -> list[Orders]:
    """Searches at whole delays: one, those at which relocated poles explain the data best, and their neighbours."""
    grid = np.arange(1.0, np.floor(longest) + 1)
    if not len(grid):
        return []
    costs = delay_costs(lines, first.limits, max(min(leading, _RICH), first.limits.integrators), grid)
    found: dict[float, Orders] = {}
    queue = [1.0, *(float(grid[index]) for index in np.argsort(costs)[:2])]
    best = first
    while queue:
        delay = queue.pop(0)
        if delay in found or not 1 <= delay <= grid[-1]:
            continue
        one = found[delay] = Orders(lines, first.limits, evidence, [delay], also=first.best)
        one.search(leading, to_end=leading in first.best)
        if one.score(one.leading()) < best.score(best.leading()):
            best = one
            queue += [delay - 1, delay + 1]
    return list(found.values())


def _simplified(lines: Lines, orders: Orders, n_pole: int, options: ResponseFitOptions) -> list[Candidate]:
    """Tries a model with integrators for its slowest poles, and with fewer zeros."""
    limits, evidence = orders.limits, orders.evidence
    state = orders.best[n_pole]
    found = [_judged(state, limits, evidence)]
    starts = [state]
    if options.integrators is None:
        starts += [_integrating(lines, state, limits, count) for count in range(1, min(_MOST_INTEGRATORS, n_pole) + 1)]
    for start in starts:
        one = _judged(start, limits, evidence)
        found.append(one)
        if options.zeros is None and one.score < min(each.score for each in found) + _LEADING * evidence.per_pole:
            found += _fewer_zeros(lines, one, limits, evidence)
    return found


def _integrating(lines: Lines, state: State, limits: Limits, count: int) -> State:
    """Puts integrators in the place of the slowest poles."""
    poles = state.denominator.moving_poles()
    order = np.argsort(np.abs(poles))
    kept = poles[order[count:]]
    # Half a pair that is left becomes real.
    alone = [index for index, pole in enumerate(kept) if not np.isclose(kept, np.conj(pole)).any()]
    kept[alone] = -np.abs(kept[alone])
    return _descended(lines, state, limits, state.degrees, kept, count)


def _descended(
    lines: Lines, state: State, limits: Limits, degrees: Degrees, poles: np.ndarray, integrators: int
) -> State:
    return descend(
        lines,
        denominator_of(poles, integrators),
        state.delay,
        degrees,
        longest=limits.longest,
        stable=limits.stable,
        max_iterations=60,
        tolerance=1e-6,
    )


def _fewer_zeros(lines: Lines, start: Candidate, limits: Limits, evidence: Evidence) -> list[Candidate]:
    """Drops the highest powers of numerators as long as evidence does not miss them."""
    found, best = [], start
    while True:
        state = best.state
        for degrees in _lower(state, evidence):
            trial = _descended(
                lines, state, limits, degrees, state.denominator.moving_poles(), state.denominator.integrators
            )
            one = _judged(trial, limits, evidence)
            found.append(one)
            if one.score < best.score:
                best = one
                break
        else:
            return found


def _more_zeros(lines: Lines, best: Candidate, options: ResponseFitOptions, evidence: Evidence) -> list[Candidate]:
    """Tries the best structure with higher powers of its numerators: small is not excluded."""
    state = best.state
    limits = Limits(state.denominator.integrators, options.relative_degree, None, best.longest, options.stable)
    most = limits.degrees(state.denominator.n_pole, 1)[0]
    poles, found = state.denominator.moving_poles(), []
    for more in range(1, _MORE + 1):
        degrees = tuple(min(degree + more, most) for degree in state.degrees)
        if degrees != state.degrees:
            trial = _descended(lines, state, limits, degrees, poles, state.denominator.integrators)
            found.append(_judged(trial, limits, evidence))
    return found


def _lower(state: State, evidence: Evidence) -> list[Degrees]:
    """Degrees to try: what pays by the coefficients' squares, one less where it costs least, one less everywhere."""
    squares = state.coefficients**2 / evidence.scale
    # Columns are orthonormal: what dropping the last ones costs at these poles is the sum of their squares.
    costs = np.cumsum(squares[:, ::-1], axis=1)[:, ::-1]
    together, alone = [], []
    for element, degree in enumerate(state.degrees):
        kept = np.arange(degree + 1)
        totals = np.append(costs[element, 1 : degree + 1], 0.0) + evidence.per_coefficient * kept
        together.append(int(np.argmin(totals)))
        alone.append(costs[element, degree] if degree else np.inf)
    found = [tuple(together)]
    if min(alone) < np.inf:
        one = int(np.argmin(alone))
        found.append(tuple(degree - (index == one) for index, degree in enumerate(state.degrees)))
    common = tuple(max(degree - 1, 0) for degree in state.degrees)
    return [each for each in dict.fromkeys([*found, common]) if each != state.degrees]
