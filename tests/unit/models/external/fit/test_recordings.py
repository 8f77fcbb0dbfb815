"""Recordings of plants that differ by a known amount: intervals hold the mean plant, and one recording says little."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, norm, t

from external_loops import channels
from external_shots import shot, sweep, transfer
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.parameters import block_parameters
from robid.models.external.fit.problem import Structure
from robid.models.external.fit.recordings import pool_recordings
from tolerances import IDENTITY

TRUTH = {"X.pole1.frequency": 20.0, "X.pole1.damping": 0.5, "X.gain": 1.0}
APART, NOISE = 5e-4, 1e-5
OPTIONS = ExternalOptions(poles=2, zeros=0, delay_samples=2)
PORTS = channels(("X",), "position_command"), channels(("X",))


def recordings(count, seed, *, apart=APART, noise=NOISE, amplitudes=None):
    """Shots of plants whose natural frequency, damping and gain differ by a relative deviation each."""
    rng = np.random.default_rng(seed)
    for index in range(count):
        frequency, damping, gain = np.array(list(TRUTH.values())) * (1 + apart * rng.standard_normal(3))
        plant = transfer([gain * frequency**2], [1, 2 * damping * frequency, frequency**2], delay=2)
        size = 1.0 if amplitudes is None else amplitudes[index]
        fields = {"start": "free", "offset": True, "place": f"day {index + 1}"}
        yield shot(plant, sweep(5.2, 2000, amplitude=size), noise=noise, seed=100 * seed + index, **fields)


def fitted(shots):
    return fit_external(list(shots), *PORTS, "zoh", OPTIONS)


def held(solution):
    estimate = solution.estimate
    truth = np.array([TRUTH[name] for name in estimate.names])
    return (estimate.lower <= truth) & (truth <= estimate.upper)


def compared(shots):
    fit = fit_block(shots, [0], [0], Structure(2, 0, 2))
    every = np.eye(len(fit.parameters))
    return pool_recordings(shots, [0], [0], fit, lambda model: block_parameters("X", ["X"], ["1"], model, every))[1]


def test_intervals_of_several_recordings_hold_the_mean_plant_and_of_one_do_not():
    several = np.array([held(fitted(recordings(3, seed))) for seed in range(12)])
    alone = np.array([held(fitted(recordings(1, seed))) for seed in range(12)])
    assert several.sum() >= binom.ppf(1e-3, several.size, 0.95)
    assert alone.mean() < 0.3


def test_the_deviation_between_recordings_comes_back():
    found = np.array([compared(list(recordings(4, seed))).std for seed in range(12)])
    # The mean of 12 variances of 3 degrees of freedom has a relative deviation of sqrt(2 / 36).
    np.testing.assert_allclose((found**2).mean(axis=0), APART**2, rtol=4 * np.sqrt(2 / 36))


def test_the_width_is_that_of_a_mean_of_so_many_recordings():
    solution = fitted(recordings(3, 7))
    estimate = solution.estimate
    expected = t.ppf(0.975, 2) * solution.between_std / np.sqrt(3)
    np.testing.assert_allclose(estimate.relative_half_width, expected, rtol=0.02)
    np.testing.assert_allclose(estimate.degrees_of_freedom, 2, rtol=0.05)
    np.testing.assert_allclose((estimate.upper - estimate.lower) / 2 / estimate.value, expected, rtol=0.02)


def test_recordings_that_differ_by_noise_alone_keep_its_intervals():
    shots = list(recordings(3, 11, apart=0.0, noise=1e-3))
    solution = fitted(shots)
    together = fitted([replace(each, place="one") for each in shots])
    same = solution.between_std == 0
    assert same.any()
    ends = [(each.estimate.upper - each.estimate.lower)[same] for each in (solution, together)]
    np.testing.assert_allclose(*ends, rtol=0.5)  # the others differ, and are correlated with these
    assert np.isinf(solution.estimate.degrees_of_freedom[solution.between_std == 0]).all() or not same.all()


def test_one_recording_leaves_the_normal_interval_and_says_what_it_cannot_know():
    solution = fitted(recordings(1, 3))
    estimate = solution.estimate
    std = np.sqrt(np.diag(estimate.covariance))
    np.testing.assert_allclose(estimate.upper - estimate.value, norm.ppf(0.975) * std, rtol=IDENTITY)
    assert np.isnan(solution.between_std).all()
    assert solution.recordings.tolist() == [1]
    several = fitted(recordings(3, 3))
    assert several.recordings.tolist() == [3]
    assert "day to day" in estimate.interval_rule
    assert "day to day" not in several.estimate.interval_rule
    assert [sum("day to day" in each for each in one.remarks) for one in (solution, several)] == [1, 0]


def test_what_one_of_two_recordings_alone_tells_is_not_called_tested():
    shots = list(recordings(2, 5, amplitudes=(1.0, 1e-3)))
    found = compared(shots)
    assert found.untested.all()
    assert found.root.shape == (3, 0)
    assert not compared(list(recordings(2, 5))).untested.any()


def test_responses_and_predictions_are_as_uncertain_as_the_coefficients():
    one, three = fitted(recordings(1, 9)), fitted(recordings(3, 9))
    root = three.transfers.root_of(0)
    gain = TRUTH["X.gain"] * root[0] / three.transfers.numerator[0, -1] - root[2] / three.transfers.denominator[0, -1]
    index = three.estimate.names.index("X.gain")
    assert np.linalg.norm(gain) == pytest.approx(np.sqrt(three.estimate.covariance[index, index]), rel=0.01)
    assert np.median(three.responses.relative_std / one.responses.relative_std) > 5
