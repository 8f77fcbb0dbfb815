"""Covariances from some realizations alone."""

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from realizations import POOLED, averaged
from robid.errors import DataError
from robid.frf.covariance import by_realizations
from tolerances import IDENTITY


def noisy(n_real, seed=0):
    configurations, frequency_hz = np.array([[0.2, 0.4], [0.5, -0.3]]), np.geomspace(2, 60, 40)
    return averaged(exact_frf(two_joint_robot(), configurations, frequency_hz), 0.01, n_real=n_real, seed=seed)


def test_all_realizations_give_the_covariance_that_is_there():
    frf = noisy(5)
    found = by_realizations(frf, range(5), POOLED)
    np.testing.assert_allclose(found.total_covariance, frf.total_covariance, rtol=1e-8)
    np.testing.assert_allclose(found.element_scale, frf.element_scale, rtol=IDENTITY)
    assert found.total_degrees_of_freedom == frf.total_degrees_of_freedom


def test_halves_differ_but_are_right_on_average():
    frf = noisy(4)
    parts = [by_realizations(frf, half, POOLED).element_variance() for half in ((0, 1), (2, 3))]
    ratios = [float((part / frf.element_variance()).mean()) for part in parts]
    assert abs(np.mean(ratios) - 1) < 0.15
    assert np.abs(parts[0] / parts[1] - 1).max() > 0.5


def test_one_realization_has_no_covariance():
    with pytest.raises(DataError, match="needs two of them, not 1"):
        by_realizations(noisy(4), [2], POOLED)
