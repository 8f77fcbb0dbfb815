"""Validation of transfer functions on shots that their fit never saw."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.stats import norm

from robid.arrays import Quantity
from robid.errors import DataError
from robid.models.conclusions import outcome_of, refuse_other_rate
from robid.models.external.fit.data import Agreement, Shot, agreements
from robid.models.external.fit.reduction import whiteness
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.plausible import NRMSE_LIMIT, excess_findings, expected_std
from robid.models.external.judge.prediction import (
    NewShots,
    PredictedShot,
    PredictedTraces,
    new_shots,
    novelty_findings,
    predict_shots,
    traces_of,
)
from robid.results.finding import Finding
from robid.results.outcome import Outcome

_OUTSIDE = 3.0  # times as many samples outside the bounds as their level says
_EXPLAINED = 1.2  # of the expected error
_NOISE = ", which noise explains: move farther, or repeat more often"

_SCORE = "1, or as of the output"


@dataclass(frozen=True)
class Bounds:
    """How an output's error compares with its bounds, in the order of the agreements."""

    output: str  # name of the channel, or of the output of a matrix
    place: str  # campaign and configuration
    fpe: float  # Akaike's final prediction error, over the output's variance
    own_nrmse: float  # NRMSE of the fit on its own shots, in the place where it is worst
    parameter_std: float  # root mean square of the prediction's standard deviation by the parameters
    expected_std: float  # error that noise, parameters and the assumed model error give
    inside: float  # share of the samples inside the bounds of parameters and noise
    whiteness_p: float  # chance of a white error to look as coloured


@dataclass(frozen=True)
class ExternalValidation:
    """How well transfer functions predict other motions."""

    outcome: Outcome  # whether they hold, their grade
    agreements: Annotated[tuple[Agreement, ...], Quantity(_SCORE, "agreement", "Agreement, place by place")]
    bounds: Annotated[tuple[Bounds, ...], Quantity(_SCORE, "agreement", "The same against the bounds")]
    traces: PredictedTraces  # measured and predicted outputs
    confidence: float  # level of the bounds
    untested: Annotated[tuple[str, ...], Quantity("1", "block", "Channels that do not move in the validation")]


def validate_external(
    solution: ExternalSolution, shots: Sequence[Shot], findings: Sequence[Finding] = ()
) -> ExternalValidation:
    """Validates transfer functions on new shots.

    The limits are absolute: an NRMSE below 0.9 is a failure, an error beyond what noise, parameters and a model error
    of one per cent of the motion give is a reason for doubt.

    Raises:
        DataError: If the shots are sampled otherwise than those of the fit, or none of its commands moves.
    """
    refuse_other_rate(solution.ports.sampling_period_s, [shot.sampling_period_s for shot in shots])
    found = new_shots(solution, shots)
    if not found:
        message = "D159 none of the fit's commands moves in the validation"
        raise DataError(message, where="validation", remedy="validate on a campaign that excites the same channels")
    traces = [predict_shots(solution, one) for one in found]
    agreed = tuple(each for pair in zip(found, traces, strict=True) for each in _agreements(*pair))
    bounds = tuple(each for pair in zip(found, traces, strict=True) for each in _bounds(solution, *pair))
    tested = {solution.transfers.blocks[one.block] for one in found}
    untested = tuple(name for name in solution.transfers.blocks if name not in tested)
    failures = tuple(
        f"{one.output} is predicted with an NRMSE of {one.nrmse:.3g} in `{one.place}`, limit {NRMSE_LIMIT:g}"
        f"{_NOISE if one.error_std < _EXPLAINED * bound.expected_std else ''}"
        for one, bound in zip(agreed, bounds, strict=True)
        if one.nrmse < NRMSE_LIMIT
    )
    excess = excess_findings(agreed, [one.expected_std for one in bounds])
    every = [*findings, *novelty_findings(solution, found), *excess, *_own_findings(bounds, untested, solution)]
    return ExternalValidation(
        outcome=outcome_of(solution.estimate, every, failures, _verdict(agreed, bounds, failures)),
        agreements=agreed,
        bounds=bounds,
        traces=traces_of(solution, found, traces),
        confidence=solution.estimate.confidence,
        untested=untested,
    )


def _agreements(one: NewShots, traces: Sequence[PredictedShot]) -> tuple[Agreement, ...]:
    measured, errors = [each.measured for each in traces], [each.measured - each.predicted for each in traces]
    found = agreements(one.names, one.shots, one.outputs, measured, errors, one.inputs)
    pairs = list(zip(one.shots, traces, strict=True))

    def noise_std(place: str, output: str) -> float:
        there = [each.noise_std for shot, each in pairs if shot.place == place]
        return float(np.sqrt(np.mean(np.square(there), axis=0))[one.names.index(output)])

    return tuple(replace(each, noise_std=noise_std(each.place, each.output)) for each in found)


def _bounds(solution: ExternalSolution, one: NewShots, traces: Sequence[PredictedShot]) -> Iterator[Bounds]:
    """Yields how the outputs of a block compare with their bounds, place by place."""
    confidence = solution.estimate.confidence
    quantile = norm.ppf(0.5 + 0.5 * confidence)
    for agreed in _agreements(one, traces):
        index = one.names.index(agreed.output)
        there = [each for shot, each in zip(one.shots, traces, strict=True) if shot.place == agreed.place]
        errors = [(each.measured - each.predicted)[:, index] for each in there]
        error, std = np.concatenate(errors), np.concatenate([each.std[:, index] for each in there])
        parameter_std = float(np.sqrt(np.mean(np.concatenate([each.parameter_std[:, index] for each in there]) ** 2)))
        ratio = float(solution.quality.n_parameter[one.block]) / len(error)
        yield Bounds(
            output=agreed.output,
            place=agreed.place,
            fpe=(1 - agreed.nrmse) ** 2 * (1 + ratio) / max(1 - ratio, 1e-3),
            own_nrmse=float(solution.quality.nrmse[solution.quality.first_output[one.block] + index]),
            parameter_std=parameter_std,
            expected_std=expected_std(agreed, parameter_std),
            inside=float(np.mean(np.abs(error) <= quantile * std)),
            whiteness_p=min(whiteness(each, np.zeros(len(each) // 2, bool), 0.0) for each in errors),
        )


def _own_findings(bounds: Sequence[Bounds], untested: Sequence[str], solution: ExternalSolution) -> Iterator[Finding]:
    """Findings about bounds that hold far fewer samples than their level says, and about what did not move."""
    confidence, worst = solution.estimate.confidence, min(bounds, key=lambda one: one.inside)
    excess = (1 - worst.inside) / (1 - confidence)
    if excess > _OUTSIDE:
        told = (
            f"{worst.inside:.0%} of the samples of {worst.output} lie inside the {confidence:.0%} bounds"
            f" ({worst.place}): the intervals do not hold what the model lacks"
        )
        yield Finding("model", told, decisive=False, strength=excess / _OUTSIDE)
    if untested:
        told = f"{', '.join(untested)} do not move in the validation: nothing was tested of them"
        yield Finding("excitation", told, decisive=False, strength=2.0)


def _verdict(agreed: Sequence[Agreement], bounds: Sequence[Bounds], failures: Sequence[str]) -> str:
    if failures:
        return f"does not predict new motions: {'; '.join(failures)}"
    worst = min(agreed, key=lambda one: one.nrmse)
    return (
        f"predicts new motions: NRMSE {worst.nrmse:.3g} or more ({worst.output}), "
        f"{min(one.inside for one in bounds):.0%} of the samples or more inside their bounds"
    )
