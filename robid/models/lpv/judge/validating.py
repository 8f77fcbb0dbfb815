"""Holds a position-dependent model against responses that its fit never saw."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, Quantity
from robid.errors import DataError
from robid.models.lpv.fit.agreement import expected_share, hidden_error
from robid.models.lpv.fit.fitting import hold
from robid.models.lpv.fit.responses import LocalResponses
from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.models.lpv.judge.grading import UNUSABLE, error_doubts, grade_lpv, worst_place
from robid.results.doubt import Doubt
from robid.results.outcome import Outcome, recover

_SAME_PLACE = 1e-3  # of the range
_SAME_RATE = 1e-6
_ALIKE = "validate on a campaign with the same channels, units and sampling period"


@dataclass(frozen=True)
class LpvValidation:
    """How well a model predicts other responses.

    Attributes:
        outcome: Whether it holds, its grade.
        held: The responses, and how well they agree; the deviations of both count.
    """

    outcome: Outcome
    held: Held
    new: Annotated[BoolArray, Quantity("1", "position", "Whether the fit has not seen it")]


def validate_lpv(
    solution: LpvSolution,
    ports: Ports,
    responses: LocalResponses,
    degrees_of_freedom: float,
    doubts: Sequence[Doubt] = (),
) -> LpvValidation:
    """Validates a model.

    The limits are absolute: an error beyond noise of 30 % of the response is a failure, one of 10 % a doubt.

    Args:
        solution: What the fit found.
        ports: Channels of the responses.
        responses: What was measured anew.
        degrees_of_freedom: Behind its variances.
        doubts: Doubts about the fit.

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
    found = [doubt for doubt in error_doubts(held, ports, "new data") if not doubt.decisive]
    every = [*doubts, *found, *_seen(new), *_hidden(held)]
    return LpvValidation(
        outcome=Outcome(
            ok=not failures,
            verdict=_verdict(held, failures),
            grade=grade_lpv(solution, every, failures),
            recovery=recover(solution.estimate, {}),
        ),
        held=held,
        new=new,
    )


def _seen(new: BoolArray) -> Iterator[Doubt]:
    if not new.any():
        told = "every position of the validation is one of the fit: nothing was tested in between"
        yield Doubt("same_motion", told, decisive=False, strength=2.0)


def _hidden(held: Held) -> Iterator[Doubt]:
    worst = float(np.nanmax(hidden_error(held.response, held.std), initial=0.0))
    if worst > UNUSABLE:
        told = f"noise of the new data could hide an error of {worst:.0%}, limit {UNUSABLE:.0%}"
        yield Doubt("excitation", told, decisive=False, strength=worst / UNUSABLE)


def _refuse_other(own: Ports, found: Ports) -> None:
    same = (own.inputs, own.input_units, own.outputs, own.output_units) == (
        found.inputs,
        found.input_units,
        found.outputs,
        found.output_units,
    )
    if not same or abs(found.sampling_period_s / own.sampling_period_s - 1) > _SAME_RATE:
        message = "the validation has other channels, units or another sampling period than the fit"
        raise DataError(message, where="validation", remedy=_ALIKE)


def _verdict(held: Held, failures: Sequence[str]) -> str:
    if failures:
        return f"does not hold on new data: {'; '.join(failures)}"
    share, worst = held.agreement.share_within, float(np.nanmax(held.agreement.excess, initial=0.0))
    expected = expected_share(held.degrees_of_freedom)
    told = f"holds on new data: off by {worst:.0%} beyond noise at most"
    if np.isfinite(share).any():
        told += f", {np.nanmean(share):.0%} of the lines within 2 deviations"
        told += f" (a perfect model {expected:.0%})" if np.isfinite(expected) else ""
    return told
