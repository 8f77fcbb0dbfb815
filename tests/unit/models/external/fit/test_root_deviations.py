"""Deviations of poles and zeros against those of many drawn polynomials."""

import numpy as np

from robid.models.external.fit.graphs import Fitted, root_loci
from robid.models.external.fit.transfer import TransferMatrix

POLES, ZEROS = np.array([-1 + 3j, -1 - 3j, -4]), np.array([[2.0], [-5.0]])


def test_roots_scatter_as_they_are_said_to():
    numerator = np.array([[np.poly(each)] for each in ZEROS])
    model = TransferMatrix(("u",), ("x", "y"), numerator, np.poly(POLES).real, 0, 1, 0.01, "zoh")
    generator = np.random.default_rng(1)
    coefficients = np.concatenate([numerator.ravel(), model.denominator[1:]])
    root = 1e-3 * generator.standard_normal((coefficients.size, coefficients.size)) * np.abs(coefficients)[:, None]
    loci = root_loci([Fitted(model, root)])
    drawn = coefficients + generator.standard_normal((4000, coefficients.size)) @ root.T
    for channel in range(2):
        zeros = -drawn[:, 2 * channel + 1] / drawn[:, 2 * channel]
        np.testing.assert_allclose(loci.zero_std[channel], zeros.std(), rtol=0.05)
        poles = np.array([np.roots([1, *row[4:]]) for row in drawn])
        nearest = np.take_along_axis(
            poles, np.abs(poles[:, None] - loci.poles[channel][:, None]).argmin(axis=2), axis=1
        )
        np.testing.assert_allclose(loci.pole_std[channel].real, nearest.real.std(axis=0), rtol=0.05)
        np.testing.assert_allclose(loci.pole_std[channel].imag, nearest.imag.std(axis=0), rtol=0.05, atol=1e-12)
