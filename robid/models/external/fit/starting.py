"""First poles of an output-error fit by filtered least squares and refined instruments."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.descent import admit
from robid.models.external.fit.hold import Held, Hold, discretise, propagate, release
from robid.models.external.fit.reduction import Experiment, build_basis

_PLAIN_PASSES = 3


def guess(n_pole: int, frequency: float) -> FloatArray:
    """Returns the denominator (n_pole + 1,) of a Butterworth filter of that frequency."""
    angles = np.pi * (2 * np.arange(n_pole) + n_pole + 1) / (2 * n_pole)
    return np.real(np.poly(frequency * np.exp(1j * angles)))


def refine(
    experiments: Sequence[Experiment],
    denominator: FloatArray,
    n_zero: int,
    n_in: int,
    noise: FloatArray,
    period: float,
    hold: Hold,
    *,
    limit: float,
    stable: bool,
    passes: int = 8,
) -> list[FloatArray]:
    """Improves a denominator by linear least squares on filtered signals, again and again.

    Both sides of `a y = b u` are divided by the last denominator; later passes take the simulated output as
    instrument, which removes the bias that noise gives.

    Args:
        experiments: The experiments.
        denominator (n_pole + 1,): The first, in powers of s over the reference frequency.
        n_zero: Zeros.
        n_in: Inputs of the block.
        noise (n_shot, n_out): Standard deviation of each output's noise in each shot.
        period: Sampling period times the reference frequency.
        hold: What commands do between samples.
        limit: Largest magnitude of a pole.
        stable: Whether unstable poles are reflected.
        passes: Number of passes.

    Returns:
        The denominator of each pass.

    Source:
        Young and Jakeman (1980), "Refined instrumental variable methods of recursive time-series analysis", III.
    """
    found = []
    for index in range(passes):
        cascade = build_basis(denominator).single
        told, answered = discretise(cascade, period, hold), discretise(cascade, period, "foh")
        # Poles far in the right half plane overflow: nothing of what follows from them would be of use.
        with np.errstate(over="ignore", invalid="ignore"):
            signals = [
                _Filtered(each, told, answered, period, n_zero, scale)
                for each, scale in zip(experiments, noise, strict=True)
            ]
            step = _solve(signals, n_in * (n_zero + 1), instruments=index >= _PLAIN_PASSES)
        change = np.concatenate([[0.0], step @ cascade.numerators])
        if not np.isfinite(change).all():
            break
        denominator, _ = admit(denominator + change, limit, stable=stable)
        found.append(denominator)
    return found


class _Filtered:
    """What the last denominator makes of one experiment's signals, offset and free response taken out.

    Args:
        experiment: The experiment.
        told: The poles, discretised for commands.
        answered: The poles, discretised for outputs, which move in straight lines between samples.
        period: Sampling period times the reference frequency.
        n_zero: Zeros.
        noise (n_out,): Standard deviation of each output's noise.
    """

    def __init__(
        self, experiment: Experiment, told: Held, answered: Held, period: float, n_zero: int, noise: FloatArray
    ) -> None:
        self._experiment, self._answered, self._period = experiment, answered, period
        self._scale = 1 / noise[:, None]
        self._local = self._nuisance()
        states = propagate(told, period, experiment.commands, experiment.start)
        last = states[:, -(n_zero + 1) :].reshape(-1, experiment.n_sample)
        places = [moved * (n_zero + 1) + power for moved in experiment.moved for power in range(n_zero + 1)]
        self.places = np.array(places, dtype=int)
        self.told = self._clean(last)
        self.outputs = self._clean(experiment.outputs) * self._scale
        self.answered = self.filter(experiment.outputs * self._scale)

    def filter(self, outputs: FloatArray) -> FloatArray:
        """Filters weighted outputs (n_out, n_sample) to states (n_out, n_pole, n_sample)."""
        return self._clean(propagate(self._answered, self._period, outputs, self._experiment.start))

    def _clean(self, rows: FloatArray) -> FloatArray:
        return np.asarray(rows - (rows @ self._local.T) @ self._local)

    def _nuisance(self) -> FloatArray:
        """Orthonormal rows (n_nuisance, n_sample) of offset and free response."""
        each, rows = self._experiment, []
        if each.offset:
            ones = np.ones((1, each.n_sample))
            states = propagate(self._answered, self._period, ones, "rest")[0]
            rows += [ones] if each.start == "periodic" else [ones, states]
        if each.start == "free":
            rows.append(release(self._answered, self._period, each.n_sample))
        if not rows:
            return np.zeros((0, each.n_sample))
        stacked = np.concatenate(rows)
        return np.asarray(np.linalg.qr((stacked / np.linalg.norm(stacked, axis=1, keepdims=True)).T)[0].T)


def _solve(signals: Sequence[_Filtered], n_told: int, *, instruments: bool) -> FloatArray:
    """Returns the denominator's change (n_pole,) along the states' numerators.

    Args:
        signals: The filtered signals.
        n_told: Numerator coefficients of one output.
        instruments: Whether the simulated outputs are instruments for the measured ones.

    Returns:
        The change; NaN where the signals overflow.
    """
    n_out, n_pole, _ = signals[0].answered.shape
    gram, pull = np.zeros((n_told, n_told)), np.zeros((n_told, n_out))
    for each in signals:
        gram[np.ix_(each.places, each.places)] += each.told @ each.told.T
        pull[each.places] += each.told @ each.outputs.T
    if not np.isfinite(gram).all():
        return np.full(n_pole, np.nan)
    inverse = np.linalg.pinv(gram, rcond=1e-14, hermitian=True)
    best = inverse @ pull
    matrix, right = np.zeros((n_pole, n_pole)), np.zeros(n_pole)
    for output in range(n_out):
        cross, cross_told = np.zeros((n_pole, n_told)), np.zeros((n_told, n_pole))
        for each in signals:
            simulated = best[each.places, output] @ each.told
            z = each.filter(simulated[None])[0] if instruments else each.answered[output]
            matrix -= z @ each.answered[output].T
            right += z @ each.outputs[output]
            cross[:, each.places] += z @ each.told.T
            cross_told[each.places] -= each.told @ each.answered[output].T
        matrix -= cross @ inverse @ cross_told
        right -= cross @ inverse @ pull[:, output]
    if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
        return np.full(n_pole, np.nan)
    size = np.sqrt(np.abs(np.diag(matrix)))
    size[size == 0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / np.outer(size, size), right / size, rcond=1e-12)[0] / size)
