"""The noise of a mean over few periods: a loop's exact covariance, and what falls within the bands."""

from dataclasses import replace

import numpy as np
import pytest

from linear_loop import Loop, draw_reference, loop_record
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions

LOOP = Loop(torque_noise=0.01, sensor_noise=3e-5)
RUNS = 200
OPTIONS = EstimateOptions(compensation="none")


def estimated(periods, seed):
    """Responses of one realization each, with signals of their own."""
    generator = np.random.default_rng(seed)
    _, reference = draw_reference(generator, (RUNS, 1), 1.0)
    torque, angle = LOOP.simulate(reference, generator, periods=periods)
    return [estimate_frf(loop_record(*each), OPTIONS) for each in zip(reference, torque, angle, strict=True)]


@pytest.mark.parametrize("periods", [2, 3])
def test_few_periods_of_one_realization_know_their_noise(periods):
    found = estimated(periods, seed=31 + periods)
    exact = LOOP.residual_noise(periods)[0]
    ratio = np.mean([np.real(np.diagonal(frf.noise_covariance[0], axis1=1, axis2=2)) for frf in found], axis=0)
    ratio /= np.real(np.diagonal(exact, axis1=1, axis2=2))
    # At the high lines all noise is leakage of slow noise, below the resonance none.
    np.testing.assert_allclose(ratio, 1.0, atol=0.35)
    np.testing.assert_allclose(ratio.mean(), 1.0, atol=0.12)
    inside = [np.abs(frf.response[0] - LOOP.response()) <= frf.error_radius(0.95)[0] for frf in found]
    # The error of a share over runs, whose lines err alike, is below 0.01.
    assert 0.94 - 0.01 <= np.mean(inside) <= 0.97 + 0.01
    assert np.mean(inside, axis=(0, 2, 3)).min() > 0.88


def test_leakage_of_few_lines_leaves_fewer_degrees_of_freedom():
    (frf, *_) = estimated(2, seed=5)
    assert frf.noise_degrees_of_freedom == 2 * 3
    assert 2 <= frf.degrees_of_freedom < 6
    assert frf.radius_factor(0.95) > replace(frf, freedom_share=None).radius_factor(0.95)
