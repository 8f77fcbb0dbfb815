"""Structures tried on the same shots, each fitted once, with starts from those fitted before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.comparison import nrmse, predict
from robid.models.external.fit.descent import Descent
from robid.models.external.fit.output_error import default_names, model_of
from robid.models.external.fit.problem import Problem, Structure, count_free, log_likelihood, pose, squares_of
from robid.models.external.fit.search import search
from robid.models.external.fit.transfer import TransferMatrix, scaled
from robid.models.external.fit.whiteness import excited_lines, whiteness
from robid.results.levenberg import Status

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot

_ADDED = (0.3, 1.0, 3.0)  # times the outputs' own frequency, a pole that a zero cancels is added
_TOLERANCE = 0.1  # standard deviations of the poles that no criterion notices
_FAR = 10.0  # per sample, a pole is added that nearly answers at once


@dataclass(frozen=True)
class Candidate:
    """One structure tried.

    Attributes:
        structure: The structure.
        model: Its best transfer functions.
        noise (n_shot, n_out): Standard deviations of the residuals that weighted them.
        bic: Bayesian information criterion; the smaller the better.
        nrmse: Least normalised fit of any output and shot held back, or of the shots of the fit where none was.
        whiteness: Least chance of white noise to look as coloured as a residual of the fit, times their number.
        status: How the search ended.
    """

    structure: Structure
    model: TransferMatrix
    noise: FloatArray
    bic: float
    nrmse: float
    whiteness: float
    status: Status


class Candidates:
    """Fits structures to the same shots.

    Args:
        shots: Experiments of the fit.
        inputs: Which of their inputs.
        outputs: Which of their outputs.
        common: What all structures share.
        held_back: Experiments that are not fitted.
        hopeless: How much worse than the best criterion so far a structure may be to be worth more than a first try.
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
