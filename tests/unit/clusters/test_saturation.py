"""Information that saturates at what differs between clusters."""

import numpy as np
import pytest

from cluster_systems import dense_clusters
from robid.clusters.evidence import Evidence, inverted, saturate, saturated, saturation_slope
from tolerances import FINITE_DIFFERENCE, IDENTITY

BETWEEN = np.array([0.04, 0.0, 9.0])


def some_information(seed=1, n_row=6):
    rows = np.random.default_rng(seed).standard_normal((n_row, 3)) * [1.0, 30.0, 0.1]
    return rows.T @ rows


def test_it_is_the_inverse_of_the_sum_of_both_variances():
    information = some_information()
    expected = np.linalg.inv(np.linalg.inv(information) + np.diag(BETWEEN))
    np.testing.assert_allclose(saturate(information, BETWEEN), expected, rtol=1e-9)


def test_a_place_that_leaves_a_direction_open_leaves_it_open():
    information = some_information(n_row=2)
    found = saturate(information, BETWEEN)
    blind = np.linalg.svd(information)[2][-1]
    np.testing.assert_allclose(found @ blind, 0.0, atol=1e-9 * np.abs(found).max())
    near = saturate(information + 1e-7 * np.outer(blind, blind), BETWEEN)
    np.testing.assert_allclose(found, near, atol=1e-5)


def test_long_measurements_in_one_place_never_exceed_what_clusters_differ_by():
    between = np.array([0.04, 0.25, 9.0])
    sizes = [np.diag(saturate(count * some_information(), between)) for count in (1.0, 1e2, 1e4, 1e9)]
    assert (np.diff(sizes, axis=0) > 0).all()
    np.testing.assert_allclose(sizes[-1], 1 / between, rtol=1e-4)


@pytest.mark.parametrize("visits", [2, 3, 10])
def test_visits_to_one_place_are_worth_at_most_as_much_as_places(visits):
    once, often = saturate(some_information(), BETWEEN), saturate(visits * some_information(), BETWEEN)
    assert np.linalg.eigvalsh(visits * once - often).min() > -1e-9
    assert np.linalg.eigvalsh(often - once).min() > -1e-9


@pytest.mark.parametrize("n_row", [2, 6])
def test_its_slope_is_that_of_finite_differences_and_falls(n_row):
    information, step = some_information(n_row=n_row), 1e-5
    ends = [saturate((1 + side * step) * information, BETWEEN) for side in (1, -1)]
    slope = saturation_slope(information, BETWEEN)
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), atol=FINITE_DIFFERENCE * np.abs(slope).max())
    further = saturate(information, BETWEEN) + 2 * slope - saturate(3 * information, BETWEEN)
    assert np.linalg.eigvalsh(further).min() > -1e-9


def test_evidence_is_weighted_as_the_whole_covariance_weighs_it():
    clusters = dense_clusters(4, 6, np.sqrt(BETWEEN), seed=2)
    found = saturated(clusters.evidence, BETWEEN)
    for index, (rows, measured) in enumerate(zip(clusters.derivative, clusters.measured, strict=True)):
        covariance = np.eye(6) + (rows * BETWEEN) @ rows.T
        np.testing.assert_allclose(found.information[index], rows.T @ np.linalg.solve(covariance, rows), rtol=1e-9)
        np.testing.assert_allclose(found.score[index], rows.T @ np.linalg.solve(covariance, measured), rtol=1e-8)
        np.testing.assert_allclose(found.log_determinant[index], np.linalg.slogdet(covariance)[1], rtol=1e-9)


def test_nothing_is_said_along_what_nothing_sees():
    inverse, logarithm = inverted(np.diag([4.0, 0.0]))
    np.testing.assert_allclose(inverse, np.diag([0.25, 0.0]), atol=IDENTITY)
    assert logarithm == pytest.approx(np.log(4.0))


@pytest.mark.parametrize("digits", [1, 6, 11, 15])
def test_the_inverse_is_that_of_what_is_seen_however_little_is(digits):
    generator = np.random.default_rng(digits)
    turn, size = np.linalg.qr(generator.standard_normal((9, 9)))[0], 10.0 ** generator.uniform(-4, 4, 9)
    values = np.logspace(0, -digits, 9)
    total = (turn * values) @ turn.T
    scale = np.sqrt(np.diag(total))
    scaled = total / (scale[:, None] * scale)
    seen = np.linalg.eigvalsh(scaled) > 1e-13 * np.linalg.eigvalsh(scaled)[-1]
    assert seen.all() == (digits < 15)
    inverse, logarithm = inverted(total * size[:, None] * size)
    expected = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True) / (scale[:, None] * scale * size[:, None] * size)
    # As many digits are lost as information differs.
    np.testing.assert_allclose(
        inverse, expected, rtol=10.0 ** (min(digits, 13) - 15), atol=1e-3 * np.abs(expected).min()
    )
    determinant = np.log(np.linalg.eigvalsh(scaled)[seen]).sum() + 2 * np.log(scale * size).sum()
    assert logarithm == pytest.approx(determinant, abs=10.0 ** (min(digits, 13) - 14))


def test_evidence_without_any_noise_to_speak_of_saturates_too():
    """Rounding takes the smallest eigenvalues away where information is beyond all digits."""
    rows = 1e9 * np.random.default_rng(3).standard_normal((2, 5, 2))
    evidence = Evidence(rows, np.zeros((2, 5)), np.zeros((2, 2)), np.zeros(2))
    found = saturated(evidence, np.array([1.0, 4.0]))
    np.testing.assert_allclose(found.information, np.diag([1.0, 0.25]) + np.zeros((2, 2, 2)), atol=1e-3)
