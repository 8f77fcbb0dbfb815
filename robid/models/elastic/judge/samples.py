"""What the samples of speeds may be other than stated: values at instants or differences, each put in its place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.signals.quantities import SampledName

_STEPS = 25


@dataclass(frozen=True)
class SamplesTrial:
    """What other samples of the speeds do to a fit.

    Attributes:
        names: The speeds.
        sampled: What their samples would be.
        share: Share of the residual's cost that it takes away.
        moved (n_param,): How far it moves the internal parameters.
    """

    names: tuple[str, ...]
    sampled: SampledName
    share: float
    moved: FloatArray


def try_samples(fitted: FittedModel) -> SamplesTrial | None:
    """Takes all speeds for what they are not said to be, and lets the fit follow.

    Half a sample of delay tells them apart where no delay is estimated, and the size of high lines where it is.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.

    Returns:
        The samples that explain most; None where no speed was measured, or nothing explains more than what is stated.
    """
    before = fitted.problem.cost(fitted.internal)
    found = [_try(fitted, sampled, problem, before) for sampled, problem in _others(fitted.problem)]
    best = max(found, key=lambda trial: trial.share, default=None)
    return best if best is not None and best.share > 0 else None


def _others(problem: Problem) -> Iterator[tuple[SampledName, Problem]]:
    """Other samples of all speeds, and the same problem with them."""
    frf, channels = problem.frf, problem.frf.measured_channels
    omega, period_s = 2 * np.pi * frf.frequency_hz, frf.sampling_period_s
    stated = {channel.sampled for channel in channels if channel.quantity == "speed"}
    names: tuple[SampledName, ...] = get_args(SampledName)
    for sampled in (name for name in names if name != "filtered" and stated and stated != {name}):
        told = tuple(replace(one, sampled=sampled) if one.quantity == "speed" else one for one in channels)
        new, old = (
            np.stack([each.to_acceleration(omega, period_s) for each in every], axis=-1) for every in (told, channels)
        )
        factor = new / old
        other = replace(
            frf,
            measured_channels=told,
            response=frf.response * factor[..., None],
            sensitivity=frf.sensitivity * factor[..., None],
        )
        # Relative residuals have the same errors, plain ones errors that are larger by the factor.
        scale = problem.residual_kind.divisor(factor) / factor
        whitening = problem.whitening
        if whitening is not None:
            whitening = whitening * np.repeat(scale, frf.response.shape[-1], axis=-1)[:, None]
        yield (
            sampled,
            replace(
                problem,
                frf=other,
                model=replace(problem.model, rates=other.output_rates),
                weight=problem.weight * np.abs(scale[..., None]) ** 2,
                whitening=whitening,
            ),
        )


def _try(fitted: FittedModel, sampled: SampledName, problem: Problem, before: float) -> SamplesTrial:
    end = optimise(problem, fitted.internal, max_iterations=_STEPS)
    names = tuple(one.name for one in problem.frf.measured_channels if one.quantity == "speed")
    return SamplesTrial(names, sampled, 1 - end.cost / before, end.parameters - fitted.internal)
