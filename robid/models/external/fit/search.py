"""Search of poles and weights: from where, how far, and when enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.descent import Descent, admit, descend
from robid.models.external.fit.linear import Point, natural_steps
from robid.models.external.fit.problem import Problem, first_noise, output_size, residual_noise
from robid.models.external.fit.starting import guess, refine

_GUESSES = (0.4, 1.5, 5.0)  # times the outputs' own frequency
_SOFT = 0.01  # of an output
_ALIKE = 4.0  # rise of the cost, in variances
_UNSEEN = 20.0
_WEIGHT_PASSES = 6
_WEIGHT_TOLERANCE = 0.01


def search(
    problem: Problem,
    starts: Sequence[FloatArray] = (),
    noise: FloatArray | None = None,
    is_hopeless: Callable[[Descent, FloatArray], bool] | None = None,
    *,
    linear: bool = True,
    tried: int = 2,
    tolerance: float = 1e-3,
) -> tuple[Descent, FloatArray]:
    """Searches poles and weights.

    Args:
        problem: Data and structure.
        starts: Denominators (n_pole + 1,) to start from, in powers of s over the reference frequency.
        noise (n_shot, n_out): Weights' standard deviations to start with.
        is_hopeless: Tells after a first try whether more is wasted.
        linear: Whether starts are also found from the data.
        tried: From how many of the best starts the search sets out.
        tolerance: Move of the poles, in standard deviations of theirs, that ends the search.

    Returns:
        The fit and the noise (n_shot, n_out) that weights it.

    Raises:
        DataError: If no start can be simulated.
    """
    noise = first_noise(problem.experiments) if noise is None else noise
    # Commands tell poles at one level only: no shot may drown the others before the model is about right.
    soft = np.maximum(noise, _SOFT * np.array([output_size(each) for each in problem.experiments]))
    candidates = [*starts, *(linear_starts(problem, soft) if linear else [])]
    points = [problem.evaluate(each, soft, slopes=False) for each in candidates]
    usable = sorted((each for each in points if each is not None), key=lambda point: point.cost)
    if not usable:
        message = f"no model with {problem.structure.poles} poles can be simulated over the shots"
        raise DataError(message, where="fit", remedy="ask for stable poles, or cut the shots")
    tries = [_descend(problem, each.basis.denominator, noise, 0.1, 15) for each in usable[:tried]]
    best = min(tries, key=lambda descent: descent.point.cost)
    if is_hopeless is not None and is_hopeless(best, noise):
        return best, residual_noise(problem.experiments, best.point, noise)
    for _ in range(_WEIGHT_PASSES):
        best = _descend(problem, best.point.basis.denominator, noise, tolerance, reflected=best.reflected)
        before, noise = noise, residual_noise(problem.experiments, best.point, noise)
        if np.abs(np.log(noise / before)).max() < _WEIGHT_TOLERANCE:
            break
    return best, noise


def settle(problem: Problem, found: Descent, noise: FloatArray) -> Descent:
    """Puts a pole of which samples only tell that it is fast where it answers at once.

    Where it came to rest is chance, and so would be all that moves with it.

    Args:
        problem: Data and structure.
        found: Where the search ended.
        noise (n_shot, n_out): Weights' standard deviations.
    """
    fastest = found.point.basis.single.stages[0]
    if abs(fastest.pole) * problem.period <= np.pi:
        return found
    here = _descend(problem, found.point.basis.denominator, noise, 1e-3, reflected=found.reflected)
    trial = _descend(problem, _with_fastest(here.point, problem.limit), noise, 1e-3, reflected=found.reflected)
    worse = (trial.point.cost - here.point.cost) / here.point.cost * problem.n_sample
    return trial if worse <= _ALIKE else here


def slowest_unseen(problem: Problem, point: Point, noise: FloatArray) -> float:
    """Returns about how fast, per sample, the fastest pole must be for samples not to tell it from an immediate answer.

    What a pole of rate x per sample leaves after one falls with exp(-x).

    Args:
        problem: Data and structure.
        point: The fit.
        noise (n_shot, n_out): Weights' standard deviations.
    """
    seen = problem.evaluate(_with_fastest(point, np.pi / problem.period), noise)
    if seen is None:
        return float(np.pi)
    slopes = seen.slope * natural_steps(seen)
    triangle = np.linalg.qr(np.roll(slopes, -1, axis=1))[1]
    strength = abs(triangle[-1, -1]) / (np.pi * np.exp(-np.pi))
    return float(np.clip(np.log(max(strength, 1.0)), np.pi, _UNSEEN))


def _with_fastest(point: Point, size: float) -> FloatArray:
    """The denominator (n_pole + 1,) with its fastest pole or pair moved to a magnitude."""
    poles = [stage.pole for stage in point.basis.single.stages]
    poles[0] *= size / abs(poles[0])
    whole = [each for pole in poles for each in ([pole, pole.conjugate()] if pole.imag else [pole])]
    return np.real(np.poly(whole))


def _descend(
    problem: Problem,
    denominator: FloatArray,
    noise: FloatArray,
    tolerance: float,
    max_iterations: int = 60,
    *,
    reflected: bool = False,
) -> Descent:
    first = problem.evaluate(denominator, noise)
    if first is None:
        raise FloatingPointError
    signals = zip(problem.experiments, noise, strict=True)
    power = sum(float(np.sum((each.outputs / scale[:, None]) ** 2)) for each, scale in signals)
    found = descend(
        lambda trial: problem.evaluate(trial, noise),
        first,
        problem.limit,
        n_row=problem.n_sample,
        stable=problem.structure.stable,
        tolerance=tolerance,
        max_iterations=max_iterations,
        floor=1e-26 * power,
    )
    return replace(found, reflected=found.reflected or reflected)


def linear_starts(problem: Problem, noise: FloatArray) -> list[FloatArray]:
    """Returns denominators (n_pole + 1,) to start from: low-passes about the band, refined by linear least squares."""
    structure = problem.structure
    found: list[FloatArray] = []
    for factor in _GUESSES:
        first, _ = admit(guess(structure.poles, factor), problem.limit, stable=structure.stable)
        found.append(first)
        if factor == _GUESSES[0]:
            continue
        found += refine(
            problem.experiments,
            first,
            structure.zeros,
            problem.n_in,
            noise,
            problem.period,
            structure.hold,
            limit=problem.limit,
            stable=structure.stable,
        )[-2:]
    return found
