"""Poles, zeros and gains with their covariance against finite differences."""

import numpy as np
import pytest

from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.parameters import block_parameters, estimate_of
from robid.models.external.fit.transfer import TransferMatrix
from tolerances import FINITE_DIFFERENCE

DENOMINATOR = np.polymul(np.polymul([1.0, 4.0], [1.0, 300.0]), [1.0, 2 * 0.1 * 20, 400.0])
NUMERATORS = np.array([[2.0, -16.0, 800.0], [0.5, 3.0, 4.0]])


def model_of(coefficients):
    return TransferMatrix(
        inputs=("X",),
        outputs=("X", "Y"),
        numerator=coefficients[:6].reshape(2, 1, 3),
        denominator=np.concatenate([[1.0], coefficients[6:]]),
        delay_samples=2,
        moving_average=1,
        sampling_period_s=0.012,
        hold="zoh",
    )


COEFFICIENTS = np.concatenate([NUMERATORS.ravel(), DENOMINATOR[1:]])


def parameters_of(coefficients, root):
    return block_parameters("matrix", ("X", "Y"), ("1", "m/rad"), model_of(coefficients), root)


def test_values_are_rates_frequencies_and_dampings():
    found = parameters_of(COEFFICIENTS, np.zeros((10, 10)))
    known = {row.name: row.value for row in found}
    assert known == pytest.approx(
        {
            "matrix.pole1": 4.0,
            "matrix.pole2.frequency": 20.0,
            "matrix.pole2.damping": 0.1,
            "matrix.pole3": 300.0,
            "X.gain": 800 / 480000,
            "X.zero1.frequency": 20.0,
            "X.zero1.damping": -0.2,
            "Y.gain": 4 / 480000,
            "Y.zero1": 2.0,
            "Y.zero2": 4.0,
        }
    )
    assert [row.unit for row in found if row.name == "Y.gain"] == ["m/rad"]
    assert [row.reachable for row in found] == [True, True, True, False, *[True] * 6]


def test_rows_are_the_slopes_by_the_coefficients():
    found = np.array([row.moves for row in parameters_of(COEFFICIENTS, np.eye(10))])
    for index, value in enumerate(COEFFICIENTS):
        step = 1e-6 * abs(value)
        moved = [parameters_of(COEFFICIENTS + sign * step * np.eye(10)[index], np.eye(10)) for sign in (1, -1)]
        ends = [np.array([row.value for row in rows]) for rows in moved]
        slope = (ends[0] - ends[1]) / (2 * step)
        scale = np.abs(found * np.abs(COEFFICIENTS)).max(axis=1) / abs(value)
        np.testing.assert_allclose(found[:, index] / scale, slope / scale, atol=10 * FINITE_DIFFERENCE)


def test_an_estimate_has_the_intervals_of_its_covariance():
    root = 1e-3 * np.diag(COEFFICIENTS)
    blocks = [parameters_of(COEFFICIENTS, root)]
    estimate = estimate_of(blocks, ExternalOptions(confidence=0.97), ("a sentence",), "converged", "")
    std = np.sqrt(np.diag(estimate.covariance))
    np.testing.assert_allclose((estimate.upper - estimate.lower) / std, 2 * 2.17009, rtol=1e-5)
    assert not estimate.identifiable[estimate.names.index("matrix.pole3")], "above half the sampling rate"
    assert estimate.identifiable[estimate.names.index("matrix.pole1")]
    assert np.isnan(estimate.nominal).all()
