"""Output-error fits of one block of channels with common poles, of one structure and of all that are tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.covariance import find_spread
from robid.models.external.fit.descent import Descent, Point
from robid.models.external.fit.problem import Problem, Structure, count_free, log_likelihood, pose, squares_of
from robid.models.external.fit.reduction import excited_lines, whiteness
from robid.models.external.fit.search import search, settle, slowest_unseen
from robid.models.external.fit.transfer import TransferMatrix, delayed, discretise, propagate, release, scaled
from robid.results.levenberg import Status

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot


@dataclass(frozen=True)
class BlockFit:
    """An output-error fit of one block."""

    model: TransferMatrix  # the transfer functions
    structure: Structure  # what was fitted
    # (n_param,): numerators' coefficients [output, input, power], then the denominator's without the first, highest
    # power first, in powers of rad/s.
    parameters: FloatArray
    # (n_param, n_root): a root of their covariance, which has more digits than the covariance.
    covariance_root: FloatArray
    residuals: tuple[FloatArray, ...]  # residual (n_sample, n_out) of each shot
    noise_std: FloatArray  # (n_shot, n_out): standard deviation of each output's noise that weights it
    whiteness: FloatArray  # (n_shot, n_out): chance of white noise to look as coloured as each residual
    degrees_of_freedom: float  # samples less what was estimated
    n_free: int  # number of free parameters of the structure
    n_sample: int  # samples of all outputs
    log_likelihood: float  # of Gaussian white noise with the residuals' variances
    cost: float  # weighted sum of squares
    status: Status  # how the search ended
    reflected: bool  # whether unstable poles were met and reflected into the left half plane

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n_param, n_param) of the parameters."""
        return np.asarray(self.covariance_root @ self.covariance_root.T)

    @property
    def bic(self) -> float:
        """Bayesian information criterion; the smaller the better."""
        return self.n_free * float(np.log(self.n_sample)) - 2 * self.log_likelihood


def fit_block(
    shots: Sequence[Shot],
    inputs: Sequence[int],
    outputs: Sequence[int],
    structure: Structure,
    start: TransferMatrix | None = None,
    *,
    names: tuple[tuple[str, ...], tuple[str, ...]] | None = None,
) -> BlockFit:
    """Fits transfer functions with common poles to what was measured, from a start, or from starts found from the data.

    Raises:
        ValueError: If the structure is none.
        DataError: If the shots cannot tell it.
    """
    problem = pose(shots, inputs, outputs, structure)
    starts = [] if start is None else [scaled(start.denominator, problem.scale)]
    found, noise = search(problem, starts, linear=start is None)
    return conclude(problem, settle(problem, found, noise), noise, names or default_names(problem))


def conclude(
    problem: Problem, found: Descent, noise: FloatArray, names: tuple[tuple[str, ...], tuple[str, ...]]
) -> BlockFit:
    """Turns a search's end into a fit with its covariance."""
    structure, point = problem.structure, found.point
    unseen = slowest_unseen(problem, point, noise)
    spread = find_spread(problem, point, noise, unseen)
    model = model_of(problem, point, names)
    powers = powers_of(problem, len(names[1]))
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
    powers = powers_of(problem, len(names[1]))
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


def powers_of(problem: Problem, n_out: int) -> FloatArray:
    """Returns what each coefficient (n_param,) in powers of s over the reference frequency is multiplied with."""
    structure = problem.structure
    above = problem.scale ** (structure.poles - np.arange(structure.zeros, -1.0, -1.0))
    below = problem.scale ** np.arange(1.0, structure.poles + 1)
    return np.concatenate([np.tile(above, n_out * problem.n_in), below])


def default_names(problem: Problem) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns names of a block's inputs and outputs where none are given."""
    n_out = len(problem.experiments[0].outputs)
    return tuple(f"u{index}" for index in range(problem.n_in)), tuple(f"y{index}" for index in range(n_out))


def predict(model: TransferMatrix, shot: Shot, inputs: Sequence[int], outputs: Sequence[int]) -> FloatArray:
    """Simulates a shot's outputs (n_sample, n_out) by a block's model.

    What no model knows beforehand, an offset and the state that a free start begins in, is taken from the shot itself.
    """
    commands = delayed(shot.inputs[:, list(inputs)], model.delay_samples, model.moving_average, shot.start)
    cascade, weights, scale = model.cascade()
    period = model.sampling_period_s * scale
    held = discretise(cascade, period, model.hold)
    simulated = np.einsum("oik,ikt->to", weights, propagate(held, period, commands, shot.start))
    rows: list[FloatArray] = []
    if shot.offset:
        rows.append(np.ones((1, len(simulated))))
    if shot.start == "free":
        rows.append(release(held, period, len(simulated)))
    if not rows:
        return np.asarray(simulated)
    local = np.concatenate(rows).T
    size = np.linalg.norm(local, axis=0)
    missing = shot.outputs[:, list(outputs)] - simulated
    added = np.linalg.lstsq(local / np.where(size > 0, size, 1.0), missing, rcond=1e-12)[0]
    return np.asarray(simulated + local / np.where(size > 0, size, 1.0) @ added)


def nrmse(measured: FloatArray, simulated: FloatArray) -> FloatArray:
    """Returns `1 - |y - f| / |y - mean y|` of each output (n_out,) of signals (n_sample, n_out); 1 is perfect.

    An output at rest is described perfectly by a model that rests, and by no other.

    Source:
        Oliveira et al. (2019), Table 2.
    """
    left = np.linalg.norm(measured - simulated, axis=0)
    whole = np.linalg.norm(measured - measured.mean(axis=0), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(left == 0, 1.0, 1 - left / whole))


_ADDED = (0.3, 1.0, 3.0)  # times the outputs' own frequency, a pole that a zero cancels is added
_TOLERANCE = 0.1  # standard deviations of the poles that no criterion notices
_FAR = 10.0  # per sample, a pole is added that nearly answers at once


@dataclass(frozen=True)
class Candidate:
    """One structure tried."""

    structure: Structure
    model: TransferMatrix  # its best transfer functions
    noise: FloatArray  # (n_shot, n_out): standard deviations of the residuals that weighted them
    bic: float  # Bayesian information criterion; the smaller the better
    nrmse: float  # least normalised fit of any output and shot held back, or of the shots of the fit where none was
    whiteness: float  # least chance of white noise to look as coloured as a residual of the fit, times their number
    status: Status  # how the search ended


class Candidates:
    """Fits structures to the same shots.

    A structure that is worse than the best criterion so far by `hopeless` is worth no more than a first try.
    """

    def __init__(
        self,
        shots: Sequence[Shot],
        inputs: Sequence[int],
        outputs: Sequence[int],
        common: Structure,
        held_back: Sequence[Shot] = (),
        hopeless: float = np.inf,
    ) -> None:
        self._shots, self._inputs, self._outputs = shots, inputs, outputs
        self._common, self._held_back = common, held_back
        self._hopeless = hopeless
        self._found: dict[tuple[int, int, int], Candidate] = {}

    @property
    def tried(self) -> tuple[Candidate, ...]:
        """All that were tried, by delay, poles and zeros."""
        keys = sorted(self._found, key=lambda key: (key[2], key[0], key[1]))
        return tuple(self._found[key] for key in keys)

    def fit(self, poles: int, zeros: int, delay: int) -> Candidate:
        """Returns the fit of a structure."""
        key = (poles, zeros, delay)
        if key not in self._found:
            self._found[key] = self._fit(replace(self._common, poles=poles, zeros=zeros, delay_samples=delay))
        return self._found[key]

    def _fit(self, structure: Structure) -> Candidate:
        problem = pose(self._shots, self._inputs, self._outputs, structure)
        alike = [scaled(each.model.denominator, problem.scale) for each in self._alike(structure)]
        starts = [*alike, *self._extended(problem)]
        best = min(self._found.values(), key=lambda each: each.bic, default=None)
        noise = None if best is None else best.noise

        def is_hopeless(descent: Descent, noise: FloatArray) -> bool:
            if best is None:
                return False
            likelihood = log_likelihood(problem.experiments, squares_of(descent.point, noise))
            return self._criterion(problem, likelihood) > best.bic + self._hopeless

        tried = 1 if alike else 2
        found, weights = search(
            problem, starts, noise, is_hopeless, linear=not alike, tried=tried, tolerance=_TOLERANCE
        )
        return self._judge(problem, model_of(problem, found.point, default_names(problem)), weights, found.status)

    def _criterion(self, problem: Problem, likelihood: float) -> float:
        return count_free(problem, len(self._outputs)) * float(np.log(problem.n_sample)) - 2 * likelihood

    def _judge(self, problem: Problem, model: TransferMatrix, noise: FloatArray, status: Status) -> Candidate:
        measured = [shot.outputs[:, list(self._outputs)] for shot in self._shots]
        residuals = [
            each - predict(model, shot, self._inputs, self._outputs)
            for each, shot in zip(measured, self._shots, strict=True)
        ]
        likelihood = log_likelihood(problem.experiments, np.array([np.sum(each**2, axis=0) for each in residuals]))
        taken = count_free(problem, noise.shape[1]) / noise.size
        chances = [
            whiteness(left, excited_lines(experiment), taken)
            for experiment, each in zip(problem.experiments, residuals, strict=True)
            for left in each.T
        ]
        return Candidate(
            structure=problem.structure,
            model=model,
            noise=noise,
            bic=self._criterion(problem, likelihood),
            nrmse=self._nrmse(model),
            whiteness=min(1.0, len(chances) * min(chances)),
            status=status,
        )

    def _nrmse(self, model: TransferMatrix) -> float:
        shots = self._held_back or self._shots
        return min(
            float(nrmse(shot.outputs[:, list(self._outputs)], predict(model, shot, self._inputs, self._outputs)).min())
            for shot in shots
        )

    def _alike(self, structure: Structure) -> Iterator[Candidate]:
        """Fits with as many poles and nearly the same zeros and delay."""
        poles, zeros, delay = structure.poles, structure.zeros, structure.delay_samples
        near = [(poles, zeros + 1, delay), (poles, zeros, delay - 1), (poles, zeros, delay + 1)]
        return (self._found[key] for key in near if key in self._found)

    def _extended(self, problem: Problem) -> Iterator[FloatArray]:
        """Denominators of fits with a pole less, with one that a zero cancels or one that answers nearly at once."""
        poles, zeros, delay = problem.structure.poles, problem.structure.zeros, problem.structure.delay_samples
        for lower, added in ((zeros - 1, _ADDED), (zeros, (_FAR / problem.period,))):
            if (poles - 1, lower, delay) in self._found:
                known = scaled(self._found[poles - 1, lower, delay].model.denominator, problem.scale)
                for place in added:
                    yield np.convolve(known, [1.0, place])
