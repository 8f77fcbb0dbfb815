"""Local frequency responses, the weighted error of a model against them with its derivative, and their agreement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, Quantity, check_shape
from robid.models.lpv.fit.model import Basis, unit_circle
from robid.models.lpv.fit.state_space import Sizes, resolvent, unpack
from robid.results.levenberg import Minimum, Normal, minimise

_MEANT_NOTHING = 1e-3  # decrease of the cost, in mean squared errors of one element


@dataclass(frozen=True)
class Problem:
    """What a model is held against. Its parameters are packed matrices (n_function + 1, n_local), a row a function."""

    z: ComplexArray  # (n_freq,): points of the unit circle
    response: ComplexArray  # (n_pos, n_freq, n_out, n_in): measured responses
    root_weight: FloatArray  # (n_pos, n_freq, n_out, n_in): root of each element's weight; 0 leaves an element out
    values: FloatArray  # (n_pos, n_function + 1): the basis functions at the positions, the constant one first
    sizes: Sizes  # of the model

    @property
    def n_data(self) -> int:
        """Complex elements that count."""
        return int(np.count_nonzero(self.root_weight))


@dataclass(frozen=True)
class Reduced:
    """Error and derivative with their rows reduced: `|e_q + J_q d|^2 = |right_q + factor_q d|^2 + rest`."""

    # (n_pos, n_local, n_local): triangular factor of each position's derivative by its local matrices.
    factor: FloatArray
    right: FloatArray  # (n_pos, n_local): the error, rotated alike
    cost: float  # the cost, all rows
    values: FloatArray  # (n_pos, n_function + 1): as in the problem

    @property
    def rows(self) -> FloatArray:
        """The derivative (n_pos n_local, n_param) by all parameters."""
        n_pos, n_local = self.right.shape
        full = np.einsum("qk,qij->qikj", self.values, self.factor)
        return np.asarray(full.reshape(n_pos * n_local, -1))


def errors(problem: Problem, parameters: FloatArray) -> ComplexArray:
    """Returns the weighted error (n_pos, n_freq, n_out, n_in) of a model.

    Source:
        Turk et al. (2018), eq. 9.
    """
    system = unpack(problem.values @ parameters, problem.sizes)
    inner = system.C[:, None] @ resolvent(system.A, problem.z) @ system.B[:, None]
    return (inner + system.D[:, None] - problem.response) * problem.root_weight


def cost(problem: Problem, parameters: FloatArray) -> float:
    """Returns the cost `V` of a model.

    Source:
        Turk et al. (2018), eq. 7.
    """
    return float(np.sum(np.abs(errors(problem, parameters)) ** 2))


def local_jacobian(problem: Problem, parameters: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Returns the weighted error (n_pos, n_row) and its derivative (n_pos, n_row, n_local) by the local matrices."""
    local = unpack(problem.values @ parameters, problem.sizes)
    inverse = resolvent(local.A, problem.z)
    ahead, behind = local.C[:, None] @ inverse, inverse @ local.B[:, None]
    error = (ahead @ local.B[:, None] + local.D[:, None] - problem.response) * problem.root_weight
    n_pos, n_freq, n_out, n_in = problem.response.shape
    shape = (n_pos, n_freq, n_out, n_in, problem.sizes.n_local)
    slope = np.zeros(shape, complex)
    parts = problem.sizes.parts
    # dG = C (z - A)^-1 dA (z - A)^-1 B + C (z - A)^-1 dB + dC (z - A)^-1 B + dD, element by element.
    slope[..., parts[0]] = np.einsum("qfoa,qfbi->qfoiab", ahead, behind).reshape(*shape[:4], -1)
    slope[..., parts[1]] = np.einsum("qfoa,ij->qfoiaj", ahead, np.eye(n_in)).reshape(*shape[:4], -1)
    slope[..., parts[2]] = np.einsum("op,qfbi->qfoipb", np.eye(n_out), behind).reshape(*shape[:4], -1)
    slope[..., parts[3]] = np.einsum("op,ij->oipj", np.eye(n_out), np.eye(n_in)).reshape(n_out, n_in, -1)
    slope *= problem.root_weight[..., None]
    return error.reshape(n_pos, -1), slope.reshape(n_pos, -1, problem.sizes.n_local)


def reduce_rows(problem: Problem, parameters: FloatArray) -> Reduced:
    """Reduces error and derivative to as many rows a position as a local model has elements.

    A local derivative does not know the basis functions: only the triangular factors are spread over them.
    """
    error, slope = local_jacobian(problem, parameters)
    n_local = problem.sizes.n_local
    rows = np.concatenate([slope, error[..., None]], axis=2)
    # Parameters are real: real and imaginary parts are rows of their own.
    rows = np.concatenate([rows.real, rows.imag], axis=1)
    short = n_local + 1 - rows.shape[1]
    if short > 0:
        rows = np.concatenate([rows, np.zeros((len(rows), short, n_local + 1))], axis=1)
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    value = float(np.sum(np.abs(error) ** 2))
    return Reduced(triangle[:, :n_local, :n_local], triangle[:, :n_local, n_local], value, problem.values)


def normal(problem: Problem, parameters: FloatArray) -> Normal:
    """Returns cost, half gradient and half Gauss-Newton Hessian by all parameters, row by row."""
    reduced = reduce_rows(problem, parameters)
    rows = reduced.rows
    return Normal(reduced.cost, rows.T @ reduced.right.ravel(), rows.T @ rows)


def solve(
    problem: Problem, start: FloatArray, *, free: BoolArray | None = None, max_iterations: int = 200
) -> tuple[FloatArray, Minimum]:
    """Minimises the cost from a start (n_function + 1, n_local); returns the model, and how the descent ended.

    The states' basis is free, so some directions move no response: the gradient has no part in them, and damping keeps
    them out of every step. Elements that may not move are False in `free`.

    Source:
        Turk et al. (2018), eq. 11.
    """
    moved = np.ones(start.size, bool) if free is None else free.ravel()

    def place(inside: FloatArray) -> FloatArray:
        full = start.ravel().copy()
        full[moved] = inside
        return full.reshape(start.shape)

    def model(inside: FloatArray) -> Normal:
        here = normal(problem, place(inside))
        return Normal(here.cost, here.gradient[moved], here.hessian[np.ix_(moved, moved)])

    found = minimise(
        lambda inside: cost(problem, place(inside)),
        model,
        start.ravel()[moved],
        max_iterations=max_iterations,
        cost_tolerance=_MEANT_NOTHING / max(problem.n_data, 1),
    )
    return place(found.parameters), found


@dataclass(frozen=True)
class LocalResponses:
    """Frequency responses at rest at some positions."""

    points: FloatArray  # (n_pos, n_scheduling): scheduling parameters
    frequency_hz: FloatArray  # (n_freq,): Lines, above zero and below half the sampling rate
    response: ComplexArray  # (n_pos, n_freq, n_out, n_in): responses
    # (n_pos, n_freq, n_out, n_in): `E|G_hat - G|^2`, infinite for an element that is to be left out; None where it is
    # unknown.
    variance: FloatArray | None
    sampling_period_s: float

    def __post_init__(self) -> None:
        check_shape("response", self.response, "n_pos n_freq n_out n_in", n_freq=len(self.frequency_hz))
        check_shape("points", self.points, "n_pos n_scheduling", n_pos=len(self.response))
        if self.variance is not None and self.variance.shape != self.response.shape:
            raise ValueError("Argument `variance` must have the shape of `response`.")
        if not np.all(np.isfinite(self.response)):
            raise ValueError("Argument `response` must be finite; an infinite variance leaves an element out.")
        if not np.all((self.frequency_hz > 0) & (2 * self.frequency_hz * self.sampling_period_s < 1)):
            raise ValueError("Argument `frequency_hz` must lie between zero and half the sampling rate.")

    @property
    def z(self) -> ComplexArray:
        """The lines' points on the unit circle (n_freq,)."""
        return unit_circle(self.frequency_hz, self.sampling_period_s)


def remove_integrators(responses: LocalResponses, integrators: tuple[int, ...]) -> LocalResponses:
    """Multiplies each output's response by `(z - 1) / T` as often as it integrates.

    Source:
        Turk et al. (2018), sec. III-B.
    """
    if len(integrators) != responses.response.shape[2]:
        raise ValueError("Argument `integrators` must have one count per output.")
    # The inverse of integrators behind the outputs.
    factor = ((responses.z[:, None] - 1) / responses.sampling_period_s) ** np.array(integrators)
    variance = None if responses.variance is None else responses.variance * np.abs(factor[..., None]) ** 2
    return replace(responses, response=responses.response * factor[..., None], variance=variance)


def output_scales(responses: LocalResponses) -> FloatArray:
    """Returns the rms (n_out,) of each output's response: in such units, norms of blocks weigh outputs alike."""
    power = np.mean(np.abs(responses.response) ** 2, axis=(0, 1, 3))
    return np.where(power > 0, np.sqrt(power), 1.0)


def smooth_variance(variance: FloatArray, window: int) -> FloatArray:
    """Averages variances (n_pos, n_freq, n_out, n_in) over a window of lines, fewer at the ends; infinite ones stay.

    Variances from a few realizations scatter widely, and so would weights: with three degrees of freedom, estimates
    scatter by 1.4 times the least.
    """
    known = np.isfinite(variance)
    sums = [
        np.cumsum(np.pad(values, ((0, 0), (1, 0), (0, 0), (0, 0))), axis=1)
        for values in (np.where(known, variance, 0.0), known.astype(float))
    ]
    lines = np.arange(variance.shape[1])
    low, high = np.maximum(lines - window // 2, 0), np.minimum(lines + window // 2 + 1, len(lines))
    total, count = (values[:, high] - values[:, low] for values in sums)
    return np.where(known, total / np.maximum(count, 1.0), np.inf)


def make_problem(
    responses: LocalResponses, basis: Basis, n_state: int, scales: FloatArray, *, weighted: bool, window: int = 1
) -> Problem:
    """Poses the fit of responses in units of the outputs' scales; the cost is that of the outputs' own units.

    The scales (n_out,) are units of the outputs. Elements are weighted by `1 / sigma^2`, variances averaged over a
    window of lines, or all alike as in the paper (eq. 7).

    Raises:
        DataError: If a position lies outside the basis' range.
        ValueError: If weights are asked for and the variance is unknown or not positive.
    """
    column = scales[:, None]
    root_weight = np.broadcast_to(column, responses.response.shape)
    if weighted:
        if responses.variance is None or not np.all(responses.variance > 0):
            raise ValueError("Weights need a positive variance of every element.")
        root_weight = column / np.sqrt(smooth_variance(responses.variance, window))
    elif responses.variance is not None:
        root_weight = np.where(np.isinf(responses.variance), 0.0, root_weight)
    n_out, n_in = responses.response.shape[2:]
    values = basis.values(responses.points)
    return Problem(responses.z, responses.response / column, root_weight, values, Sizes(n_state, n_in, n_out))


_DEVIATIONS = 2.0
_CHANCE = 3.0  # deviations of a mean square by which noise may exceed what is expected of it

_ELEMENT = "position output input"


@dataclass(frozen=True)
class Agreement:
    """Measures of each position and element (n_pos, n_out, n_in); NaN for those without weight, or without response."""

    share_within: Annotated[FloatArray, Quantity("1", _ELEMENT, "Share of the lines within two deviations")]
    error_ratio: Annotated[FloatArray, Quantity("1", _ELEMENT, "Error over deviation, root mean square")]
    error_db: Annotated[FloatArray, Quantity("dB", _ELEMENT, "Median distance of the magnitudes")]
    relative_error: Annotated[FloatArray, Quantity("1", _ELEMENT, "Error over response, root mean square")]
    # The same of what noise, and its chance, do not explain, however uncertain the model is, over the response at all
    # positions, or what is natural to the element by the others of its row and column where that is larger: coupling
    # that is hardly there need not be known.
    excess: Annotated[FloatArray, Quantity("1", _ELEMENT, "What deviations do not explain, over what is natural")]


def agree(response: ComplexArray, modelled: ComplexArray, std: FloatArray, noise: FloatArray) -> Agreement:
    """Compares a model with responses (n_pos, n_freq, n_out, n_in).

    `std` is the root of `E|error|^2`, NaN where it is unknown, infinite where an element is left out; of it the
    measurement alone makes `noise`.
    """
    counts = ~np.isinf(std)
    known = counts & (std > 0)
    size = np.abs(modelled - response)
    ratio = np.divide(size, std, out=np.full(size.shape, np.nan), where=known)
    tiny = np.finfo(float).tiny
    levels = [20 * np.log10(np.maximum(np.abs(one), tiny)) for one in (modelled, response)]
    decibels = np.abs(levels[0] - levels[1])
    some = np.asarray(counts.any(axis=1))
    median = np.nanmedian(np.where(counts | ~some[:, None], decibels, np.nan), axis=1)
    power = _mean(np.abs(response) ** 2, counts)
    error = _mean(size**2, counts)
    # Under noise alone the mean square error is its mean variance, and scatters by the root of the summed squares of
    # the variances over the number of lines.
    expected, chance = _of_noise(np.where(known, noise, np.nan), counts)
    return Agreement(
        share_within=_mean((ratio <= _DEVIATIONS).astype(float), known),
        error_ratio=np.sqrt(_mean(ratio**2, known)),
        error_db=np.where(some, median, np.nan),
        relative_error=np.sqrt(np.divide(error, power, out=np.full(power.shape, np.nan), where=power > 0)),
        excess=np.sqrt(np.maximum(error - expected - chance, 0)) / _natural(power),
    )


def hidden_error(response: ComplexArray, std: FloatArray) -> FloatArray:
    """Returns the error (n_pos, n_out, n_in), as of `Agreement.excess`, that chance could hide; as of `agree`."""
    counts = ~np.isinf(std)
    return np.asarray(np.sqrt(_of_noise(std, counts)[1]) / _natural(_mean(np.abs(response) ** 2, counts)))


def expected_share(degrees_of_freedom: float, deviations: float = _DEVIATIONS) -> float:
    """Share of the lines of a perfect model within some deviations that were estimated; NaN where they were not.

    The square of a circular normal error over its estimated variance is F distributed with 2 and 2 nu degrees of
    freedom.
    """
    if degrees_of_freedom <= 0:
        return float("nan")
    return float(-np.expm1(-degrees_of_freedom * np.log1p(deviations**2 / degrees_of_freedom)))


def _of_noise(noise: FloatArray, counts: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean square that noise of each line alone makes, and by how much chance may exceed it."""
    squared = np.where(counts, np.nan_to_num(noise, posinf=0.0), 0.0) ** 2
    expected, fourth = (np.nan_to_num(_mean(power, counts)) for power in (squared, squared**2))
    return expected, np.asarray(_CHANCE * np.sqrt(fourth / np.maximum(counts.sum(axis=1), 1)))


def _natural(power: FloatArray) -> FloatArray:
    """Size (n_out, n_in) of each element over all positions, or what its row and column make of it if that is more.

    A product of a factor of the output and one of the input does not depend on their units.
    """
    size = np.sqrt(np.nanmean(power, axis=0))
    logarithm = np.log(np.maximum(size, np.finfo(float).tiny))
    rows, columns = logarithm.mean(axis=1, keepdims=True), logarithm.mean(axis=0, keepdims=True)
    return np.asarray(np.maximum(size, np.exp(rows + columns - logarithm.mean())))


def _mean(values: FloatArray, chosen: BoolArray) -> FloatArray:
    """Mean over the lines of the chosen elements; NaN where there is none."""
    count = chosen.sum(axis=1)
    total = np.where(chosen, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))
