"""Covariance of a block's coefficients, with residuals as coloured as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.external.fit.descent import Numerators, Point, columns_of, natural_steps, slopes_of
from robid.models.external.fit.problem import Problem
from robid.models.external.fit.reduction import (
    Experiment,
    Reduced,
    excited_lines,
    smoothed_spectrum,
    states_of,
    whiteness,
)
from robid.models.external.fit.transfer import Hold

_EXCLUDED = 4.0  # standard deviations

WHITE = 0.01
"""Chance below which a residual counts as coloured."""


@dataclass(frozen=True)
class Spread:
    """Residuals of a block, and what they say of its coefficients."""

    residuals: tuple[FloatArray, ...]  # residual (n_sample, n_out) of each shot
    # (n_param, n_root): a root of the covariance of the coefficients, `[numerators, denominator]` highest power first
    # in powers of s over the reference frequency, without the denominator's first.
    root: FloatArray
    whiteness: FloatArray  # (n_shot, n_out): chance of white noise to look as coloured as each residual
    n_taken: FloatArray  # (n_shot, n_out): degrees of freedom that the fit took from each residual


def find_spread(
    problem: Problem,
    point: Point,
    noise: FloatArray,
    unseen: float = np.pi,
    apart: Sequence[Sequence[int]] = (),
) -> Spread:
    """Computes residuals and the coefficients' covariance.

    For white residuals it is `sigma^2 (J'J)^-1`; where any is coloured, its smoothed spectrum takes the place of
    `sigma^2`, which keeps intervals honest when the model leaves something over. The deviations `noise` (n_shot, n_out)
    weight residuals; from `unseen` per sample on, samples do not tell the fastest pole from an immediate answer. Groups
    of shots that stand `apart`, by their indices, may have parameters of their own: what these explain is no noise.

    Source:
        White (1980), "A heteroskedasticity-consistent covariance matrix estimator"; Ljung (1999), eq. 9.42.
    """
    experiments, sought, period = problem.experiments, problem.sought, problem.period
    rows = [time_rows(each, point, period, problem.structure.hold) for each in experiments]
    ends = np.cumsum([0, *(each.n_sample for each in experiments)]).tolist()
    spans = [slice(first, last) for first, last in pairwise(ends)]
    # The Jacobian of all outputs in two parts: what is linear in numerators and free responses belongs to one output
    # each; what poles do beyond that is orthogonalised over all outputs, which share the poles.
    linear = [_linear_part(rows, point, sought, noise[:, output], output) for output in range(noise.shape[1])]
    projected, triangle = _orthogonal(np.concatenate([each.tilt for each in linear]), point, period, unseen)
    residuals = [np.zeros((each.n_sample, noise.shape[1])) for each in experiments]
    chances, taken = np.ones(noise.shape), np.zeros(noise.shape)
    meats = []
    for output, part in enumerate(linear):
        own = projected[output * ends[-1] : (output + 1) * ends[-1]]
        pulls = np.concatenate([part.within, own], axis=1)
        meat = np.zeros((pulls.shape[1], pulls.shape[1]))
        by_noise = _by_noise(part.residual, pulls, [[spans[index] for index in group] for group in apart])
        for index, (each, span) in enumerate(zip(experiments, spans, strict=True)):
            residuals[index][:, output] = part.residual[span] * noise[index, output]
            # The pulls are orthonormal over all shots: their squares in one are the degrees of freedom that it gave.
            excited, left, n_pull = excited_lines(each), by_noise[span], float(np.sum(pulls[span] ** 2))
            taken[index, output] = n_pull + each.offset
            chances[index, output] = whiteness(part.residual[span], excited, n_pull)
            white = whiteness(left, excited, n_pull) >= WHITE if apart else chances[index, output] >= WHITE
            meat += meat_of(left, pulls[span], excited, taken[index, output], white=bool(white))
        meats.append(meat)
    return Spread(tuple(residuals), _root(linear, triangle, meats, point, sought), chances, taken)


def _by_noise(residual: FloatArray, pulls: FloatArray, apart: Sequence[Sequence[slice]]) -> FloatArray:
    """What is left of a residual (n_row,) once each group of rows has followed its own pulls (n_row, n_pull)."""
    left = residual.copy()
    for group in apart:
        rows = np.concatenate([np.arange(span.start, span.stop) for span in group])
        own = pulls[rows]
        left[rows] -= own @ np.linalg.lstsq(own, residual[rows], rcond=None)[0]
    return left


@dataclass(frozen=True)
class _LinearPart:
    """One output: orthonormal columns of its linear part, how they make its weights, and what is left."""

    within: FloatArray
    to_weights: FloatArray
    along: FloatArray
    tilt: FloatArray
    residual: FloatArray


def time_rows(experiment: Experiment, point: Point, period: float, hold: Hold) -> Reduced:
    """Returns a shot's states and outputs over time, in the form of their factor."""
    states = states_of(experiment, point.basis.double, period, hold)
    columns = np.concatenate([states.reshape(-1, experiment.n_sample), experiment.outputs]).T
    return Reduced(experiment.moved, columns, states.shape[1], experiment.start == "free")


def _linear_part(
    rows: Sequence[Reduced], point: Point, sought: Numerators, noise: FloatArray, output: int
) -> _LinearPart:
    n_in = point.weights.shape[1]
    columns, right = columns_of(rows, point.basis, sought, n_in, 1 / noise, output)
    weights, free = point.weights[output], [part[output] for part in point.free]
    slope = slopes_of(rows, point.basis, sought, weights, free, 1 / noise, output)
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    left, values, turned = np.linalg.svd(columns / size, full_matrices=False)
    kept = values > 1e-13 * values.max(initial=0.0)
    within, to_weights = left[:, kept], (turned[kept].T / values[kept]) / size[:, None]
    along = within.T @ slope
    return _LinearPart(within, to_weights, along, slope - within @ along, right - within @ (within.T @ right))


def meat_of(residual: FloatArray, pull: FloatArray, excited: BoolArray, n_taken: float, *, white: bool) -> FloatArray:
    """Covariance (n_pull, n_pull) of the pulls (n_sample, n_pull) of noise that looks like the residual (n_sample,)."""
    n_sample = len(residual)
    # Residuals are smaller than the noise by what the fit took of it.
    inflation = n_sample / max(n_sample - n_taken, 1.0)
    if white:
        return np.asarray(pull.T @ pull * (residual @ residual / n_sample * inflation))
    spectrum = smoothed_spectrum(residual, excited) * inflation
    # J^T C J for a stationary C is diagonal in frequency: a sum over lines of |pull|^2 times the spectrum (Parseval);
    # lines but the first and the last stand for two.
    lines = np.fft.rfft(pull, axis=0)
    share = np.full(len(lines), 2.0)
    share[0] = 1.0
    if n_sample % 2 == 0:
        share[-1] = 1.0
    return np.asarray(np.real((lines.conj().T * (share * spectrum)) @ lines) / n_sample)


def _root(
    linear: Sequence[_LinearPart], triangle: FloatArray, meats: Sequence[FloatArray], point: Point, sought: Numerators
) -> FloatArray:
    """Root of the covariance of numerators and denominator in powers of s over the reference frequency."""
    basis, n_pole = point.basis, point.basis.n_pole
    size = np.linalg.norm(triangle, axis=0)
    size[size == 0] = 1.0
    # A noise e moves the poles by R^-1 Q^T e, where Q R is what they do beyond numerators and free responses.
    poles = np.linalg.pinv(triangle / size, rcond=1e-13) / size[:, None]
    to_numerators = [numerators_of(point, sought, output) for output in range(len(linear))]
    n_each = point.weights.shape[1] * point.weights.shape[2]
    columns = []
    for own, meat in zip(linear, meats, strict=True):
        values, vectors = np.linalg.eigh(meat)
        half = vectors * np.sqrt(np.maximum(values, 0.0))
        n_within = own.within.shape[1]
        change = poles @ half[n_within:]
        whole = np.zeros((len(linear) * n_each + n_pole, half.shape[1]))
        for other, part in enumerate(linear):
            # The numerators follow the poles (what these do along the linear columns is undone), and the noise of their
            # own output.
            moves = -part.to_weights @ (part.along @ change)
            if part is own:
                moves = moves + part.to_weights @ half[:n_within]
            free, fixed = to_numerators[other]
            place = slice(other * n_each, (other + 1) * n_each)
            # Free responses come after the numerators and are of no interest here.
            whole[place] = free @ moves[: free.shape[1]] + fixed @ change
        whole[-n_pole:] = basis.single.numerators.T @ change
        columns.append(whole)
    return np.concatenate(columns, axis=1)


def _orthogonal(tilts: FloatArray, point: Point, period: float, unseen: float) -> tuple[FloatArray, FloatArray]:
    """Orthogonalises what the poles do (n_row, n_pole); the factor (n_pole, n_pole) is triangular but for its order.

    Of poles above the Nyquist frequency samples say the less the faster they are: where even one that answers at once
    is not excluded, their slope now says nothing of how far they may be off: down to where samples see them.
    """
    sizes, stages = natural_steps(point), point.basis.single.stages
    beyond = [stage for stage in stages if abs(stage.pole) * period > np.pi]
    n_beyond = beyond[-1].states.stop if beyond else 0
    # Poles beyond the Nyquist frequency come last, so that what is left to them is beyond all others.
    order = np.roll(np.arange(len(sizes)), -n_beyond)
    projected, triangle = np.linalg.qr((tilts * sizes)[:, order])
    if beyond:
        corner = slice(len(sizes) - n_beyond, None)
        left, values, turned = np.linalg.svd(triangle[corner, corner])
        reach = max(abs(stage.pole) for stage in beyond) * period
        # Its time constant lies anywhere from zero to the longest unseen, here over what was found.
        longest = reach / unseen
        values = np.where(values < _EXCLUDED * reach, 1 / np.hypot(longest / np.sqrt(12), longest / 2 - 1), values)
        triangle[corner, corner] = (left * values) @ turned
    back = np.argsort(order)
    return projected, triangle[:, back] / sizes


def numerators_of(point: Point, sought: Numerators, output: int) -> tuple[FloatArray, FloatArray]:
    """Returns what an output's sought weights, and the poles' directions, change in its numerators' coefficients."""
    n_in, n_weight = point.weights.shape[1:]
    numerators = point.basis.single.numerators
    above = numerators[-n_weight:, -n_weight:]
    parts = [sought.free(point.basis, output, index) @ above for index in range(n_in)]
    free = np.zeros((n_in * n_weight, sum(len(part) for part in parts)))
    fixed = np.zeros((n_in * n_weight, len(numerators)))
    place = 0
    for index, part in enumerate(parts):
        free[index * n_weight : (index + 1) * n_weight, place : place + len(part)] = part.T
        place += len(part)
        if sought.static_gain_one and index == output:
            fixed[(index + 1) * n_weight - 1] = numerators[:, -1]
    return free, fixed
