"""How much a block's parameters differ from recording to recording, and what that adds to their intervals.

A recording is all that was logged at one place of one campaign. Its own noise says how well it alone knows a parameter;
what differs beyond that, from day to day or from place to place, one recording cannot show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from robid.arrays import BoolArray, FloatArray
from robid.clusters.evidence import inverted, summarise
from robid.clusters.pooling import estimate_between, pool
from robid.models.conclusions import Row
from robid.models.external.fit.covariance import WHITE, find_spread, meat_of, numerators_of, time_rows
from robid.models.external.fit.descent import Point, columns_of, slopes_of
from robid.models.external.fit.output_error import BlockFit, conclude, powers_of
from robid.models.external.fit.problem import Problem, pose
from robid.models.external.fit.reduction import Experiment, excited_lines, whiteness
from robid.models.external.fit.search import descend_from, slowest_unseen
from robid.models.external.fit.transfer import TransferMatrix, scaled

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot

_KNOWN = 1.0  # relative deviation by noise up to which differences of a parameter can be told
_MOST = 4
_ALONE = "nothing in it shows what differs from day to day"
_TOLERANCE = 1e-3  # deviations of the poles, that end a search
_SINGULAR = 1e-10  # of the largest singular value


@dataclass(frozen=True)
class Recordings:
    """What differs between the recordings of a block."""

    names: tuple[str, ...]  # campaign and configuration of each
    std: FloatArray  # (n_param,): deviation of each parameter between recordings, relative; 0 where noise explains it
    # (n_coefficient, n_root): root of the covariance of the coefficients by noise, as of `BlockFit`: what recordings
    # differ by is no noise
    noise_root: FloatArray
    root: FloatArray  # (n_coefficient, n_root): root of what the differences add to it
    degrees_of_freedom: FloatArray  # (n_param,): of the variances between recordings
    untested: BoolArray  # (n_param,): whether one recording alone knows it, so that none shows what differs

    @property
    def between_std(self) -> FloatArray:
        """Deviation (n_param,) of each parameter between recordings, relative; NaN where one recording tells it."""
        return np.where(self.untested, np.nan, self.std)

    def sentence(self, parameters: Sequence[str]) -> str:
        """Says what the recordings show of their differences, of parameters by name."""
        if len(self.names) < 2:
            return f"its data are one recording, and {_ALONE}; further recordings in `from` would"
        worst = [index for index in np.argsort(-self.std, kind="stable").tolist() if self.std[index] > 0]
        listed = ", ".join(f"{parameters[index]} by {100 * self.std[index]:.2g} %" for index in worst[:_MOST])
        more = f" and {len(worst) - _MOST} more" if len(worst) > _MOST else ""
        told = f"differ by {listed}{more} beyond noise (one deviation)" if worst else "differ by no more than noise"
        alone = [name for name, untested in zip(parameters, self.untested, strict=True) if untested]
        rest = f"; of {', '.join(alone)} only one tells, so that nothing shows what differs there" if alone else ""
        return f"its {len(self.names)} recordings {told}{rest}"

    def freedom(self, parameters: Sequence[Row]) -> FloatArray:
        """Degrees of freedom (n_param,) of parameters whose moves end with those of this root.

        Source:
            Satterthwaite (1946): noise, whose variance is known, and a variance that few recordings tell.
        """
        moves = np.array([row.moves for row in parameters])
        whole, own = ((each**2).sum(axis=1) for each in (moves, moves[:, moves.shape[1] - self.root.shape[1] :]))
        # Of V = V_noise + V_between, only the second part is uncertain: V^2 / df = V_between^2 / df_between.
        share = np.divide(own, whole, out=np.zeros_like(own), where=whole > 0)
        found = np.full(len(parameters), np.inf)
        found[share > 0] = self.degrees_of_freedom[share > 0] / share[share > 0] ** 2
        return found


def width_rule(every: Sequence[Recordings]) -> str:
    """Says what sets the width of the intervals of all blocks."""
    noise, counts = "the residual, as coloured as it is", sorted({len(one.names) for one in every})
    if counts == [1]:
        return f"{noise}, of one recording: {_ALONE}"
    return f"{noise}, and by what {' to '.join(str(count) for count in counts)} recordings differ by beyond it"


def places_of(shots: Sequence[Shot]) -> tuple[str, ...]:
    """Returns the places of shots, each once; every one is a recording."""
    return tuple(dict.fromkeys(shot.place for shot in shots))


def pool_recordings(
    shots: Sequence[Shot],
    inputs: Sequence[int],
    outputs: Sequence[int],
    fit: BlockFit,
    parameters_of: Callable[[TransferMatrix], Sequence[Row]],
) -> tuple[BlockFit, Recordings]:
    """Estimates how much parameters differ between recordings, and how far a fit of all of them is off by that.

    Around the fit each recording says what its own parameters are. These differ by its noise and by a deviation of each
    parameter, which is that of the largest restricted likelihood. Where any does, shots are weighted anew: by their
    noise alone, without what recordings differ by, which would give all weight to the one that the fit came near to.

    Takes the block's shots, inputs and outputs, and the parameters of a model with their slopes by its coefficients.

    Source:
        Jackson, White and Thompson (2010), sec. 2: multivariate random-effects meta-analysis.
    """
    names, n_param = places_of(shots), len(parameters_of(fit.model))
    no_root, nowhere = np.zeros((len(fit.parameters), 0)), np.full(n_param, np.inf)
    nothing = Recordings(names, np.zeros(n_param), fit.covariance_root, no_root, nowhere, np.ones(n_param, bool))
    if len(names) < 2:
        return fit, nothing
    problem = pose(shots, inputs, outputs, fit.structure)
    told = [[index for index, shot in enumerate(shots) if shot.place == name] for name in names]
    seen = _look(problem, fit, parameters_of(fit.model), told)
    found = nothing if seen is None else _pooled(nothing, seen)
    if seen is None or not found.root.size:
        return fit, found
    return _weighted_by_noise(problem, fit, parameters_of, told, nothing, seen.said.noise)


def _weighted_by_noise(
    problem: Problem,
    fit: BlockFit,
    parameters_of: Callable[[TransferMatrix], Sequence[Row]],
    told: Sequence[Sequence[int]],
    nothing: Recordings,
    noise: FloatArray,
) -> tuple[BlockFit, Recordings]:
    """Fits once more, residuals weighted by the noise (n_shot, n_out) that recordings have by themselves."""
    start = scaled(fit.model.denominator, problem.scale)
    descent = descend_from(problem, start, noise, _TOLERANCE, reflected=fit.reflected)
    again = conclude(problem, descent, noise, (fit.model.inputs, fit.model.outputs))
    # A search that stalls right where it began is no news.
    again = replace(again, status=fit.status) if again.status == "stalled" else again
    seen = _look(problem, again, parameters_of(again.model), told)
    if seen is None:
        return fit, nothing
    spread = find_spread(problem, descent.point, noise, slowest_unseen(problem, descent.point, noise), told)
    noise_root = spread.root * powers_of(problem, len(again.model.outputs))[:, None]
    return again, _pooled(replace(nothing, noise_root=noise_root), seen)


@dataclass(frozen=True)
class _Seen:
    """What recordings say of a fit's free parameters, relative to their sizes."""

    said: _Said
    to_coefficients: FloatArray  # (n_coefficient, n_free): slopes of all coefficients by them
    free: BoolArray  # (n_param,): which are free, not fixed by the structure
    known: BoolArray  # (n_free,): which of the free are known well enough for differences to be told


def _look(problem: Problem, fit: BlockFit, parameters: Sequence[Row], told: Sequence[Sequence[int]]) -> _Seen | None:
    """Asks each recording for the parameters of a fit; None at double roots, which have no slopes."""
    point = problem.evaluate(scaled(fit.model.denominator, problem.scale), fit.noise_std)
    size = np.array([row.scale for row in parameters])
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.array([row.moves for row in parameters]) / size[:, None]
    if point is None or not np.isfinite(relative).all():
        return None
    to_coefficients = powers_of(problem, len(fit.model.outputs))[:, None] * _coefficients_by(problem, point)
    slopes = relative @ to_coefficients
    # What the structure fixes has no slope; the others are as many as the directions that are sought.
    free = np.linalg.norm(slopes, axis=1) > _SINGULAR * np.linalg.norm(slopes)
    back = np.linalg.pinv(slopes[free], rcond=_SINGULAR)
    noise = np.linalg.norm(relative @ fit.covariance_root, axis=1)
    known = np.array([row.reachable for row in parameters]) & (noise < _KNOWN)
    said = _said(problem, point, fit.noise_std, told).along(back)
    return _Seen(said, to_coefficients @ back, free, known[free])


def _coefficients_by(problem: Problem, point: Point) -> FloatArray:
    """Slopes (n_coefficient, n_sought) of all coefficients by the weights that are sought, then by the poles.

    Coefficients are in powers of s over the reference frequency.
    """
    n_out = len(point.weights)
    parts = [numerators_of(point, problem.sought, output) for output in range(n_out)]
    own = block_diag(*(free for free, _ in parts))
    n_pole = point.basis.n_pole
    below = np.concatenate([np.zeros((n_pole, own.shape[1])), point.basis.single.numerators.T], axis=1)
    above = np.concatenate([own, np.concatenate([fixed for _, fixed in parts])], axis=1)
    return np.concatenate([above, below])


@dataclass(frozen=True)
class _Said:
    """What each recording says of some parameters around a fit of all."""

    bread: FloatArray  # (n_recording, n_param, n_param): weighted information
    score: FloatArray  # (n_recording, n_param): weighted residuals times their derivative
    meat: FloatArray  # (n_recording, n_param, n_param): covariance of the score by noise
    noise: FloatArray  # (n_shot, n_out): deviation of what is left once each recording has its own parameters

    def along(self, moves: FloatArray) -> _Said:
        """Returns what they say of other parameters, which move these by columns (n_param, n_other)."""
        return replace(
            self,
            bread=moves.T @ self.bread @ moves,
            score=self.score @ moves,
            meat=moves.T @ self.meat @ moves,
        )


def _said(problem: Problem, point: Point, noise: FloatArray, told: Sequence[Sequence[int]]) -> _Said:
    """Asks each recording for the sought weights, then the poles, free responses taken out."""
    period, hold = problem.period, problem.structure.hold
    rows = [time_rows(each, point, period, hold) for each in problem.experiments]
    ends = np.cumsum([0, *(each.n_sample for each in problem.experiments)]).tolist()
    counts = [numerators_of(point, problem.sought, output)[0].shape[1] for output in range(noise.shape[1])]
    n_pole, n_sought = point.basis.n_pole, sum(counts) + point.basis.n_pole
    bread, meat = (np.zeros((len(told), n_sought, n_sought)) for _ in range(2))
    score, own_noise = np.zeros((len(told), n_sought)), np.zeros(noise.shape)
    for output, count in enumerate(counts):
        scale, first = 1 / noise[:, output], sum(counts[:output])
        columns, right = columns_of(rows, point.basis, problem.sought, problem.n_in, scale, output)
        free = [part[output] for part in point.free]
        slope = slopes_of(rows, point.basis, problem.sought, point.weights[output], free, scale, output)
        left = right - columns @ np.linalg.lstsq(columns, right, rcond=None)[0]
        place = np.r_[first : first + count, n_sought - n_pole : n_sought]
        for recording, own in enumerate(told):
            for index in own:
                span = slice(ends[index], ends[index + 1])
                local = columns[span, count:]
                local = np.linalg.qr(local[:, np.abs(local).max(axis=0, initial=0.0) > 0])[0]
                pull = np.concatenate([columns[span, :count], slope[span]], axis=1)
                pull = pull - local @ (local.T @ pull)
                bread[recording][np.ix_(place, place)] += pull.T @ pull
                score[recording, place] += pull.T @ left[span]
                # What its own parameters would explain is no noise.
                rest = left[span] - pull @ np.linalg.lstsq(pull, left[span], rcond=None)[0]
                meat[recording][np.ix_(place, place)] += _noise_of(problem.experiments[index], rest, pull)
                own_noise[index, output] = noise[index, output] * np.sqrt(np.mean(rest**2))
    least = np.array([each.noise for each in problem.experiments])
    return _Said(bread, score, meat, np.maximum(own_noise, least))


def _noise_of(experiment: Experiment, rest: FloatArray, pull: FloatArray) -> FloatArray:
    """Covariance of the pulls (n_sample, n_pull) of a noise that looks like what is left (n_sample,)."""
    n_taken, excited = float(pull.shape[1]), excited_lines(experiment)
    white = bool(whiteness(rest, excited, n_taken) >= WHITE)
    return meat_of(rest, pull, excited, n_taken + experiment.offset, white=white)


def _pooled(nothing: Recordings, seen: _Seen) -> Recordings:
    """Estimates variances between recordings, and what follows for the fit of all."""
    said, count = seen.said, int(seen.free.sum())
    evidence = summarise(said.bread, said.score, said.meat, np.zeros((count, count)), np.zeros(count))
    # A variance needs two that tell of it: where one recording has all the information, none can be estimated.
    alone = pool(evidence, np.zeros(count)).untested | ~seen.known
    between = estimate_between(evidence, np.where(alone, 0.0, np.nan)).variance
    # The fit of all is x = (sum B)^-1 sum B_c x_c: each recording's own deviation enters with its weight.
    weights = inverted(said.bread.sum(axis=0))[0] @ said.bread
    columns = np.concatenate([each * np.sqrt(between) for each in weights], axis=1)
    root = seen.to_coefficients @ columns[:, np.abs(columns).max(axis=0) > 0]
    if root.shape[1] > len(root):
        # Any root R with the same R R^T does: the triangular one has no more columns than rows.
        root = np.linalg.qr(root.T)[1].T
    std, freedom, untested = nothing.std.copy(), nothing.degrees_of_freedom.copy(), nothing.untested.copy()
    std[seen.free], freedom[seen.free] = np.sqrt(between), pool(evidence, between).degrees_of_freedom
    untested[seen.free] = alone
    return replace(nothing, std=std, root=root, degrees_of_freedom=freedom, untested=untested)
