"""Parameter covariance: the sandwich, from the structured covariance or realizations, and the bootstrap."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import norm, t

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_clusters, spread_over
from robid.models.elastic.fit.problem import Problem
from robid.robot.collocated import motor_rows


@dataclass(frozen=True)
class Influence:
    """How errors of the response's elements move the internal parameters, to first order.

    An error `e` of the response moves the parameters by `inverse Re(sum conj(gain) e)`.
    """

    gain: ComplexArray  # (n_conf, n_freq, n_out, n_in, n_param) Weighted derivative over the residual's divisor
    weighted: ComplexArray  # (n_conf, n_freq, n_out, n_in, n_param) Weighted derivative of the residual
    inverse: FloatArray  # (n_param, n_param) Inverse of half the Gauss-Newton Hessian, with what is known beforehand
    prior: FloatArray  # (n_param,) What is known beforehand, as it adds to half the Hessian's diagonal
    leverage: FloatArray  # (n_conf, n_freq, n_out, n_in) Share of each residual that the fit takes away

    def shifts(self, errors: ComplexArray) -> FloatArray:
        """Moves (n_conf, ..., n_param) by errors (n_conf, ..., n_freq, n_out, n_in), each configuration's alone."""
        size = len(errors), -1, int(np.prod(self.gain.shape[1:4]))
        moved = np.real(errors.reshape(size) @ self.gain.reshape(size[0], size[2], -1).conj()) @ self.inverse
        return np.asarray(moved.reshape(*errors.shape[:-3], -1))


def influence(problem: Problem, internal: FloatArray) -> Influence:
    """Linearises the estimator.

    Args:
        problem: The problem with its weights.
        internal (n_param,): Where to linearise.

    Source:
        Wernholt and Moberg (2008), eq. 5; of the magnitude alone the real parts of the logarithm's derivatives.
    """
    _, derivative = problem.linear(internal)
    # With J the residual's derivative and W its weights, half the Gauss-Newton Hessian is Re(J^H W J) and half the
    # precision of what is known beforehand.
    weighted = problem.fully_weighted(derivative)
    n_param = derivative.shape[-1]
    prior = 0.5 / problem.parameters.prior_std**2
    bread = np.real(derivative.reshape(-1, n_param).conj().T @ weighted.reshape(-1, n_param))
    inverse = np.linalg.pinv(bread + np.diag(prior), rcond=1e-14, hermitian=True)
    # The diagonal of the hat matrix: the share of its own error that the fit follows.
    leverage = np.real(np.einsum("cfoip,cfoip->cfoi", weighted.conj() @ inverse, derivative))
    # The residual moves with the response by one over its divisor: the chain rule from errors of the response to the
    # score.
    gain = weighted / problem.residual_kind.divisor(problem.measured(internal)).conj()[..., None]
    return Influence(gain, weighted, inverse, prior, leverage)


def sandwich(problem: Problem, internal: FloatArray) -> FloatArray:
    """Covariance of the internal parameters, a model error assumed by the weights included.

    Args:
        problem: The problem, whose response carries the structured covariance.
        internal (n_param,): Where to evaluate.

    Returns:
        Covariance (n_param, n_param); directions the data do not determine come out large, not infinite.

    Source:
        Wernholt and Moberg (2008), eq. 5 divided by the number of lines, and its logarithmic forms.
    """
    return structured_covariance(problem, influence(problem, internal))


def structured_covariance(problem: Problem, found: Influence) -> FloatArray:
    """The sandwich (n_param, n_param) of an estimator that is linearised already.

    The assumed model error is the model's, which is reciprocal: element (i, j) of motors has the same one as (j, i).
    """
    # The sandwich. The score is twice Re(J^H W e) and the inverse that of half the Hessian: hence a quarter. What is
    # known beforehand pulls by an error of its own deviation, whose covariance is half its entry in the Hessian.
    meat = 0.5 * score_covariance(problem, found).sum(axis=0)
    return np.asarray(0.5 * found.inverse @ (meat + np.diag(found.prior)) @ found.inverse)


def score_covariance(problem: Problem, found: Influence) -> FloatArray:
    """Covariance (n_conf, n_param, n_param) of what the errors of each configuration pull at the parameters.

    The pull is twice the weighted residuals' real product with their derivative: the slope of the log-likelihood
    where the weights are right. Noise is each configuration's own; the assumed model error is the model's, the same
    however often a cluster is measured, so what a configuration shares with others in its cluster is in it too.
    """
    n_conf, n_param = len(found.gain), found.gain.shape[-1]
    # What a relative error of the model does to the score, element by element; in a cluster it is the same one in each
    # configuration, so scores there are correlated.
    relative = problem.residual_kind.per_relative(problem.frf.response)
    error = problem.model_error[..., None] * found.weighted * relative.conj()[..., None]
    assumed = _parts(_reciprocal(error, motor_rows(problem.model)).reshape(n_conf, -1, n_param))
    clusters, shared = group_clusters(problem.frf.configurations), assumed
    if len(clusters) < n_conf:
        shared = spread_over(clusters, np.array([assumed[cluster].sum(axis=0) for cluster in clusters]))
    scaled = found.gain * np.sqrt(problem.frf.scale)[..., None]
    # The covariance of a response is a product over outputs, inputs and lines. A root of each factor is applied in
    # turn, so that the whole matrix is never formed.
    rows = np.einsum("cfop,cfpiq->cfoiq", _root(problem.frf.covariance), scaled, optimize=True)
    rows = np.einsum("cfij,cfojq->cfoiq", _root(problem.frf.input_factor), rows, optimize=True)
    if problem.frf.line_correlation is not None:
        rows = np.einsum("cfg,cgoiq->cfoiq", _root(_whole(problem.frf.line_correlation)), rows, optimize=True)
    noise = _parts(rows.reshape(n_conf, -1, n_param))
    return np.asarray(2 * (np.swapaxes(noise, 1, 2) @ noise + np.swapaxes(assumed, 1, 2) @ shared))


def _parts(rows: ComplexArray) -> FloatArray:
    """Real over imaginary parts: their product is the real part of that of complex rows, in half the time."""
    return np.concatenate([rows.real, rows.imag], axis=1)


def _root(covariance: ComplexArray) -> ComplexArray:
    """Matrices R (..., n, n) whose `R^H R` is a covariance; what truncation made negative counts as nothing."""
    # To a unit diagonal first: outputs differ by decades, and no truncation may drop the small ones.
    size = np.sqrt(np.real(np.diagonal(covariance, axis1=-2, axis2=-1)))
    divisor = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / (divisor[..., :, None] * divisor[..., None, :]))
    root = (vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]) @ vectors.conj().swapaxes(-1, -2)
    return np.asarray(root * size[..., None, :])


def _whole(correlation: FloatArray) -> ComplexArray:
    """Correlation (n_conf, n_freq, n_freq) of all lines' errors, from that with the next ones."""
    n_conf, n_freq, n_next = correlation.shape
    whole = np.zeros((n_conf, n_freq, n_freq)) + 0.5 * np.eye(n_freq)
    for ahead in range(1, min(n_next, n_freq - 1) + 1):
        here = np.arange(n_freq - ahead)
        whole[:, here, here + ahead] = correlation[:, : n_freq - ahead, ahead - 1]
    return (whole + whole.swapaxes(1, 2)).astype(complex)


def _reciprocal(effect: ComplexArray, rows: dict[int, int]) -> ComplexArray:
    """Adds what one error does at two elements (n_conf, n_freq, n_out, n_in, n_param) that share it, into one of both.

    Args:
        effect: What each element's own error does.
        rows: Output of each motor that is measured at itself.
    """
    shared = effect.copy()
    for first, second in combinations(rows, 2):
        shared[:, :, rows[first], second] += shared[:, :, rows[second], first]
        shared[:, :, rows[second], first] = 0.0
    return shared


def realization_shifts(problem: Problem, found: Influence) -> FloatArray | None:
    """What each realization's own error does to the parameters.

    Their squares sum to the covariance without any assumption about how a realization's errors are correlated over
    lines and elements; few realizations of few configurations make it uncertain instead.

    Returns:
        Moves (n_conf, n_real, n_param), scaled for the freedom that the mean took; None without realizations.
    """
    errors = problem.frf.realization_error
    if errors is None:
        return None
    n_real = errors.shape[1]
    return np.asarray(np.sqrt(n_real / (n_real - 1)) * found.shifts(errors))


def realization_covariance(found: Influence, shifts: FloatArray) -> FloatArray:
    """Covariance (n_param, n_param) that the moves of `realization_shifts` and what was known beforehand give."""
    flat = shifts.reshape(-1, shifts.shape[-1])
    return np.asarray(flat.T @ flat + 0.5 * (found.inverse * found.prior) @ found.inverse)


def realization_freedom(shifts: FloatArray) -> FloatArray:
    """Degrees of freedom (n_param,) behind the variance of each parameter that moves of realizations give.

    Source:
        Satterthwaite (1946), each configuration a variance with one freedom less than it has realizations.
    """
    # A variance of n realizations has n - 1 degrees of freedom, hence itself the variance 2 s^4 / (n - 1); that of a
    # sum is the sum of these.
    variance = (shifts**2).sum(axis=1)
    own = (variance**2).sum(axis=0) / (shifts.shape[1] - 1)
    total = variance.sum(axis=0) ** 2
    return np.asarray(np.divide(total, own, out=np.full_like(total, np.inf), where=own > 0))


def cubic_covariance(problem: Problem, internal: FloatArray, inverse: FloatArray, weighted: ComplexArray) -> FloatArray:
    """Covariance that errors of the gears' slopes give, one for each gear and robot configuration.

    Between configurations everything else changes too, and a model that is off by so much in each of them feigns a
    cubic gear. Only loads that differ by far more, as gravity's do, or that differ in one and the same
    configuration, as those of two amplitudes do, tell it from a linear one. The error is the one that the weights
    assume of the response.

    Args:
        problem: The problem; without cubic coefficients there is no such nuisance.
        internal (n_param,): Where to evaluate.
        inverse (n_param, n_param): Inverse of half the Gauss-Newton Hessian.
        weighted (n_conf, n_freq, n_out, n_in, n_param): Weighted derivative of the residual.

    Returns:
        Covariance (n_param, n_param) of the internal parameters.
    """
    parameters = problem.parameters
    total = np.zeros_like(inverse)
    owners = [name.removesuffix("cubic") for name in parameters.elements if name.endswith(".cubic")]
    names = [f"{owner}stiffness" for owner in owners if f"{owner}stiffness" in parameters.elements]
    columns = [int(parameters.member[parameters.elements.index(name)]) for name in names]
    if not columns:
        return total
    own = problem.linear(internal)[1][..., columns]
    pulls = np.real(np.einsum("cfoip,cfoiq->cpq", weighted.conj(), own, optimize=True))
    # An error of the slope of each gear, alike within a cluster and independent between them, shifts the parameters as
    # an error of the response would that is this slope's derivative.
    relative = np.sqrt(np.mean(problem.model_error**2))
    for cluster in group_clusters(problem.frf.configurations):
        shift = relative * inverse @ pulls[cluster].sum(axis=0)
        total += shift @ shift.T
    return total


Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]

_FURTHER_STEPS = 1
_LONGEST_STEP = 1.0
_CHUNK = 10


@dataclass(frozen=True)
class Bootstrap:
    """Spread of repeated fits, in internal values."""

    std: FloatArray  # (n_param,) Standard deviation of the replicates
    lower: FloatArray  # (n_param,) Lower end of the percentile interval
    upper: FloatArray  # (n_param,) Upper end


@dataclass(frozen=True)
class _Chunk:
    problem: Problem
    internal: FloatArray
    inverse: FloatArray
    shifts: FloatArray
    seed: np.random.SeedSequence
    count: int


def bootstrap(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    shifts: FloatArray,
    count: int,
    confidence: float,
    seed: int,
    parallel_map: Map,
) -> Bootstrap:
    """Repeats a fit from its minimum on perturbed responses.

    Resampling the few realizations of a campaign with replacement knows few distinct samples (35 of four) and makes
    the variance too small by the factor (M - 1)/M. Here every realization's own error is added to the response
    with a normal weight of variance M/(M - 1), drawn for each configuration (a wild bootstrap): lines and elements
    of a realization stay together, so that nothing is assumed about their correlation. The percentiles are taken
    apart by the ratio of Student's and the normal quantile, because few realizations determine a variance badly.

    Args:
        problem: The problem, weights of the final fit.
        internal (n_param,): Its minimum.
        found: The estimator linearised there.
        shifts (n_conf, n_real, n_param): What each realization does to the parameters, see `realization_shifts`.
        count: Number of replicates.
        confidence: Level of the interval.
        seed: Seed of the weights.
        parallel_map: Ordered map over chunks of replicates.

    Source:
        Wu (1986); expanded percentiles: Hesterberg (2015).
    """
    sizes = [min(_CHUNK, count - index * _CHUNK) for index in range(bootstrap_tasks(count))]
    seeds = np.random.SeedSequence([seed, count]).spawn(len(sizes))
    chunks = [_Chunk(problem, internal, found.inverse, shifts, *each) for each in zip(seeds, sizes, strict=True)]
    replicates = np.concatenate(parallel_map(_replicates, chunks))
    tail = 0.5 - 0.5 * confidence
    # Few realizations determine no variance well: percentiles are as narrow as a normal quantile is to Student's.
    expanded = t.ppf(1 - tail, np.maximum(realization_freedom(shifts), 1.0)) / norm.ppf(1 - tail)
    ends = np.quantile(replicates, [tail, 1 - tail], axis=0, method="weibull") - internal
    return Bootstrap(replicates.std(axis=0, ddof=1), *(internal + expanded * ends))


def bootstrap_tasks(count: int) -> int:
    """Number of tasks that so many replicates are spread over."""
    return -(-count // _CHUNK)


def _replicates(chunk: _Chunk) -> FloatArray:
    """Minima (count, n_param), what is known beforehand drawn anew as well."""
    generator = np.random.default_rng(chunk.seed)
    frf, n_real = chunk.problem.frf, chunk.shifts.shape[1]
    each = np.asarray(frf.realization_error)
    parameters = chunk.problem.parameters
    known = 0.5 / parameters.prior_std
    minima = []
    for _ in range(chunk.count):
        weights = generator.standard_normal(chunk.shifts.shape[:2])
        errors = np.einsum("cm,cmfoi->cfoi", np.sqrt(n_real / (n_real - 1)) * weights, each)
        drawn = replace(chunk.problem, frf=replace(frf, response=frf.response + errors))
        # The linear move is the first Gauss-Newton step.
        point = chunk.internal + np.clip(np.einsum("cm,cmp->p", weights, chunk.shifts), -_LONGEST_STEP, _LONGEST_STEP)
        for _ in range(_FURTHER_STEPS):
            here = drawn.normal(point)
            point = point - np.clip(np.linalg.solve(here.hessian, here.gradient), -_LONGEST_STEP, _LONGEST_STEP)
            point = np.clip(point, parameters.lower, parameters.upper)
        # What is known beforehand is an observation too, with an error of its own deviation.
        minima.append(point + chunk.inverse @ (known * generator.standard_normal(known.size)))
    return np.array(minima)
