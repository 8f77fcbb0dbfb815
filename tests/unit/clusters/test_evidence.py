"""What clusters say, compressed to few rows."""

import numpy as np

from robid.clusters.evidence import summarise
from tolerances import IDENTITY


def test_a_weighted_estimate_is_known_by_its_sandwich():
    # Twice the right weights in half of the rows: the estimate has another covariance than the weights say.
    generator = np.random.default_rng(3)
    rows, residual = generator.standard_normal((40, 3)), generator.standard_normal(40)
    weight = np.where(np.arange(40) < 20, 2.0, 1.0)
    bread = rows.T @ (weight[:, None] * rows)
    meat = rows.T @ (weight[:, None] ** 2 * rows)
    score = rows.T @ (weight * residual)
    found = summarise(bread[None], score[None], meat[None], np.zeros((3, 3)), np.zeros(3))
    own = np.linalg.inv(bread)
    np.testing.assert_allclose(np.linalg.inv(found.information[0]), own @ meat @ own, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(found.information[0], found.score[0]), own @ score, rtol=1e-9)


def test_a_place_that_sees_nothing_of_a_parameter_is_no_obstacle():
    bread = np.diag([4.0, 0.0])
    found = summarise(bread[None], np.array([[2.0, 0.0]]), 2 * bread[None], np.zeros((2, 2)), np.zeros(2))
    np.testing.assert_allclose(found.information[0], np.diag([2.0, 0.0]), atol=IDENTITY)
    np.testing.assert_allclose(found.score[0], [1.0, 0.0], atol=IDENTITY)
