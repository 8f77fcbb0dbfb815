"""Basis functions and the range in which they hold."""

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.lpv.fit.model import different_positions, make_basis, polynomial_basis, spline_basis
from robid.models.lpv.fit.options import BasisOptions
from tolerances import IDENTITY

POINTS = np.array([-0.35, -0.1625, 0.025, 0.2125, 0.4])[:, None]
PLANE = np.stack(np.meshgrid(np.linspace(0, 1, 4), np.linspace(-2, 2, 4)), axis=-1).reshape(-1, 2)


def test_polynomials_are_powers_in_units_of_the_farthest_position():
    basis = polynomial_basis(POINTS, 3)
    ratio = POINTS[:, 0] / 0.4
    np.testing.assert_allclose(basis.values(POINTS), np.vander(ratio, 4, increasing=True), rtol=IDENTITY)
    np.testing.assert_allclose(basis.largest, 1.0, rtol=IDENTITY)
    assert basis.functions.names == ("p", "p^2", "p^3")


def test_several_parameters_have_monomials_up_to_a_total_degree():
    basis = polynomial_basis(PLANE, 2)
    assert basis.functions.names == ("p1", "p2", "p1^2", "p1 p2", "p2^2")
    x, y = PLANE[:, 0], PLANE[:, 1] / 2
    expected = np.stack([np.ones(16), x, y, x**2, x * y, y**2], axis=1)
    np.testing.assert_allclose(basis.values(PLANE), expected, atol=IDENTITY)


@pytest.mark.parametrize("points", [POINTS, PLANE])
def test_splines_and_the_constant_span_polynomials_of_their_degree(points):
    basis = spline_basis(points, pieces=2, degree=2)
    grid = basis.grid(31)
    values = basis.values(grid)
    target = np.prod(1 + grid + grid**2, axis=1)
    left = target - values @ np.linalg.lstsq(values, target, rcond=None)[0]
    assert np.abs(left).max() < 1e-9 * np.abs(target).max()
    assert np.linalg.matrix_rank(values) == len(basis.functions.names) + 1 == 4 ** points.shape[1]


def test_a_position_outside_the_range_is_refused_by_its_value():
    with pytest.raises(DataError, match=r"from -0\.35 to 0\.4, not at 0\.41") as caught:
        polynomial_basis(POINTS, 2).values(np.array([[0.0], [0.41]]))
    assert "within the range" in caught.value.remedy


def test_rounding_at_the_end_of_the_range_is_no_reason_to_refuse():
    for basis in (polynomial_basis(POINTS, 2), spline_basis(POINTS, pieces=2)):
        ends = np.array([[-0.35 - 1e-12], [0.4 + 1e-12]])
        np.testing.assert_allclose(basis.values(ends), basis.values(np.array([[-0.35], [0.4]])), atol=1e-9)


def test_options_make_each_kind_of_basis():
    splines = make_basis(POINTS, BasisOptions(kind="splines", degree=2, pieces=2))
    np.testing.assert_array_equal(splines.values(POINTS), spline_basis(POINTS, pieces=2, degree=2).values(POINTS))
    centred = make_basis(POINTS, BasisOptions(degree=2, center=(0.1,)))
    np.testing.assert_allclose(centred.values(POINTS)[:, 1], (POINTS[:, 0] - 0.1) / 0.45, rtol=IDENTITY)
    plain = make_basis(POINTS, BasisOptions(degree=3))
    np.testing.assert_array_equal(plain.values(POINTS), polynomial_basis(POINTS, 3).values(POINTS))
    with pytest.raises(ValueError, match="one value per scheduling parameter"):
        make_basis(PLANE, BasisOptions(center=(0.1,)))


@pytest.mark.parametrize("options", [BasisOptions(degree=3), BasisOptions("splines", degree=2, pieces=3)])
@pytest.mark.parametrize("n_scheduling", [1, 2, 3])
def test_options_count_the_functions_that_they_make(options, n_scheduling):
    points = np.random.default_rng(1).uniform(size=(5, n_scheduling))
    assert options.count(n_scheduling) == len(make_basis(points, options).functions.names) + 1


def test_positions_that_differ_by_noise_are_one():
    points = np.array([[0.0, 5.0], [0.5, 5.0], [0.5 + 1e-5, 5.0 - 1e-5], [0.5, 6.0], [1.0, 6.0]])
    np.testing.assert_array_equal(different_positions(points), [0, 1, 3, 4])
