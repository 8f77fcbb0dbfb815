"""How far to trust an elastic fit, from its residual and from what it was held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.clusters.evidence import group_places
from robid.models.elastic.fit.intervals import FEWEST_PLACES
from robid.models.elastic.fit.model_error import ModelError
from robid.models.elastic.fit.solution import ElasticSolution
from robid.results.doubt import Doubt, two_digits
from robid.results.grade import Grade, grade_alone, grade_held

_FLOOR = 0.001  # relative errors below move no spring by more than its interval
_EXPECTED, _SIGNIFICANT = 0.05, 3.0  # share of a right model's elements beyond their band, and deviations of it
_MISFIT_LIMIT = 1.5
_DROPPED_LIMIT = 0.5
_WIDE = 1.0


def grade_fit(solution: ElasticSolution, doubts: Sequence[Doubt], failures: Sequence[str] = ()) -> Grade:
    """Grades a fit that was held against nothing but its own data: it predicts at best.

    Args:
        solution: What the fit found.
        doubts: Doubts about its data, its parameters and its residual, the first to blame first.
        failures: What of its own data is beyond the limits of a validation, a clause each.
    """
    return grade_alone((*_unusable(solution, doubts), *failures), _doubtful(solution, doubts), doubts)


def grade_validation(solution: ElasticSolution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades a fit that was held against data that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about its data, its parameters and its residual, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    return grade_held((*_unusable(solution, doubts), *failures), _doubtful(solution, doubts), doubts)


def _unusable(solution: ElasticSolution, doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """Why a fit must not be used, whatever it was held against."""
    found = [doubt.message for doubt in doubts if doubt.decisive]
    if solution.estimate.status != "converged":
        found.append("the fit has not converged")
    share = solution.costs.dropped / solution.costs.told
    if share > _DROPPED_LIMIT:
        found.append(f"{share:.0%} of the response lies below 10 dB")
    springs = np.array([kind == "stiffness" for kind in solution.estimate.kinds])
    chosen = springs if springs.any() else np.ones(springs.size, bool)
    half = (
        0.5
        * (solution.estimate.upper - solution.estimate.lower)[chosen]
        / np.maximum(np.abs(solution.estimate.value[chosen]), 1e-300)
    )
    if not (half < _WIDE).any():
        found.append(f"no {'spring' if springs.any() else 'parameter'} is known to better than its own size")
    return tuple(found)


def _doubtful(solution: ElasticSolution, doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """Why single parameters may be off by more than their intervals say."""
    found = [doubt.message for doubt in doubts if not doubt.decisive and doubt.strength > 1]
    if solution.misfit > _MISFIT_LIMIT:
        found.append(
            f"the residual costs {two_digits(solution.misfit)} times what noise and the assumed model error allow"
        )
    alone = _known_alone(solution)
    few = _too_few(len(group_places(solution.responses.configurations)))
    if few:
        found.append(few)
    elif alone:
        found.append(f"a single place knows {', '.join(alone)}: the others do not test it")
    error = solution.model_error
    if error is not None:
        above, correlated = telling_shares(error)
        if above > _share_limit(error):
            found.append(
                f"the residuals of {above:.0%} of the response's elements are beyond their covariance and those of "
                f"{correlated:.0%} correlated over frequency, by more than {_FLOOR:.1%} of the response"
            )
    return tuple(found)


def _too_few(places: int) -> str:
    """Why so few places do not show what parameters differ by between them, with how many more do."""
    missing = FEWEST_PLACES - places
    if missing <= 0:
        return ""
    measured = "all was measured in a single place" if places == 1 else f"all was measured in {places} places"
    more = f"{missing} more {'configuration' if missing == 1 else 'configurations'}"
    return (
        f"{measured}, and fewer than {FEWEST_PLACES} do not show by how much the model's parameters differ from place "
        f"to place: measure {more}"
    )


def _known_alone(solution: ElasticSolution) -> list[str]:
    """Identified springs that one place knows."""
    estimate = solution.estimate
    if solution.effective is None:
        return []
    columns = estimate.names, estimate.kinds, estimate.identified & solution.effective.untested
    return [name for name, kind, alone in zip(*columns, strict=True) if kind == "stiffness" and alone]


def is_unexplained(solution: ElasticSolution) -> bool:
    """Whether a residual holds so much more than noise that its cause is worth a search."""
    error = solution.model_error
    if solution.misfit > _MISFIT_LIMIT:
        return True
    return error is not None and telling_shares(error)[0] > _share_limit(error)


def _share_limit(error: ModelError) -> float:
    """Share of telling elements that a right model hardly ever has, however few they are."""
    count = max(int(np.isfinite(error.ratio).sum()), 1)
    return _EXPECTED + _SIGNIFICANT * float(np.sqrt(_EXPECTED * (1 - _EXPECTED) / count))


def telling_shares(error: ModelError) -> tuple[float, float]:
    """Shares of the elements above their band, and correlated over frequency, by more than moves any spring."""
    known = np.isfinite(error.ratio)
    if not known.any():
        return 0.0, 0.0
    large = error.level > _FLOOR
    above, correlated = (error.ratio > error.limit) & large, (error.correlation > error.correlation_limit) & large
    return float(above[known].mean()), float(correlated[known].mean())
