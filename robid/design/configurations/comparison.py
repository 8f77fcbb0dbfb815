"""What a choice of configurations gives beside those by other criteria and at random."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.prediction import ExpectedError

_DRAWS = 100  # Random choices
_SEED = 1
_FIGURES = ("relative_std", "worst_relative_std", "prediction_error", "noise_error", "bias_error", "resonance_error")


@dataclass(frozen=True)
class Alternative:
    """What one way to choose as many configurations would give."""

    way: str  # A criterion, or `random`, `random_best` and `random_worst`: median, and one in ten better or worse
    relative_std: float  # Median of the wanted parameters' relative deviations
    worst_relative_std: float  # The largest one
    prediction_error: float  # Root mean square relative error that is expected of what the model is to predict
    noise_error: float  # The part of it that noise and what differs between configurations have
    bias_error: float  # The part that what the model lacks has
    resonance_error: float = np.nan  # The same of resonances; NaN where there is none in the band


Deviations: TypeAlias = Callable[[IntArray], FloatArray]
"""Relative deviations (n_wanted,) of the parameters by numbers of experiments (n_cand,)."""


def fitted_deviations(error: ExpectedError, wanted: int) -> Deviations:
    """Those of the first parameters in a fit, with what friction and the like add from place to place."""

    def deviations(counts: IntArray) -> FloatArray:
        variance = np.diagonal(error.covariance(counts), axis1=-2, axis2=-1).mean(axis=0)
        return np.asarray(np.sqrt(variance[:wanted]))

    return deviations


def alternative(
    way: str, error: ExpectedError, counts: IntArray, deviations: Deviations, resonances: ExpectedError | None = None
) -> Alternative:
    """What numbers of experiments (n_cand,) give of the parameters, of the prediction, and of resonances."""
    noise, bias = error.errors(counts)
    std = deviations(counts)
    beside = np.nan if resonances is None else sum(resonances.errors(counts))
    errors = np.sqrt([noise + bias, noise, max(bias, 0.0), beside]).tolist()
    return Alternative(way, float(np.median(std)), float(std.max()), *errors)


def random_alternatives(
    error: ExpectedError,
    count: int,
    experiments: int,
    deviations: Deviations,
    resonances: ExpectedError | None = None,
) -> tuple[Alternative, ...]:
    """The same of configurations drawn at random, their visits shared out evenly: median, best and worst tenth."""
    generator, size = np.random.default_rng(_SEED), error.parts.bread.shape[1]
    found = []
    for _ in range(_DRAWS):
        drawn = generator.choice(size, min(count, size), replace=False)
        counts = np.zeros(size, int)
        np.add.at(counts, drawn[np.arange(experiments) % drawn.size], 1)
        found.append(alternative("random", error, counts, deviations, resonances))
    ways = {"random": 0.5, "random_best": 0.1, "random_worst": 0.9}
    values = {name: [getattr(each, name) for each in found] for name in _FIGURES}
    return tuple(
        Alternative(way, **{name: float(np.quantile(values[name], share)) for name in _FIGURES})
        for way, share in ways.items()
    )


def compare(
    chosen: Mapping[str, Callable[[], IntArray]],
    error: ExpectedError,
    options: DesignOptions,
    deviations: Deviations,
    resonances: ExpectedError | None = None,
) -> tuple[Alternative, ...]:
    """What each way to choose gives, and random choices of as many.

    Args:
        chosen: Numbers of experiments (n_cand,) by each way.
        error: What is expected of them.
        options: How many configurations and experiments.
        deviations: What they promise of the parameters.
        resonances: The same error of resonances, where there are any.
    """
    own = tuple(alternative(way, error, choose(), deviations, resonances) for way, choose in chosen.items())
    size = options.count, options.experiments or options.count
    return (*own, *random_alternatives(error, *size, deviations, resonances))


@dataclass(frozen=True)
class NextVisit:
    """The configuration whose visit helps most, for one purpose."""

    purpose: str  # `parameters`: least volume of the parameters' confidence region; `prediction`: least expected error
    candidate: int  # Its index
    after: Alternative  # What there is with it


def next_visits(
    error: ExpectedError, visited: IntArray, wanted: int, offered: int
) -> tuple[Alternative, tuple[NextVisit, ...]]:
    """What some numbers of experiments (n_cand,) give, and for each purpose the candidate that helps most, if any.

    Args:
        error: What is expected of them.
        visited: Numbers of experiments that were made.
        wanted: Number of parameters, the first ones, that are wanted.
        offered: Number of candidates, the first ones, that may be visited.
    """
    every = np.arange(offered)
    counts = visited + np.eye(offered, visited.size, dtype=int)
    volumes = [_log_volume(error, each, wanted) for each in counts]
    best = {"parameters": int(np.argmin(volumes)), "prediction": int(np.argmax(error.with_each(visited, every)))}
    deviations = fitted_deviations(error, wanted)
    now = alternative("now", error, visited, deviations)
    found = [NextVisit(way, at, alternative(way, error, counts[at], deviations)) for way, at in best.items()]
    # A visit where many were made may draw the fit away from the others.
    helps = min(volumes) < _log_volume(error, visited, wanted), found[1].after.prediction_error < now.prediction_error
    return now, tuple(each for each, good in zip(found, helps, strict=True) if good)


def _log_volume(error: ExpectedError, counts: IntArray, wanted: int) -> float:
    covariance = error.covariance(counts)[:, :wanted, :wanted]
    return float(np.linalg.slogdet(covariance)[1].mean())
