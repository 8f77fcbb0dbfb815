"""Huber's estimator against statsmodels' robust linear models."""

import numpy as np
import pytest

from rigid_models import random_rows, stacked
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.regression import huber, reduce_rows

sm = pytest.importorskip("statsmodels.api")


def _centred_scale(_, residual):
    return np.median(np.abs(residual - np.median(residual))) / 0.6745


@pytest.mark.parametrize("bend", [0.5, 1.345, 3.0])
def test_parameters_and_covariance_are_those_of_a_robust_linear_model(bend):
    rows = random_rows(n_row=700, noise=lambda generator: generator.standard_t(3, size=(700, 1)), blocks=3)
    found = huber(rows, reduce_rows(rows), HuberOptions(bend=bend, tolerance=1e-10, iteration_limit=500))
    columns, torque = stacked(rows)
    model = sm.RLM(torque, columns, M=sm.robust.norms.HuberT(bend))
    expected = model.fit(scale_est=_centred_scale, cov="H1", tol=1e-13, maxiter=500)
    np.testing.assert_allclose(found.parameters, expected.params, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, expected.bcov_scaled, rtol=1e-3)
    np.testing.assert_allclose(found.scale[0], expected.scale, rtol=1e-6)
