"""Search of poles and weights: starts, and from each how far."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.descent import Descent, Point, admit, descend, natural_steps
from robid.models.external.fit.problem import Problem, first_noise, output_sizes, residual_noise
from robid.models.external.fit.reduction import Experiment, build_basis
from robid.models.external.fit.transfer import Held, discretise, propagate, release

_PLAIN_PASSES = 3


def guess(n_pole: int, frequency: float) -> FloatArray:
    """Returns the denominator (n_pole + 1,) of a Butterworth filter of that frequency."""
    angles = np.pi * (2 * np.arange(n_pole) + n_pole + 1) / (2 * n_pole)
    return np.real(np.poly(frequency * np.exp(1j * angles)))


def refine(problem: Problem, denominator: FloatArray, noise: FloatArray, passes: int = 8) -> list[FloatArray]:
    """Improves a denominator by linear least squares on filtered signals, again and again.

    Both sides of `a y = b u` are divided by the last denominator; later passes take the simulated output as instrument,
    which removes the bias that noise gives. Denominators (n_pole + 1,) are in powers of s over the reference frequency,
    one a pass; `noise` (n_shot, n_out) is the deviation of each output's noise in each shot.

    Source:
        Young and Jakeman (1980), "Refined instrumental variable methods of recursive time-series analysis", III.
    """
    structure, period, found = problem.structure, problem.period, []
    for index in range(passes):
        # The prefilter 1 / a(s) of the last pass; as the denominator converges, the equation error becomes that of the
        # output, as output-error fits have it.
        cascade = build_basis(denominator).single
        told, answered = discretise(cascade, period, structure.hold), discretise(cascade, period, "foh")
        # Poles far in the right half plane overflow: nothing of what follows from them would be of use.
        with np.errstate(over="ignore", invalid="ignore"):
            signals = [
                _Filtered(each, told, answered, period, structure.zeros, scale)
                for each, scale in zip(problem.experiments, noise, strict=True)
            ]
            # Least squares first: a simulation by poles that are far off would be no instrument.
            step = _solve(signals, problem.n_in * (structure.zeros + 1), instruments=index >= _PLAIN_PASSES)
        change = np.concatenate([[0.0], step @ cascade.numerators])
        if not np.isfinite(change).all():
            break
        denominator, _ = admit(denominator + change, problem.limit, stable=structure.stable)
        found.append(denominator)
    return found


class _Filtered:
    """What the last denominator makes of one experiment's signals, offset and free response taken out.

    The poles come discretised for commands and, for outputs, which move in straight lines between samples, once more;
    `noise` (n_out,) is the deviation of each output's.
    """

    def __init__(
        self, experiment: Experiment, told: Held, answered: Held, period: float, n_zero: int, noise: FloatArray
    ) -> None:
        self._experiment, self._answered, self._period = experiment, answered, period
        self._scale = 1 / noise[:, None]
        self._local = self._nuisance()
        states = propagate(told, period, experiment.commands, experiment.start)
        last = states[:, -(n_zero + 1) :].reshape(-1, experiment.n_sample)
        places = [moved * (n_zero + 1) + power for moved in experiment.moved for power in range(n_zero + 1)]
        self.places = np.array(places, dtype=int)
        self.told = self._clean(last)
        self.outputs = self._clean(experiment.outputs) * self._scale
        self.answered = self.filter(experiment.outputs * self._scale)

    def filter(self, outputs: FloatArray) -> FloatArray:
        """Filters weighted outputs (n_out, n_sample) to states (n_out, n_pole, n_sample)."""
        return self._clean(propagate(self._answered, self._period, outputs, self._experiment.start))

    def _clean(self, rows: FloatArray) -> FloatArray:
        return np.asarray(rows - (rows @ self._local.T) @ self._local)

    def _nuisance(self) -> FloatArray:
        """Orthonormal rows (n_nuisance, n_sample) of offset and free response."""
        each, rows = self._experiment, []
        if each.offset:
            ones = np.ones((1, each.n_sample))
            states = propagate(self._answered, self._period, ones, "rest")[0]
            rows += [ones] if each.start == "periodic" else [ones, states]
        if each.start == "free":
            rows.append(release(self._answered, self._period, each.n_sample))
        if not rows:
            return np.zeros((0, each.n_sample))
        stacked = np.concatenate(rows)
        return np.asarray(np.linalg.qr((stacked / np.linalg.norm(stacked, axis=1, keepdims=True)).T)[0].T)


def _solve(signals: Sequence[_Filtered], n_told: int, *, instruments: bool) -> FloatArray:
    """Returns the denominator's change (n_pole,) along the states' numerators; NaN where the signals overflow.

    With `instruments` the simulated outputs are instruments for the measured ones.
    """
    n_out, n_pole, _ = signals[0].answered.shape
    gram, pull = np.zeros((n_told, n_told)), np.zeros((n_told, n_out))
    for each in signals:
        gram[np.ix_(each.places, each.places)] += each.told @ each.told.T
        pull[each.places] += each.told @ each.outputs.T
    if not np.isfinite(gram).all():
        return np.full(n_pole, np.nan)
    # Numerators are linear and no unknowns of interest: the Schur complement leaves the normal equations of the
    # denominator.
    inverse = np.linalg.pinv(gram, rcond=1e-14, hermitian=True)
    best = inverse @ pull
    matrix, right = np.zeros((n_pole, n_pole)), np.zeros(n_pole)
    for output in range(n_out):
        cross, cross_told = np.zeros((n_pole, n_told)), np.zeros((n_told, n_pole))
        for each in signals:
            simulated = best[each.places, output] @ each.told
            z = each.filter(simulated[None])[0] if instruments else each.answered[output]
            matrix -= z @ each.answered[output].T
            right += z @ each.outputs[output]
            cross[:, each.places] += z @ each.told.T
            cross_told[each.places] -= each.told @ each.answered[output].T
        matrix -= cross @ inverse @ cross_told
        right -= cross @ inverse @ pull[:, output]
    if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
        return np.full(n_pole, np.nan)
    size = np.sqrt(np.abs(np.diag(matrix)))
    size[size == 0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / np.outer(size, size), right / size, rcond=1e-12)[0] / size)


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

    Starts are denominators (n_pole + 1,) in powers of s over the reference frequency, and with `linear` also found from
    the data; the search sets out from the best `tried` of them and ends where poles move by less than `tolerance`
    deviations of theirs. `is_hopeless` tells after a first try whether more is wasted. The fit comes with the noise
    (n_shot, n_out) that weights it.

    Raises:
        DataError: If no start can be simulated.
    """
    noise = first_noise(problem.experiments) if noise is None else noise
    # Commands tell poles at one level only: no shot may drown the others before the model is about right.
    soft = np.maximum(noise, _SOFT * output_sizes(problem.experiments))
    candidates = [*starts, *(linear_starts(problem, soft) if linear else [])]
    first = _cheapest(problem, candidates, soft)[:tried]
    tries = [descend_from(problem, each.basis.denominator, noise, 0.1, 15) for each in first]
    best = min(tries, key=lambda descent: descent.point.cost)
    if is_hopeless is not None and is_hopeless(best, noise):
        return best, residual_noise(problem.experiments, best.point, noise)
    # Weights are inverse variances of residuals, and residuals depend on weights: to the fixed point, as of maximum
    # likelihood with an unknown variance of each output.
    for _ in range(_WEIGHT_PASSES):
        best = descend_from(problem, best.point.basis.denominator, noise, tolerance, reflected=best.reflected)
        before, noise = noise, residual_noise(problem.experiments, best.point, noise)
        if np.abs(np.log(noise / before)).max() < _WEIGHT_TOLERANCE:
            break
    return best, noise


def _cheapest(problem: Problem, denominators: Sequence[FloatArray], noise: FloatArray) -> list[Point]:
    """The points at some denominators, that of the least cost first."""
    points = [problem.evaluate(each, noise, slopes=False) for each in denominators]
    usable = sorted((each for each in points if each is not None), key=lambda point: point.cost)
    if not usable:
        message = f"D155 no model with {problem.structure.poles} poles can be simulated over the shots"
        raise DataError(message, where="fit", remedy="ask for stable poles, or cut the shots")
    return usable


def settle(problem: Problem, found: Descent, noise: FloatArray) -> Descent:
    """Puts a pole of which samples only tell that it is fast where it answers at once.

    Where it came to rest is chance, and so would be all that moves with it. The deviations `noise` (n_shot, n_out)
    weight it.
    """
    fastest = found.point.basis.single.stages[0]
    if abs(fastest.pole) * problem.period <= np.pi:
        return found
    here = descend_from(problem, found.point.basis.denominator, noise, 1e-3, reflected=found.reflected)
    trial = descend_from(problem, _with_fastest(here.point, problem.limit), noise, 1e-3, reflected=found.reflected)
    worse = (trial.point.cost - here.point.cost) / here.point.cost * problem.n_sample
    return trial if worse <= _ALIKE else here


def slowest_unseen(problem: Problem, point: Point, noise: FloatArray) -> float:
    """Returns about how fast, per sample, the fastest pole must be for samples not to tell it from an immediate answer.

    What a pole of rate x per sample leaves after one falls with exp(-x). The deviations `noise` (n_shot, n_out) weight
    the fit.
    """
    # Its column at the Nyquist frequency, what all others do taken out, says how well a pole there would be seen.
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


def descend_from(
    problem: Problem,
    denominator: FloatArray,
    noise: FloatArray,
    tolerance: float,
    max_iterations: int = 60,
    *,
    reflected: bool = False,
) -> Descent:
    """Searches the poles from a denominator (n_pole + 1,), residuals weighted by deviations `noise` (n_shot, n_out).

    Raises:
        FloatingPointError: If it cannot be simulated there.
    """
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
        found += refine(problem, first, noise)[-2:]
    return found
