"""Derivatives of a problem's model against central differences of its response."""

import numpy as np

STEP = 1e-4


def check_derivatives(problem, rows):
    """Holds columns of the derivative at a random point against differences of the log response, none of them zero."""
    size = len(problem.parameters.names)
    point = np.random.default_rng(2).uniform(-0.1, 0.1, size)
    _, derivative = problem.linear(point)
    for index in rows:
        step = STEP * (np.arange(size) == index)
        ahead, behind = (np.log(problem.model_response(point + side * step)) for side in (1, -1))
        difference = (ahead - behind) / (2 * STEP)
        largest = np.abs(difference).max()
        assert largest > 1e-6
        np.testing.assert_allclose(derivative[..., index], difference, rtol=1e-5, atol=1e-7 * largest)
