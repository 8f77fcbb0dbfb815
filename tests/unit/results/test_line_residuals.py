"""Residuals by line: sizes relative to the model and to deviations, and root mean squares of what is known."""

import numpy as np

from robid.results.line_residuals import compare_lines, root_mean_square


def test_a_residual_is_related_to_the_model_and_to_its_deviation():
    modelled = np.array([2.0, 2.0j, 4.0, 0.0, 1.0]).reshape(1, 5, 1, 1)
    measured = modelled + np.array([0.3 + 0.4j, 1.0, -1.0, 1.0, 5.0]).reshape(1, 5, 1, 1)
    std = np.array([0.25, np.nan, 2.0, 0.1, np.inf]).reshape(1, 5, 1, 1)
    found = compare_lines(measured, modelled, std)
    np.testing.assert_allclose(found.relative.ravel(), [0.25, 0.5, 0.25, np.nan, np.nan])
    np.testing.assert_allclose(found.noise.ravel(), [0.125, np.nan, 0.5, np.nan, np.nan])
    np.testing.assert_allclose(found.deviations.ravel(), [2.0, np.nan, 0.5, np.nan, np.nan])
    assert np.isnan(found.noise_deviations).all()


def test_a_root_mean_square_is_of_what_is_known():
    values = np.array([[[3.0, np.nan], [4.0, np.nan]], [[np.nan, np.nan], [5.0, 1.0]]])
    np.testing.assert_allclose(root_mean_square(values, (0, 1)), [np.sqrt(50 / 3), 1.0])
    np.testing.assert_allclose(root_mean_square(values, (1, 2)), [np.sqrt(12.5), np.sqrt(13)])
    assert np.isnan(root_mean_square(values[:1, :, 1:], (0, 1))).all()
