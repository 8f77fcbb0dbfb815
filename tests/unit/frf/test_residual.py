"""Residuals as values: closed forms, and the two factors by which errors of a response become errors of a residual."""

import numpy as np
import pytest

from robid.frf.residual import LOGARITHM, MAGNITUDE, PLAIN, RESIDUALS
from tolerances import FINITE_DIFFERENCE, IDENTITY

GENERATOR = np.random.default_rng(1)


def random_response(shape=(4, 3, 2)):
    return GENERATOR.standard_normal(shape) + 1j * GENERATOR.standard_normal(shape)


def test_closed_forms():
    ratio, modelled = 2 * np.exp(0.3j), np.array([1 - 1j])
    np.testing.assert_allclose(LOGARITHM.compare(ratio * modelled, modelled), np.log(2) + 0.3j, rtol=IDENTITY)
    np.testing.assert_allclose(MAGNITUDE.compare(ratio * modelled, modelled), np.log(2), rtol=IDENTITY)
    np.testing.assert_allclose(PLAIN.compare(ratio * modelled, modelled), (ratio - 1) * modelled, rtol=IDENTITY)


def test_phase_takes_the_short_way_across_the_branch():
    measured, modelled = np.exp(3.1j) * np.ones(1), np.exp(-3.1j) * np.ones(1)
    wanted = (6.2 - 2 * np.pi) * 1j
    np.testing.assert_allclose(LOGARITHM.compare(measured, modelled), wanted, atol=IDENTITY)
    apart = LOGARITHM.subtract(LOGARITHM.transform(measured), LOGARITHM.transform(modelled))
    np.testing.assert_allclose(apart, wanted, atol=IDENTITY)


@pytest.mark.parametrize("kind", RESIDUALS.values(), ids=list(RESIDUALS))
def test_errors_of_a_response_move_the_residual_by_the_two_factors(kind):
    measured, modelled, error = random_response(), random_response(), random_response()
    step = 1e-6 * error

    def slope(ahead, behind):
        return (kind.compare(*ahead) - kind.compare(*behind)) / 2e-6

    moved = slope((measured + step, modelled), (measured - step, modelled))
    np.testing.assert_allclose(kind.part(error / kind.divisor(measured)), moved, rtol=FINITE_DIFFERENCE, atol=1e-8)
    moved = slope((measured, modelled - step * modelled), (measured, modelled + step * modelled))
    np.testing.assert_allclose(kind.part(error * kind.per_relative(modelled)), moved, rtol=FINITE_DIFFERENCE, atol=1e-8)


@pytest.mark.parametrize("kind", RESIDUALS.values(), ids=list(RESIDUALS))
def test_two_steps_give_the_same(kind):
    measured, modelled = random_response(), random_response()
    apart = kind.subtract(kind.transform(measured), kind.transform(modelled))
    np.testing.assert_allclose(apart, kind.compare(measured, modelled), atol=IDENTITY)


@pytest.mark.parametrize("kind", RESIDUALS.values(), ids=list(RESIDUALS))
def test_parts_are_the_real_numbers_of_a_residual(kind):
    residual = kind.compare(random_response(), random_response())
    assert kind.parts == 1 + (np.abs(residual.imag) > 0).all()
    assert np.isrealobj(kind.transform(random_response())) == (kind.parts == 1)


def test_an_element_without_response_has_no_relative_error_and_needs_no_division():
    nothing = np.zeros(3, complex)
    np.testing.assert_array_equal(LOGARITHM.per_relative(nothing), 1)
    np.testing.assert_array_equal(PLAIN.divisor(nothing), 1)
    assert RESIDUALS["nls"] is PLAIN
