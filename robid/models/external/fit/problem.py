"""What a block's fit is about: structure, shots, noise and likelihood, and which shots are too poor for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.descent import Numerators, Point, solve
from robid.models.external.fit.reduction import Experiment, build_basis, prepare, reduce_shots
from robid.models.external.fit.transfer import Hold

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot

_SAMPLES_PER_PARAMETER = 5
_STILL = 1e-12  # of the largest value, a motion that is none


def check_block(shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure) -> None:
    """Refuses shots that cannot tell a block of that structure.

    Raises:
        ValueError: If the structure is none.
        DataError: If nothing moves, or the record is too short.
    """
    if not 0 <= structure.zeros < structure.poles:
        message = f"D148 there must be fewer zeros than poles, not {structure.zeros} zeros and {structure.poles} poles"
        raise ValueError(message)
    if not shots:
        raise DataError("D149 there is no shot to fit", where="record", remedy="name a campaign with these channels")
    for kind, columns in (("input", inputs), ("output", outputs)):
        for column in columns:
            signals = [(shot.inputs if kind == "input" else shot.outputs)[:, column] for shot in shots]
            if not all(np.isfinite(each).all() for each in signals):
                message = f"D150 {kind} {column} has samples that are no numbers"
                raise DataError(message, where=shots[0].name, remedy="cut the record to what was measured")
            if all(np.ptp(each) <= _STILL * np.abs(each).max(initial=0.0) for each in signals):
                message = f"D151 {kind} {column} does not move in any shot"
                raise DataError(message, where=shots[0].name, remedy="excite it, or leave the channel out")
    n_sample = sum(len(shot.outputs) for shot in shots)
    n_free = structure.poles + len(inputs) * (structure.zeros + 1)
    n_free += structure.poles * sum(shot.start == "free" for shot in shots)
    if n_sample < _SAMPLES_PER_PARAMETER * n_free:
        message = f"D152 {n_sample} samples are too few for {structure.poles} poles and {structure.zeros} zeros"
        raise DataError(message, where=shots[0].name, remedy="record longer, or ask for fewer poles")
    shortest = min(len(shot.outputs) for shot in shots)
    if structure.delay_samples + structure.moving_average >= shortest:
        message = f"D153 a delay of {structure.delay_samples} samples leaves nothing of a shot of {shortest}"
        raise DataError(message, where=shots[0].name, remedy="record longer, or lower `max_delay_samples`")
    _check_excitation(shots, inputs, outputs, structure)


def _check_excitation(
    shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure
) -> None:
    """Refuses commands with fewer lines than the structure has parameters to tell from them."""
    for column in inputs:
        lines = 0
        for shot in shots:
            power = np.abs(np.fft.rfft(shot.inputs[:, column])) ** 2
            lines += int(np.sum(power > 1e-6 * power.max(initial=np.finfo(float).tiny)))
        needed = -(-(structure.zeros + 1 + -(-structure.poles // len(outputs))) // 2)
        if lines < needed:
            message = f"D154 input {column} excites {lines} frequencies, of which {structure.poles} poles need {needed}"
            raise DataError(message, where=shots[0].name, remedy="excite more frequencies, or ask for fewer poles")


_NOTHING = 1e-6  # of an output's largest motion
_ROUNDING = 1e-10  # of an output
_BEYOND = 1e100  # States of an unstable start: their squares overflow
_FASTEST = 20.0  # per sample: of what a pole beyond answers nothing is left after one


@dataclass(frozen=True)
class Structure:
    """What is fitted."""

    poles: int  # number of poles
    zeros: int  # number of zeros, below that of poles
    delay_samples: int = 0  # transport delay in samples
    moving_average: int = 1  # samples over which commands are averaged
    hold: Hold = "zoh"  # what commands do between samples
    static_gain_one: bool = False  # whether static gains are 1 by assumption
    stable: bool = True  # whether poles are kept in the left half plane


@dataclass(frozen=True)
class Problem:
    """A block's data and structure, in time and frequency over those of a reference frequency."""

    experiments: tuple[Experiment, ...]
    structure: Structure  # what is fitted
    n_in: int  # inputs
    scale: float  # reference frequency [rad/s]
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
        if not all((np.abs(each.triangle) < _BEYOND).all() for each in reduced):
            return None
        return solve(reduced, basis, self.sought, self.n_in, noise, slopes=slopes)


def pose(shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], structure: Structure) -> Problem:
    """Prepares the data of a block.

    Raises:
        ValueError: If the structure is none.
        DataError: If the shots cannot tell it.
    """
    check_block(shots, inputs, outputs, structure)
    experiments = prepare(shots, inputs, outputs, structure.delay_samples, structure.moving_average)
    # The mean square of the differences over that of the signal is about omega^2 (radians per sample) of a slow one.
    shares = [
        np.sum(np.diff(each.outputs, axis=1) ** 2) / max(np.sum(each.outputs**2), np.finfo(float).tiny)
        for each in experiments
    ]
    own_frequency = float(np.clip(np.sqrt(np.mean(shares)), 1e-6, 1.0))
    period = shots[0].sampling_period_s
    return Problem(experiments, structure, len(inputs), own_frequency / period, period)


def first_noise(experiments: Sequence[Experiment]) -> FloatArray:
    """Noise (n_shot, n_out) to start with: that of the repeats, or a hundredth of the output where there are none."""
    size, repeats = output_sizes(experiments), np.array([each.noise for each in experiments])
    return np.where(repeats > 1e-9 * size, repeats, 0.01 * size)


def output_sizes(experiments: Sequence[Experiment]) -> FloatArray:
    """Root mean square (n_shot, n_out) of the outputs; of one that rests in a shot, what is nothing beside others."""
    size = np.sqrt([np.mean(each.outputs**2, axis=1) for each in experiments])
    return np.asarray(np.maximum(size, np.maximum(_NOTHING * size.max(axis=0), np.finfo(float).tiny)))


def residual_noise(experiments: Sequence[Experiment], point: Point, noise: FloatArray) -> FloatArray:
    """Returns the residual's standard deviation (n_shot, n_out), at least that of the repeats."""
    squares = squares_of(point, noise)
    n_sample = np.array([[each.n_sample] for each in experiments])
    least = np.array([each.noise for each in experiments])
    # What a model without any noise leaves is rounding.
    least = np.maximum(least, _ROUNDING * output_sizes(experiments))
    return np.asarray(np.maximum(np.sqrt(squares / n_sample), least))


def squares_of(point: Point, noise: FloatArray) -> FloatArray:
    """Returns the sum of squares (n_shot, n_out) of each residual."""
    squares = np.zeros(noise.shape)
    for output, left in enumerate(np.split(point.residual, noise.shape[1])):
        ends = np.cumsum([0, *point.n_rows])
        for shot, (first, last) in enumerate(pairwise(ends)):
            squares[shot, output] = np.sum(left[first:last] ** 2) * noise[shot, output] ** 2
    return squares


def count_free(problem: Problem, n_out: int) -> int:
    """Returns the number of free parameters, free responses included, offsets not."""
    structure = problem.structure
    # A static gain that is fixed takes one coefficient of each channel on the diagonal.
    diagonal = min(n_out, problem.n_in) if structure.static_gain_one else 0
    loose = sum(each.start == "free" for each in problem.experiments) * n_out * structure.poles
    return n_out * problem.n_in * (structure.zeros + 1) - diagonal + structure.poles + loose


def log_likelihood(experiments: Sequence[Experiment], squares: FloatArray) -> float:
    """Returns the log-likelihood of residuals with sums of squares (n_shot, n_out), each with its own variance."""
    total = 0.0
    for each, own, size in zip(experiments, squares, output_sizes(experiments), strict=True):
        floor = (_ROUNDING * size) ** 2
        # Gaussian noise whose variance is the residual's own mean square: -n/2 (ln(2 pi s^2) + 1).
        variance = np.maximum(own / each.n_sample, floor)
        total -= 0.5 * each.n_sample * float(np.sum(np.log(2 * np.pi * variance) + 1))
    return total
