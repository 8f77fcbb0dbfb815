"""How long one must measure: deviations over the number of experiments for different choices of configurations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.plan import Exchange
from robid.design.configurations.visits import Visits, make_visits

_VISITS = np.array([1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 21, 28, 35, 42, 49])
_DRAWS = 200
_SEED = 1
_SINGULAR = 1e12
_FLOOR = 1e-9


@dataclass(frozen=True)
class EffortCurves:
    """Deviations of the springs over the number of experiments."""

    experiments: FloatArray  # (n_count,) numbers of experiments
    # Mean relative deviation (n_count,) by choice; infinite where the experiments do not suffice
    average: dict[str, FloatArray]
    worst: dict[str, FloatArray]  # Largest one
    sentence: str  # What follows for who measures
    # Numbers of experiments by choice that reach what the guess reaches with a visit of each
    figures: dict[str, float]


def effort_curves(
    design: ConfigurationDesign, guess: FloatArray, names: tuple[str, ...], per_visit: int
) -> EffortCurves:
    """Predicts deviations over the number of experiments.

    Args:
        design: The design with its candidates' information per visit.
        guess (n_guess, n_param, n_param): Information of the configurations that an engineer chose, per visit.
        names: Names of the guess' parameters; what the design allows them to differ by holds here too.
        per_visit: Experiments of a visit.
    """
    found: dict[str, list[FloatArray]] = {"optimal": [], "guess": [], "random": [], "worst of random": []}
    generator = np.random.default_rng(_SEED)
    candidates = design.visits
    between = dict(zip(design.parameter_names, candidates.between.tolist(), strict=True))
    guessed = make_visits(guess[None, :, None], np.array([between.get(name, 0.0) for name in names]))
    for visits in _VISITS.tolist():
        found["optimal"].append(deviations(_optimal(candidates, visits)))
        found["guess"].append(deviations(_in_turn(guessed, visits)))
        drawn = deviations(np.array([_random(candidates, visits, generator) for _ in range(_DRAWS)]))
        found["random"].append(np.median(drawn, axis=0))
        found["worst of random"].append(np.quantile(drawn, 0.9, axis=0))
    experiments = _VISITS * float(per_visit)
    average = {name: np.array(rows)[:, 0] for name, rows in found.items()}
    worst = {name: np.array(rows)[:, 1] for name, rows in found.items()}
    goal = float(deviations(_in_turn(guessed, len(guess)))[0])
    needed = {name: crossing(experiments, average[name], goal) for name in ("optimal", "random")}
    own = float(len(guess) * per_visit)
    sentence = (
        f"An average deviation of {100 * goal:.2g} %, which the guess reaches with {own:.0f} experiments,"
        f" takes {_count(needed['optimal'])} in optimal configurations and {_count(needed['random'])} in random ones"
        " (median)."
    )
    figures = {f"{name}_experiments": count for name, count in needed.items() if np.isfinite(count)}
    return EffortCurves(experiments, average, worst, sentence, {**figures, "guess_experiments": own})


def deviations(information: FloatArray) -> FloatArray:
    """Mean and largest deviation of log-parameters with some information.

    Args:
        information (..., n_param, n_param): Information.

    Returns:
        Both (..., 2); infinite where the information is singular.
    """
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), np.finfo(float).tiny))
    scaled = information / (scale[..., :, None] * scale[..., None, :])
    singular = np.linalg.cond(scaled) > _SINGULAR
    inverse = np.linalg.inv(np.where(singular[..., None, None], np.eye(scale.shape[-1]), scaled))
    std = np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1)) / scale
    both = np.stack([std.mean(axis=-1), std.max(axis=-1)], axis=-1)
    return np.asarray(np.where(singular[..., None], np.inf, both))


def crossing(experiments: FloatArray, values: FloatArray, goal: float) -> float:
    """Number of experiments at which a curve first falls to a goal, logarithms interpolated; infinite if never."""
    below = np.flatnonzero(values <= goal)
    if below.size == 0:
        return float(np.inf)
    at = int(below[0])
    if at == 0 or not np.isfinite(values[at - 1]):
        return float(experiments[at])
    x, y = np.log(experiments[at - 1 : at + 1]), np.log(values[at - 1 : at + 1])
    return float(np.exp(x[0] + (np.log(goal) - y[0]) * (x[1] - x[0]) / (y[1] - y[0])))


def _count(needed: float) -> str:
    return f"{needed:.0f}" if np.isfinite(needed) else "more than were looked at"


def _optimal(candidates: Visits, visits: int) -> FloatArray:
    """As many visits as tell most, shared out by exchange; few do not determine everything."""
    count, size = candidates.alone.shape[1], candidates.alone.shape[-1]
    base = _FLOOR * candidates.once.sum(axis=1)
    problem = Exchange("d", candidates, base, visits, visits, True, np.ones(count), float(visits), size)
    return _told(candidates, problem.improved(problem.greedy(np.zeros(count, int))))


def _in_turn(guess: Visits, visits: int) -> FloatArray:
    count = guess.alone.shape[1]
    return _told(guess, np.full(count, visits // count) + (np.arange(count) < visits % count))


def _random(candidates: Visits, visits: int, generator: np.random.Generator) -> FloatArray:
    count = candidates.alone.shape[1]
    drawn = generator.choice(count, visits, replace=visits > count)
    return _told(candidates, np.bincount(drawn, minlength=count))


def _told(candidates: Visits, counts: IntArray) -> FloatArray:
    return np.asarray(candidates.total(counts)[0, 0])
