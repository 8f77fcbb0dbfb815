"""Shots reduced at given poles to what least squares needs of them, and the correlation of what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, f

from robid.arrays import BoolArray, FloatArray
from robid.models.external.fit.transfer import (
    Cascade,
    Hold,
    Start,
    build_cascade,
    delayed,
    discretise,
    find_stages,
    propagate,
    release,
)

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot


@dataclass(frozen=True)
class Experiment:
    """One shot as a block sees it."""

    commands: FloatArray  # (n_moved, n_sample): commands that move, averaged and delayed
    moved: tuple[int, ...]  # which inputs of the block these are
    outputs: FloatArray  # (n_out, n_sample): Outputs, free of their mean where an offset is estimated along
    start: Start  # state at the first sample
    offset: bool  # whether a constant of each output is estimated along
    noise: FloatArray  # (n_out,): least standard deviation that the outputs' noise may have
    name: str  # for messages

    @property
    def n_sample(self) -> int:
        """Number of samples."""
        return int(self.outputs.shape[1])


_ROUNDING = 1e-10  # of an output's deviation: noise that double precision leaves


def prepare(
    shots: Sequence[Shot], inputs: Sequence[int], outputs: Sequence[int], delay_samples: int, moving_average: int
) -> tuple[Experiment, ...]:
    """Takes a block's signals from shots, with commands averaged and delayed."""
    prepared = []
    for shot in shots:
        told = delayed(shot.inputs[:, list(inputs)], delay_samples, moving_average, shot.start)
        moved = tuple(np.flatnonzero(np.any(told != 0, axis=1)).tolist())
        found = np.ascontiguousarray(shot.outputs[:, list(outputs)].T, dtype=float)
        size = np.maximum(np.abs(found).max(axis=1), found.std(axis=1))
        if shot.offset:
            found = found - found.mean(axis=1, keepdims=True)
        noise = np.zeros(len(found)) if shot.noise_std is None else np.asarray(shot.noise_std)[list(outputs)]
        noise = np.maximum(noise, _ROUNDING * size)
        prepared.append(Experiment(told[list(moved)], moved, found, shot.start, shot.offset, noise, shot.name))
    return tuple(prepared)


@dataclass(frozen=True)
class Reduced:
    """One shot at given poles: its states' and outputs' triangular factor."""

    moved: tuple[int, ...]  # inputs of the block that move
    # (n_row, n_moved n_state + n_free n_state + n_out): factor of the states of each input, of those of the free
    # response where the start is free, and of the outputs.
    triangle: FloatArray
    n_state: int
    is_free: bool  # whether there is a free response

    def states(self, index: int) -> FloatArray:
        """Columns (n_row, n_state) of the states of the moved input of that index; after the last the free response."""
        return self.triangle[:, index * self.n_state : (index + 1) * self.n_state]

    def output(self, index: int) -> FloatArray:
        """Column (n_row,) of an output."""
        return self.triangle[:, (len(self.moved) + self.is_free) * self.n_state + index]


def states_of(experiment: Experiment, cascade: Cascade, period: float, hold: Hold) -> FloatArray:
    """Simulates the states (n_moved [+ 1], n_state, n_sample) of a cascade, the free response last where it is free."""
    held = discretise(cascade, period, hold)
    states = propagate(held, period, experiment.commands, experiment.start)
    if experiment.start == "free":
        states = np.concatenate([states, release(held, period, experiment.n_sample)[None]])
    if experiment.offset:
        states -= states.mean(axis=-1, keepdims=True)
    return states


@dataclass(frozen=True)
class Basis:
    """States that span the outputs at given poles, and their derivatives."""

    denominator: FloatArray  # (n_pole + 1,): denominator in powers of s over the reference frequency, highest first
    single: Cascade  # cascade of the poles
    double: Cascade  # cascade of the poles twice, whose first states are those of `single`

    @property
    def n_pole(self) -> int:
        """Number of poles."""
        return len(self.single.b)


def build_basis(denominator: FloatArray) -> Basis:
    """Builds the cascades of a denominator (n_pole + 1,)."""
    stages = find_stages(denominator)
    return Basis(denominator, build_cascade(stages), build_cascade(stages, 2))


def reduce_shots(experiments: Sequence[Experiment], cascade: Cascade, period: float, hold: Hold) -> tuple[Reduced, ...]:
    """Reduces experiments at the poles of a cascade; `period` is the sampling period times the reference frequency."""
    found = []
    for experiment in experiments:
        states = states_of(experiment, cascade, period, hold)
        # The triangle keeps all inner products of states and outputs: numerators are then solved for on a row a column,
        # however many samples there are.
        rows = np.concatenate([states.reshape(-1, experiment.n_sample), experiment.outputs])
        # In mode `raw` the factor comes without a pass over all samples' zeros.
        _, triangle = qr(rows.T, mode="raw", overwrite_a=True, check_finite=False)
        found.append(Reduced(experiment.moved, triangle, states.shape[1], experiment.start == "free"))
    return tuple(found)


_EXCITED = 1e-3  # of the strongest line's power
_N_LAG = 20
_FEWEST_LINES = 4


def excited_lines(experiment: Experiment) -> BoolArray:
    """Returns which lines (n_line,) of the discrete Fourier transform, zero left out, a shot's commands excite."""
    power = (np.abs(np.fft.rfft(experiment.commands, axis=1)) ** 2).sum(axis=0)[1:]
    # Lines beside an excited one carry what a transient leaks there.
    smooth = uniform_filter1d(power, 3, mode="nearest")
    return np.asarray(smooth > _EXCITED * smooth.max(initial=0.0))


def whiteness(residual: FloatArray, excited: BoolArray, n_taken: float) -> float:
    """Chance of a white residual to look as coloured as this one.

    Its power where commands excite is held against the rest, and its autocorrelation at the first lags against zero;
    the smaller chance counts twice. The lines (n_line,) that commands excite and the degrees of freedom that the fit
    took from this residual (n_sample,) are given.

    Source:
        Ljung and Box (1978), "On a measure of lack of fit in time series models".
    """
    n_sample = len(residual)
    centred = residual - residual.mean()
    if not centred.any():  # nothing is left: an output that never moves
        return 1.0
    power = np.abs(np.fft.rfft(centred)) ** 2
    chances = []
    # A model that lacks dynamics leaves power where commands excite; noise, white or not, is as strong in between. Two
    # degrees of freedom a line; the fit took its parameters from the excited ones.
    inside, outside = 2 * excited.sum() - n_taken, 2.0 * (~excited).sum()
    if min(inside, outside) >= 2 * _FEWEST_LINES:
        ratio = power[1:][excited].sum() / inside / (power[1:][~excited].sum() / outside)
        tail = f.sf(ratio, inside, outside)
        chances.append(2 * min(tail, 1 - tail))
    n_lag = min(_N_LAG, n_sample // 5)
    # Zeros behind the signal keep its end from being correlated with its beginning.
    padded = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n_sample)) ** 2)[: n_lag + 1]
    if n_lag and padded[0] > 0:
        lags = np.arange(1, n_lag + 1)
        # Q = n (n + 2) sum_k r_k^2 / (n - k), chi-square with a degree of freedom a lag.
        statistic = n_sample * (n_sample + 2) * np.sum((padded[1:] / padded[0]) ** 2 / (n_sample - lags))
        chances.append(chi2.sf(statistic, n_lag))
    return float(min(1.0, len(chances) * min(chances))) if chances else 1.0


def smoothed_spectrum(residual: FloatArray, excited: BoolArray) -> FloatArray:
    """Power spectrum (n_line + 1,) of a residual (n_sample,), smoothed over a fraction of the band excited.

    White noise of variance one has the spectrum one.
    """
    power = np.abs(np.fft.rfft(residual)) ** 2 / len(residual)
    # The mean has been taken out with the offset: its line would pull its neighbours down.
    power[0] = power[1] if len(power) > 1 else power[0]
    reach = int(np.clip(excited.sum() // 8, 2, np.sqrt(len(residual))))
    return np.asarray(uniform_filter1d(power, 2 * reach + 1, mode="reflect"))
