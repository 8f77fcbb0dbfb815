"""Every estimator in a noisy closed loop: bias and covariance against theory and against its own claim."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import exp1

from linear_loop import LINES, MOTORS, Loop, draw_reference, loop_record
from robid.frf.blocks import ESTIMATORS
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks

LINEAR = Loop(torque_noise=0.01, sensor_noise=3e-5)
RMS = 1.0
RUNS = [60, pytest.param(500, marks=pytest.mark.slow)]


@dataclass(frozen=True)
class Outcome:
    """Responses (run, freq, out, in), their claimed variance, and mean noise and total covariances (freq, out, out)."""

    response: np.ndarray
    claimed: np.ndarray
    noise_only: np.ndarray
    noise: np.ndarray
    total: np.ndarray | None

    @property
    def variance(self):
        return self.response.var(axis=0, ddof=1)

    @property
    def bias(self):
        return self.response.mean(axis=0) - LINEAR.response()


def estimate_all(records, estimator, pooled_lines=3):
    frfs = [estimate_frf(r, EstimateOptions(estimator, "none", pooled_lines=pooled_lines)) for r in records]
    total = None if frfs[0].total_covariance is None else np.mean([frf.total_covariance[0] for frf in frfs], axis=0)
    return Outcome(
        np.array([frf.response[0] for frf in frfs]),
        np.mean([frf.element_variance()[0] for frf in frfs], axis=0),
        np.mean([frf.element_variance(noise_only=True)[0] for frf in frfs], axis=0),
        np.mean([frf.noise_covariance[0] for frf in frfs], axis=0),
        total,
    )


def play(loop, runs, realizations, periods, seed, *, same=True):
    """Records of many runs, all with the same reference or each with its own, and the reference's spectrum."""
    generator = np.random.default_rng(seed)
    spectrum, signal = draw_reference(generator, (realizations,) if same else (runs, realizations), RMS)
    reference = np.broadcast_to(signal, (runs, realizations, *signal.shape[-3:]))
    torque, angle = loop.simulate(reference, generator, periods=periods)
    return [loop_record(*each) for each in zip(reference, torque, angle, strict=True)], spectrum


def theory(spectrum, periods, estimator):
    """First-order variance (freq, out, in) of a response and the bias of least squares, from the true noise."""
    torque = LINEAR.torque_spectrum(spectrum)
    covariance, with_torque = LINEAR.residual_noise(periods)
    realizations = len(torque)
    if estimator in ("arithmetic", "logarithmic"):
        weights = np.linalg.inv(torque) / realizations
    else:
        chosen = torque if estimator == "h1" else spectrum
        adjoint = np.swapaxes(chosen, -1, -2).conj()
        weights = adjoint @ np.linalg.inv((torque @ adjoint).sum(axis=0))
    factor = (np.abs(weights) ** 2).sum(axis=(0, 2))
    variance = np.real(np.diagonal(covariance, axis1=1, axis2=2))[:, :, None] * factor[:, None, :]
    power = (torque @ np.swapaxes(torque, -1, -2).conj()).sum(axis=0)
    # Of the experiments' mean noise product, the fit itself takes as many as it has inputs.
    bias = (realizations * MOTORS - MOTORS) * with_torque @ np.linalg.inv(power)
    return variance, bias


def visibility(outcome, direction):
    """The bias along a direction, in its own standard errors; a unit normal variable where there is none."""
    weight = direction / outcome.variance
    along = np.real(weight.conj() * outcome.bias).sum()
    return float(along / np.sqrt(0.5 * (np.abs(weight) ** 2 * outcome.variance).sum() / len(outcome.response)))


def mean_ratio(first, second):
    return float((first / second).mean())
