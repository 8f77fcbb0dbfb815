"""Output-error fits of one block of channels with common poles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.fit.external.covariance import Spread, find_spread
from robid.fit.external.descent import Descent, admit, descend
from robid.fit.external.hold import Hold
from robid.fit.external.linear import Numerators, Point, solve
from robid.fit.external.reduction import Experiment, build_basis, prepare, reduce_shots
from robid.fit.external.starting import guess, refine
from robid.fit.external.transfer import TransferMatrix, scaled
from robid.fit.levenberg import Status

if TYPE_CHECKING:
    from robid.fit.external.data import Shot

_FASTEST = 300.0  # per sample: a pole beyond answers at once
_GUESSES = (0.4, 1.5, 5.0)  # times the outputs' own frequency
_SOFT = 0.01  # of an output
_WEIGHT_PASSES = 6
_WEIGHT_TOLERANCE = 0.01


@dataclass(frozen=True)
class Structure:
    """What is fitted.

    Attributes:
        poles: Number of poles.
        zeros: Number of zeros, below that of poles.
        delay_samples: Transport delay in samples.
        moving_average: Samples over which commands are averaged.
        hold: What commands do between samples.
        static_gain_one: Whether static gains are 1 by assumption.
        stable: Whether poles are kept in the left half plane.
    """

    poles: int
    zeros: int
    delay_samples: int = 0
    moving_average: int = 1
    hold: Hold = "zoh"
    static_gain_one: bool = False
    stable: bool = True


@dataclass(frozen=True)
class BlockFit:
    """An output-error fit of one block.

    Attributes:
        model: The transfer functions.
        structure: What was fitted.
        parameters (n_param,): Numerators' coefficients [output, input, power], then the denominator's without the
            first, highest power first, in powers of rad/s.
        covariance_root (n_param, n_root): A root of their covariance, which has more digits than the covariance.
        residuals: Residual (n_sample, n_out) of each shot.
        noise_std (n_shot, n_out): Standard deviation of each output's noise that weights it.
        whiteness (n_shot, n_out): Chance of white noise to look as coloured as each residual.
        degrees_of_freedom: Samples less what was estimated.
        n_free: Number of free parameters of the structure.
        n_sample: Samples of all outputs.
        log_likelihood: Of Gaussian white noise with the residuals' variances.
        cost: Weighted sum of squares.
        status: How the search ended.
        reflected: Whether unstable poles were met and reflected into the left half plane.
    """

    model: TransferMatrix
    structure: Structure
    parameters: FloatArray
    covariance_root: FloatArray
    residuals: tuple[FloatArray, ...]
    noise_std: FloatArray
    whiteness: FloatArray
    degrees_of_freedom: float
    n_free: int
    n_sample: int
    log_likelihood: float
    cost: float
    status: Status
    reflected: bool

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n_param, n_param) of the parameters."""
        return np.asarray(self.covariance_root @ self.covariance_root.T)

    @property
    def bic(self) -> float:
        """Bayesian information criterion; the smaller the better."""
        return self.n_free * float(np.log(self.n_sample)) - 2 * self.log_likelihood


@dataclass(frozen=True)
class Problem:
    """A block's data and structure, in time and frequency over those of a reference frequency.

    Attributes:
        experiments: The experiments.
        structure: What is fitted.
        n_in: Inputs.
        scale: Reference frequency [rad/s].
        sampling_period_s: Sampling period [s].
    """

    experiments: tuple[Experiment, ...]
    structure: Structure
    n_in: int
    scale: float
    sampling_period_s: float

    @property
    def period(self) -> float:
        """Sampling period times the reference frequency."""
        return self.scale * self.sampling_period_s

    @property
    def limit(self) -> float:
        """Largest magnitude of a pole over the reference frequency."""
        return _FASTEST / self.period

    @property
    def sought(self) -> Numerators:
        """The numerators sought."""
        return Numerators(self.structure.zeros, self.structure.static_gain_one)

    @property
    def n_sample(self) -> int:
        """Samples of all outputs."""
        return sum(each.outputs.size for each in self.experiments)

    def evaluate(self, denominator: FloatArray, noise: FloatArray, *, slopes: bool = True) -> Point | None:
        """Returns the best numerators at a denominator (n_pole + 1,); None where it cannot be simulated."""
        basis = build_basis(denominator)
        cascade = basis.double if slopes else basis.single
        with np.errstate(over="ignore", invalid="ignore"):
            reduced = reduce_shots(self.experiments, cascade, self.period, self.structure.hold)
        if not all(np.isfinite(each.triangle).all() for each in reduced):
            return None
        return solve(reduced, basis, self.sought, self.n_in, noise, slopes=slopes)


def fit_block(
    shots: Sequence[Shot],
    inputs: Sequence[int],
    outputs: Sequence[int],
    structure: Structure,
    start: TransferMatrix | None = None,
    *,
    names: tuple[tuple[str, ...], tuple[str, ...]] | None = None,
) -> BlockFit:
    """Fits transfer functions with common poles to what was measured.

    Args:
        shots: Experiments.
        inputs: Which of their inputs.
        outputs: Which of their outputs.
        structure: Numbers of poles and zeros, delay, and the rest of what is held fixed.
        start: A model to start from, beside the starts found from the data.
        names: Names of inputs and outputs.
    """
    problem = pose(shots, inputs, outputs, structure)
    starts = [] if start is None else [scaled(start.denominator, problem.scale)]
    found, noise = search(problem, starts)
    return conclude(problem, found, noise, names or default_names(problem))


def pose(shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure) -> Problem:
    """Prepares the data of a block."""
    experiments = prepare(shots, inputs, outputs, structure.delay_samples, structure.moving_average)
    period = shots[0].sampling_period_s
    return Problem(experiments, structure, len(inputs), _own_frequency(experiments) / period, period)


def _own_frequency(experiments: Sequence[Experiment]) -> float:
    """Root-mean-square frequency of the outputs in radians per sample."""
    shares = [
        np.sum(np.diff(each.outputs, axis=1) ** 2) / max(np.sum(each.outputs**2), np.finfo(float).tiny)
        for each in experiments
    ]
    return float(np.clip(np.sqrt(np.mean(shares)), 1e-6, 1.0))


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
    noise = _first_noise(problem.experiments) if noise is None else noise
    # Commands tell poles at one level only: no shot may drown the others before the model is about right.
    soft = np.maximum(noise, _SOFT * np.array([_size(each) for each in problem.experiments]))
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
    structure, found = problem.structure, []
    for factor in _GUESSES:
        first, _ = admit(guess(structure.poles, factor), problem.limit, stable=structure.stable)
        found.append(first)
        if factor == _GUESSES[0]:
            continue
        options = {"limit": problem.limit, "stable": structure.stable}
        signals = (problem.experiments, first, structure.zeros, problem.n_in, noise)
        found += refine(*signals, problem.period, structure.hold, **options)[-2:]
    return found


def _first_noise(experiments: Sequence[Experiment]) -> FloatArray:
    """Noise (n_shot, n_out) to start with: that of the repeats, or a hundredth of the output where there are none."""
    return np.array([np.where(each.noise > 1e-9 * _size(each), each.noise, 0.01 * _size(each)) for each in experiments])


def _size(experiment: Experiment) -> FloatArray:
    size = np.sqrt(np.mean(experiment.outputs**2, axis=1))
    return np.maximum(size, np.finfo(float).tiny)


def residual_noise(experiments: Sequence[Experiment], point: Point, noise: FloatArray) -> FloatArray:
    """Returns the residual's standard deviation (n_shot, n_out), at least that of the repeats."""
    squares = squares_of(point, noise)
    n_sample = np.array([[each.n_sample] for each in experiments])
    least = np.array([each.noise for each in experiments])
    return np.maximum(np.sqrt(squares / n_sample), least)


def squares_of(point: Point, noise: FloatArray) -> FloatArray:
    """Returns the sum of squares (n_shot, n_out) of each residual."""
    squares = np.zeros(noise.shape)
    for output, left in enumerate(np.split(point.residual, noise.shape[1])):
        ends = np.cumsum([0, *point.n_rows])
        for shot, (first, last) in enumerate(pairwise(ends)):
            squares[shot, output] = np.sum(left[first:last] ** 2) * noise[shot, output] ** 2
    return squares


def conclude(
    problem: Problem, found: Descent, noise: FloatArray, names: tuple[tuple[str, ...], tuple[str, ...]]
) -> BlockFit:
    """Turns a search's end into a fit with its covariance."""
    structure, point = problem.structure, found.point
    spread = find_spread(problem.experiments, point, problem.sought, noise, problem.period, structure.hold)
    model = model_of(problem, point, names)
    powers = _powers(problem, len(names[1]))
    parameters = np.concatenate([model.numerator.ravel(), model.denominator[1:]])
    squares = np.array([np.sum(each**2, axis=0) for each in spread.residuals])
    return BlockFit(
        model=model,
        structure=structure,
        parameters=parameters,
        covariance_root=spread.root * powers[:, None],
        residuals=spread.residuals,
        noise_std=noise,
        whiteness=spread.whiteness,
        degrees_of_freedom=problem.n_sample - float(spread.n_taken.sum()),
        n_free=count_free(problem, len(names[1])),
        n_sample=problem.n_sample,
        log_likelihood=log_likelihood(problem.experiments, squares),
        cost=point.cost,
        status=found.status,
        reflected=found.reflected,
    )


def model_of(problem: Problem, point: Point, names: tuple[tuple[str, ...], tuple[str, ...]]) -> TransferMatrix:
    """Returns the transfer functions of a point in powers of rad/s."""
    structure, n_weight = problem.structure, problem.structure.zeros + 1
    numerators = point.weights @ point.basis.single.numerators[-n_weight:, -n_weight:]
    powers = _powers(problem, len(names[1]))
    return TransferMatrix(
        inputs=names[0],
        outputs=names[1],
        numerator=numerators * powers[: numerators.size].reshape(numerators.shape),
        denominator=np.concatenate([[1.0], point.basis.denominator[1:] * powers[-structure.poles :]]),
        delay_samples=structure.delay_samples,
        moving_average=structure.moving_average,
        sampling_period_s=problem.sampling_period_s,
        hold=structure.hold,
    )


def _powers(problem: Problem, n_out: int) -> FloatArray:
    """What each coefficient (n_param,) in powers of s over the reference frequency is multiplied with."""
    structure = problem.structure
    above = problem.scale ** (structure.poles - np.arange(structure.zeros, -1.0, -1.0))
    below = problem.scale ** np.arange(1.0, structure.poles + 1)
    return np.concatenate([np.tile(above, n_out * problem.n_in), below])


def count_free(problem: Problem, n_out: int) -> int:
    """Returns the number of free parameters, free responses included, offsets not."""
    structure = problem.structure
    diagonal = min(n_out, problem.n_in) if structure.static_gain_one else 0
    loose = sum(each.start == "free" for each in problem.experiments) * n_out * structure.poles
    return n_out * problem.n_in * (structure.zeros + 1) - diagonal + structure.poles + loose


def log_likelihood(experiments: Sequence[Experiment], squares: FloatArray) -> float:
    """Returns the log-likelihood of residuals with sums of squares (n_shot, n_out), each with its own variance."""
    total = 0.0
    for each, own in zip(experiments, squares, strict=True):
        floor = (1e-10 * _size(each)) ** 2
        variance = np.maximum(own / each.n_sample, floor)
        total -= 0.5 * each.n_sample * float(np.sum(np.log(2 * np.pi * variance) + 1))
    return total


def default_names(problem: Problem) -> tuple[tuple[str, ...], tuple[str, ...]]:
    n_out = len(problem.experiments[0].outputs)
    return tuple(f"u{index}" for index in range(problem.n_in)), tuple(f"y{index}" for index in range(n_out))
