"""Which lines a shot excited, and whether a residual is white."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2, f

from robid.arrays import BoolArray, FloatArray
from robid.models.external.fit.reduction import Experiment

_EXCITED = 1e-3  # of the strongest line's power
_N_LAG = 20
_FEWEST_LINES = 4


def excited_lines(experiment: Experiment) -> BoolArray:
    """Returns which lines (n_line,) of the discrete Fourier transform, zero left out, a shot's commands excite."""
    power = (np.abs(np.fft.rfft(experiment.commands, axis=1)) ** 2).sum(axis=0)[1:]
    smooth = uniform_filter1d(power, 3, mode="nearest")
    return np.asarray(smooth > _EXCITED * smooth.max(initial=0.0))


def whiteness(residual: FloatArray, excited: BoolArray, n_taken: float) -> float:
    """Chance of a white residual to look as coloured as this one.

    Its power where commands excite is held against the rest, and its autocorrelation at the first lags against zero;
    the smaller chance counts twice.

    Args:
        residual (n_sample,): Residual.
        excited (n_line,): Lines that commands excite.
        n_taken: Degrees of freedom that the fit took from this residual.

    Source:
        Ljung and Box (1978), "On a measure of lack of fit in time series models".
    """
    n_sample = len(residual)
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred)) ** 2
    chances = []
    inside, outside = 2 * excited.sum() - n_taken, 2.0 * (~excited).sum()
    if min(inside, outside) >= 2 * _FEWEST_LINES:
        ratio = power[1:][excited].sum() / inside / (power[1:][~excited].sum() / outside)
        tail = f.sf(ratio, inside, outside)
        chances.append(2 * min(tail, 1 - tail))
    n_lag = min(_N_LAG, n_sample // 5)
    padded = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * n_sample)) ** 2)[: n_lag + 1]
    if n_lag and padded[0] > 0:
        lags = np.arange(1, n_lag + 1)
        statistic = n_sample * (n_sample + 2) * np.sum((padded[1:] / padded[0]) ** 2 / (n_sample - lags))
        chances.append(chi2.sf(statistic, n_lag))
    return float(min(1.0, len(chances) * min(chances))) if chances else 1.0


def smoothed_spectrum(residual: FloatArray, excited: BoolArray) -> FloatArray:
    """Power spectrum (n_line + 1,) of a residual (n_sample,), smoothed over a fraction of the band excited.

    White noise of variance one has the spectrum one.
    """
    power = np.abs(np.fft.rfft(residual)) ** 2 / len(residual)
    power[0] = power[1] if len(power) > 1 else power[0]
    reach = int(np.clip(excited.sum() // 8, 2, np.sqrt(len(residual))))
    return np.asarray(uniform_filter1d(power, 2 * reach + 1, mode="reflect"))
