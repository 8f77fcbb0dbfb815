"""Holds a position-dependent model against responses that its fit never saw, and says how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, Quantity
from robid.errors import DataError
from robid.models.conclusions import graded_alone, outcome_of
from robid.models.lpv.fit.fitting import hold
from robid.models.lpv.fit.responses import LocalResponses, expected_share, hidden_error
from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.results.finding import Finding
from robid.results.grade import Grade
from robid.results.outcome import Outcome

UNUSABLE = 0.3
"""Error beyond noise, over the response, from which on a model must not be used."""

DOUBTFUL = 0.1
"""The same from which on it is to be doubted."""

MISFIT = 2.0
"""Errors on a fit's own data over their deviation, of the median element, from which single poles are to be doubted."""


def assess_lpv(solution: LpvSolution, told: Sequence[Finding] = ()) -> Grade:
    """Gathers the findings about a fit and grades it by itself: it predicts at best."""
    own = error_findings(solution.own, solution.ports, "the fit's own data")
    choosing = error_findings(solution.choosing, solution.ports, "what chooses the structure")
    return graded_alone([*_own_doubts(solution), *told, *own, *choosing], solution.estimate.status)


def error_findings(held: Held, ports: Ports, where: str) -> Iterator[Finding]:
    """Yields a finding where the error beyond noise is too large, decisive where the model must not be used."""
    worst = float(np.nanmax(held.agreement.excess, initial=0.0))
    if worst > DOUBTFUL:
        told = f"{worst_place(held, ports)} is off by {worst:.0%} beyond noise on {where}, limit {DOUBTFUL:.0%}"
        yield Finding("model", told, decisive=worst > UNUSABLE, strength=worst / DOUBTFUL)


def worst_place(held: Held, ports: Ports) -> str:
    """Names the element and position with the largest error beyond noise."""
    position, output, port = np.unravel_index(int(np.nanargmax(held.agreement.excess)), held.agreement.excess.shape)
    return f"{ports.outputs[output]} by {ports.inputs[port]} at {ports.place(held.points[position])}"


def _own_doubts(solution: LpvSolution) -> Iterator[Finding]:
    """Yields an unstable model, and errors that are not of the size that the covariance says, however small."""
    if solution.largest_pole >= 1:
        told = (
            f"the model is unstable within its range, with a pole of absolute value {solution.largest_pole:.6g} at"
            f" {solution.ports.place(solution.largest_pole_at)}: fit a position there, or take fewer basis functions"
        )
        yield Finding("model", told, decisive=True, strength=3.0)
    ratio = solution.own.agreement.error_ratio
    typical = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 0.0
    if typical > MISFIT:
        told = (
            f"the fit is off by {typical:.3g} deviations of its own data (limit {MISFIT:g}): it may predict as well as"
            " is said, but its poles may be off by more than their intervals"
        )
        yield Finding("model", told, decisive=False, strength=typical / MISFIT)


_SAME_PLACE = 1e-3  # of the range
_SAME_RATE = 1e-6
_ALIKE = "validate on a campaign with the same channels, units and sampling period"


@dataclass(frozen=True)
class LpvValidation:
    """How well a model predicts other responses."""

    outcome: Outcome  # whether it holds, its grade
    held: Held  # the responses, and how well they agree; the deviations of both count
    new: Annotated[BoolArray, Quantity("1", "position", "Whether the fit has not seen it")]


def validate_lpv(
    solution: LpvSolution,
    ports: Ports,
    responses: LocalResponses,
    degrees_of_freedom: float,
    findings: Sequence[Finding] = (),
) -> LpvValidation:
    """Validates a model.

    The limits are absolute: an error beyond noise of 30 % of the response is a failure, one of 10 % a finding.

    Raises:
        DataError: If the channels or the sampling period differ, or a position lies outside the model's range.
    """
    _refuse_other(solution.ports, ports)
    model = solution.response(responses.points, responses.frequency_hz)
    held = hold(responses, model, degrees_of_freedom, seen=False)
    width = np.maximum(solution.basis.upper - solution.basis.lower, np.finfo(float).tiny)
    apart = np.abs(responses.points[:, None] - solution.own.points) / width
    new = np.asarray(apart.max(axis=2).min(axis=1) > _SAME_PLACE)
    worst = float(np.nanmax(held.agreement.excess, initial=0.0))
    failures = (
        (f"{worst_place(held, ports)} is off by {worst:.0%} beyond noise, limit {UNUSABLE:.0%}",)
        if worst > UNUSABLE
        else ()
    )
    found = [finding for finding in error_findings(held, ports, "new data") if not finding.decisive]
    every = [*findings, *found, *_doubts(new, held)]
    return LpvValidation(
        outcome=outcome_of(solution.estimate, every, failures, _verdict(held, failures)), held=held, new=new
    )


def _doubts(new: BoolArray, held: Held) -> Iterator[Finding]:
    if not new.any():
        told = "every position of the validation is one of the fit: nothing was tested in between"
        yield Finding("same_motion", told, decisive=False, strength=2.0)
    worst = float(np.nanmax(hidden_error(held.response, held.std), initial=0.0))
    if worst > UNUSABLE:
        told = f"noise of the new data could hide an error of {worst:.0%}, limit {UNUSABLE:.0%}"
        yield Finding("excitation", told, decisive=False, strength=worst / UNUSABLE)


def _refuse_other(own: Ports, found: Ports) -> None:
    same = (own.inputs, own.input_units, own.outputs, own.output_units) == (
        found.inputs,
        found.input_units,
        found.outputs,
        found.output_units,
    )
    if not same or abs(found.sampling_period_s / own.sampling_period_s - 1) > _SAME_RATE:
        message = "D180 the validation has other channels, units or another sampling period than the fit"
        raise DataError(message, where="validation", remedy=_ALIKE)


def _verdict(held: Held, failures: Sequence[str]) -> str:
    if failures:
        return f"does not predict new data: {'; '.join(failures)}"
    share, worst = held.agreement.share_within, float(np.nanmax(held.agreement.excess, initial=0.0))
    expected = expected_share(held.degrees_of_freedom)
    told = f"predicts new data: off by {worst:.0%} beyond noise at most"
    if np.isfinite(share).any():
        told += f", {np.nanmean(share):.0%} of the lines within 2 deviations"
        told += f" (a perfect model {expected:.0%})" if np.isfinite(expected) else ""
    return told
