"""Residuals over frequency: what noise leaves, how the cost's deviations add up, and where a wrong model shows."""

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, two_mass_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.residuals import line_residuals
from robid.results.line_residuals import root_mean_square

LINES = np.unique(np.round(np.geomspace(2, 60, 50), 1))
PLACES = [[0.3, -0.4], [1.0, 0.6], [-0.8, 0.9]]
EVERY = (0, 1, 2, 3)


def fitted_of(robot, frf, **options):
    chosen = ElasticOptions(free=("stiffness", "damping"), starts=1, **options)
    solution = fit_elastic(robot, frf, chosen, 0.0)
    return fitted_model(robot, solution, frf, chosen, 0.0), solution


@pytest.mark.parametrize("residual", ["lls", "nls", "llsm"])
def test_of_noise_alone_deviations_are_one_and_relative_residuals_those_of_the_noise(residual):
    frf = exact_frf(two_joint_robot(), PLACES, LINES, relative_noise=1e-3, seed=4)
    fitted, _ = fitted_of(two_joint_robot(), frf, estimator=residual, weights=Weights("optimal"))
    found = line_residuals(fitted)
    counted = np.isfinite(found.deviations)
    # Of n squares of one complex number each the mean scatters by 1/sqrt(n), of real ones by sqrt(2/n).
    chance = 4 * np.sqrt((1 if residual != "llsm" else 2) / counted.sum())
    assert root_mean_square(found.deviations, EVERY) ** 2 == pytest.approx(1, abs=chance + 0.01)
    np.testing.assert_allclose(found.noise_deviations[counted], 1, rtol=1e-9)
    ratio = root_mean_square(found.relative / found.noise, EVERY)
    assert ratio == pytest.approx(1, abs=2 / np.sqrt(counted.sum()) + 0.01)


def test_the_mean_square_in_deviations_is_the_misfit():
    frf = exact_frf(two_joint_robot(), PLACES, LINES, relative_noise=2e-3, seed=5)
    weights = Weights("inflated", model_error=0.01)
    fitted, solution = fitted_of(two_joint_robot(), frf, weights=weights)
    found = line_residuals(fitted)
    assert root_mean_square(found.deviations, EVERY) ** 2 == pytest.approx(solution.misfit, rel=1e-6)
    # Beside the noise s, an assumed error e leaves it s / sqrt(s^2 + e^2) of a deviation.
    counted = np.isfinite(found.noise)
    expected = found.noise[counted] / np.hypot(found.noise[counted], 0.01)
    np.testing.assert_allclose(found.noise_deviations[counted], expected, rtol=1e-9)


def test_a_wrong_model_shows_at_its_resonance():
    true = two_mass_robot()
    lines = np.arange(11.0, 251.0)
    frf = exact_frf(true, [[0.0]], lines, relative_noise=1e-3, seed=6)
    fitted, solution = fitted_of(true, frf)
    soft = exact_frf(with_spring_factors(true, 1.1), [[0.0]], lines, relative_noise=1e-3, seed=6)
    found = line_residuals(fitted_model(true, solution, soft, fitted.options, 0.0))
    size = found.relative[0, :, 0, 0]
    resonance = np.sqrt(546.4 * (1 / 4.752e-3 + 1 / 4.780e-3)) / (2 * np.pi)
    near = np.abs(lines / resonance - 1) < 0.06
    assert np.nanmax(size[near]) > 1
    assert np.nanmedian(size[~near]) < 0.2
    assert np.nanmax(found.deviations[0, near, 0, 0]) > 30


def test_elements_that_the_fit_leaves_out_are_left_out():
    frf = exact_frf(two_joint_robot(), PLACES, LINES, relative_noise=1e-3)
    fitted, _ = fitted_of(two_joint_robot(), frf, weights=Weights("optimal", low_cut_hz=10.0))
    found = line_residuals(fitted)
    for values in (found.relative, found.noise, found.deviations, found.noise_deviations):
        assert np.isnan(values[:, LINES < 10]).all()
        assert np.isfinite(values[:, LINES >= 10]).any()
