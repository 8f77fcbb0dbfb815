"""Intervals of a fit to responses of overlapping windows: Monte Carlo over noise on a drive that is known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot
from robid.frf.distortion import completed
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import time_signal

PERIOD_S, STEP_S, DELAY_S = 4.0, 1e-3, 1e-3
N_SAMPLE = round(PERIOD_S / STEP_S)
LINES = np.arange(41, 481, 2)
BINS = np.arange(20, 520)
OPTIONS = ElasticOptions(
    weights=Weights("optimal"), free=("stiffness", "damping", "viscous"), statics_updates=0, start_decades=0
)
ROBOT = two_mass_robot(stiffness=40.0, damping=0.3, viscous=0.05)
RUNS = 100

pytestmark = pytest.mark.slow


def make_record(estimator, seed):
    """Steady state of two realizations; every bin is excited where `local` reads it."""
    lines = BINS if estimator == "local" else LINES
    response = exact_frf(ROBOT, np.zeros((1, 1)), lines / PERIOD_S, sampling_period_s=STEP_S, delay_s=DELAY_S).response
    phases = np.random.default_rng(3).uniform(0, 2 * np.pi, (2, 1, lines.size, 1))
    command = np.exp(1j * phases) * 0.05
    omega = 2 * np.pi * lines / PERIOD_S
    torque = time_signal(command, lines, N_SAMPLE)
    angle = time_signal(-command * response[0, :, :, 0] / omega[:, None] ** 2, lines, N_SAMPLE)
    periods = 1 if estimator == "local" else 2
    shape = (1, 2, 1, periods, N_SAMPLE, 1)
    noise = 2e-3 * np.random.default_rng(seed).standard_normal(shape)
    return Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, 1)),
        inputs=np.broadcast_to(torque[None, :, :, None], shape).copy(),
        outputs=np.broadcast_to(angle[None, :, :, None], shape) + noise,
        reference=None,
        excited_lines=LINES,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(("drive",), "torque"),
        output_channels=motor_channels(("drive",), "angle"),
        output_offset=np.zeros((1, 1)),
    )


@pytest.mark.parametrize("estimator", ["local", "local_periodic"])
def test_claimed_deviation_is_the_one_over_noise(estimator):
    estimates, claimed, alone, blamed = [], [], [], []
    options = EstimateOptions(estimator, local_half_width_lines=5, compensation="none")
    for seed in range(RUNS):
        frf = estimate_frf(make_record(estimator, seed), options)
        solution = fit_elastic(ROBOT, frf, OPTIONS, DELAY_S)
        estimates.append(solution.internal.values)
        claimed.append(np.sqrt(np.diag(solution.internal.covariance)))
        blamed.append(solution.model_error.share_correlated)
        separate = fit_elastic(ROBOT, replace(frf, line_correlation=None), OPTIONS, DELAY_S)
        alone.append(np.sqrt(np.diag(separate.internal.covariance)))
    spread = np.std(estimates, axis=0, ddof=1)
    ratio = spread / np.mean(claimed, axis=0)
    before = spread / np.mean(alone, axis=0)
    told = f"scatter over claim {ratio.round(2)}, {before.round(2)} with lines taken as independent"
    print(f"\n{estimator}: {', '.join(solution.estimate.names)}: {told}")
    np.testing.assert_allclose(ratio, 1.0, atol=0.15)
    # Five per cent of right models are blamed for correlated residuals; three binomial deviations above.
    assert np.mean(blamed) < 0.12


def test_lines_that_were_never_excited_blame_no_right_model():
    """Residuals of overlapping windows are correlated; that lines of another campaign are not says nothing of them."""
    options = EstimateOptions("local_periodic", local_half_width_lines=5, compensation="none")
    n_line, step = LINES.size, int(LINES[1] - LINES[0])
    lines = np.concatenate([LINES, LINES[-1] + step * np.arange(1, 3 * n_line)])
    dropped = (np.arange(lines.size) >= n_line)[:, None]
    for seed in range(3):
        frf = estimate_frf(make_record("local_periodic", seed), options)
        amplitude = np.zeros((lines.size, *frf.input_amplitude.shape[2:]), complex)
        more = completed(frf, dropped, lines, lines / PERIOD_S, amplitude, frf.line_correlation.shape[2])
        own, joined = (fit_elastic(ROBOT, each, OPTIONS, DELAY_S).model_error for each in (frf, more))
        np.testing.assert_allclose(joined.correlation, own.correlation, atol=1e-3)
        np.testing.assert_allclose(joined.correlation_limit, own.correlation_limit, rtol=1e-3)
        assert joined.share_correlated == own.share_correlated
