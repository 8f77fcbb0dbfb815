"""The least-squares problem of fits to responses: basis, derivatives and starts."""

from dataclasses import replace

import numpy as np
import pytest

from robid.models.external.response.basis import orthogonalise, parted
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.denominator import denominator_of
from robid.models.external.response.descent import descend, normal_of
from robid.models.external.response.lines import make_lines
from robid.models.external.response.residual import evaluate
from robid.models.external.response.starts import grown, relocated, spread_poles, without_each
from tolerances import FINITE_DIFFERENCE, IDENTITY

POLES = np.array([-0.02 + 0.5j, -0.02 - 0.5j, -0.005 + 2j, -0.005 - 2j, -0.7, -3.0])
X = np.geomspace(0.05, 20, 150)


def lines(time="continuous", n_element=2, seed=0, noise=1.0):
    """Data of known poles, in units of a real part's deviation."""
    rng = np.random.default_rng(seed)
    s = 1j * X
    G = sum(rng.standard_normal((n_element, 1)) * abs(p) / (s - p) for p in POLES[POLES.imag == 0])
    for p in POLES[POLES.imag > 0]:
        a, b = rng.standard_normal((2, n_element, 1))
        G = G + (a * abs(p) ** 2 + b * s * abs(p) * 0.1) / ((s - p) * (s - p.conj()))
    sigma = 0.01 * np.abs(G) + 1e-3
    G = G + noise * sigma * (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape)) / np.sqrt(2)
    frequency = X / (2 * np.pi) if time == "continuous" else np.arctan(X) / np.pi
    data = MeasuredResponse(frequency, G.T[:, :, None], sigma.T[:, :, None] ** 2, 1.0)
    return make_lines(data, time)


@pytest.mark.parametrize("damping", [0.02, 1e-5])
def test_columns_are_orthonormal_polynomials(damping):
    poles = np.array([complex(-damping * w, sign * w) for w in X[10::25] for sign in (1, -1)])
    weights = 1 / np.abs(np.prod(1j * X - poles[:, None], axis=0))[None]
    V, polynomials = orthogonalise(weights, X, 13)
    for own in (V.even[0], V.odd[0]):
        np.testing.assert_allclose(own @ own.T, np.eye(len(own)), atol=IDENTITY)
    values = polynomials.values(1j * X)
    np.testing.assert_allclose(values * weights, V.one(0), rtol=1e-7, atol=IDENTITY)


@pytest.mark.parametrize("degree", [0, 1, 6, 13])
def test_one_weight_alone_has_the_columns_that_it_has_beside_others(degree):
    weights = np.random.default_rng(2).uniform(0.1, 3, (3, len(X)))
    whole, polynomials = orthogonalise(weights, X, degree)
    for index, weight in enumerate(weights):
        alone, own = orthogonalise(weight[None], X, degree)
        np.testing.assert_allclose(alone.one(0), whole.one(index), atol=IDENTITY)
        np.testing.assert_allclose(own.recurrence[0], polynomials.recurrence[index], rtol=IDENTITY)


def test_what_numerators_follow_leaves_rows_and_sums_of_columns_have_their_coefficients():
    V, _ = orthogonalise(np.ones((2, len(X))), X, 6)
    V.limit(np.array([6, 3]))
    wanted = np.random.default_rng(3).normal(size=(2, 4, 7))
    wanted[1, :, 4:] = 0.0
    rows = np.stack([wanted[index] @ V.one(index) for index in range(2)])
    # Rows have even columns in their real part and odd ones, j V, in the imaginary one.
    np.testing.assert_allclose(V.ordered(V.along(parted(rows))), wanted, atol=IDENTITY)
    np.testing.assert_allclose(V.combine(V.along(parted(rows))), parted(rows), atol=IDENTITY)


def test_roots_are_those_of_the_sum():
    _, polynomials = orthogonalise(np.ones((1, len(X))), X, 6)
    true = np.sort_complex(POLES)
    powers = polynomials.powers()
    coefficients = np.linalg.solve(powers.T, np.real(np.poly(POLES))[::-1])
    np.testing.assert_allclose(np.sort_complex(polynomials.roots(coefficients)), true, rtol=1e-8)


def test_a_denominator_has_the_poles_it_was_built_of():
    for poles in (POLES, POLES[:5], POLES[4:], np.array([-1.0, 2.0, -3.0]), np.array([-1.0, -1.0])):
        found = denominator_of(poles.astype(complex), 1)
        np.testing.assert_allclose(np.sort_complex(found.moving_poles()), np.sort_complex(poles), rtol=1e-12)
        value, _ = found.evaluate(1j * X)
        np.testing.assert_allclose(value, 1j * X * np.polyval(np.poly(poles), 1j * X), rtol=IDENTITY)


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_gradient_against_differences(time):
    data = lines(time)
    moved = POLES * 1.02 / data.reference
    denominator, delay, degrees = denominator_of(moved, 1), 0.3, (4, 5)
    gradient = 2 * normal_of(evaluate(data, denominator, delay, degrees), data, delayed=True).gradient

    def cost(parameters):
        own = replace(denominator, coefficients=parameters[:-1])
        return evaluate(data, own, parameters[-1], degrees).cost

    start, found = np.append(denominator.coefficients, delay), []
    for index in range(len(start)):
        step = 1e-5 * np.eye(len(start))[index]
        # Richardson's extrapolation of central differences.
        coarse, fine = ((cost(start + h * step) - cost(start - h * step)) / (2e-5 * h) for h in (2, 1))
        found.append((4 * fine - coarse) / 3)
    np.testing.assert_allclose(gradient, found, rtol=FINITE_DIFFERENCE, atol=FINITE_DIFFERENCE * np.abs(found).max())


def test_relocation_finds_the_poles_of_an_exact_response():
    data = lines(noise=0.0)
    state = relocated(data, spread_poles(data, 6, 0), 0.0, (5, 5), 20)
    true = np.sort_complex(POLES / data.reference)
    np.testing.assert_allclose(np.sort_complex(state.denominator.moving_poles()), true, rtol=1e-4)


def test_a_pair_grows_where_one_is_missing():
    data = lines(noise=0.1)
    without = next(each for each in without_each(denominator_of(POLES / data.reference)) if each.n_pole == 4)
    state = descend(data, without, 0.0, (4, 4))
    missing = np.delete(POLES / data.reference, 0)
    places = np.abs(grown(data, state, 1)[0].moving_poles())
    assert np.min(np.abs(np.log(places / np.abs(POLES[0] / data.reference)))) < 0.1
    assert len(places) == len(missing) + 1


def test_a_descent_that_keeps_poles_stable_does_so_from_unstable_ones():
    data = lines(noise=0.1)
    unstable = denominator_of(POLES / data.reference * np.array([1j, -1j, 1, 1, 1, 1]) ** 2)
    assert (unstable.moving_poles().real > 0).any()
    found = descend(data, unstable, 0.0, (5, 5), stable=True, max_iterations=1)
    assert (found.denominator.moving_poles().real < 0).all()
