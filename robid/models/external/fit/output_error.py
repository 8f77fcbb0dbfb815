"""Output-error fits of one block of channels with common poles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.covariance import find_spread
from robid.models.external.fit.descent import Descent
from robid.models.external.fit.linear import Point
from robid.models.external.fit.problem import Problem, Structure, count_free, log_likelihood, pose
from robid.models.external.fit.search import search, settle, slowest_unseen
from robid.models.external.fit.transfer import TransferMatrix, scaled
from robid.results.levenberg import Status

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot


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
        start: A model with as many poles to start from, instead of starts found from the data.
        names: Names of inputs and outputs.

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
    spread = find_spread(problem.experiments, point, problem.sought, noise, problem.period, structure.hold, unseen)
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


def default_names(problem: Problem) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Returns names of a block's inputs and outputs where none are given."""
    n_out = len(problem.experiments[0].outputs)
    return tuple(f"u{index}" for index in range(problem.n_in)), tuple(f"y{index}" for index in range(n_out))
