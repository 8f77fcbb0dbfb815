"""Intervals of a response against Monte Carlo, and against a change of the states' basis."""

from dataclasses import replace

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, SIZES, local_responses, problem, true_parameters, true_systems
from robid.models.lpv.fit.model import polynomial_basis
from robid.models.lpv.fit.responses import make_problem, solve
from robid.models.lpv.fit.state_space import pack, response, transform, unpack
from robid.models.lpv.fit.uncertainty import parameter_uncertainty, response_uncertainty

TRUTH = true_parameters()
FREE = TRUTH != 0
FREE[0] = True
FREE[1, SIZES.parts[0]] = FREE[2, SIZES.parts[1]] = True
FEW = np.linspace(0.01, 0.35, 15)


def _asked():
    return problem(local_responses(np.concatenate([POSITIONS, LEFT_OUT]), frequency=FEW))


def _fits(weighted, count=100):
    generator = np.random.default_rng(1)
    found = []
    for _ in range(count):
        responses = local_responses(POSITIONS, generator, frequency=np.linspace(0.002, 0.4, 40))
        posed = make_problem(responses, polynomial_basis(POSITIONS, 4), 3, np.ones(2), weighted=weighted)
        found.append(solve(posed, TRUTH, free=FREE)[0])
    return posed, responses, np.array(found)


@pytest.mark.parametrize("weighted", [True, False])
def test_deviations_are_those_of_repeated_fits(weighted):
    posed, responses, fits = _fits(weighted)
    asked = _asked()
    covariance = parameter_uncertainty(posed, TRUTH, FREE, responses.variance).covariance
    predicted = response_uncertainty(asked, TRUTH, covariance)
    exact = response(true_systems(np.concatenate([POSITIONS, LEFT_OUT])), asked.z)
    np.testing.assert_allclose(predicted.response, exact, rtol=1e-9)
    seen = np.array([response(unpack(asked.values @ fit, SIZES), asked.z) for fit in fits])
    # The standard deviation of 100 fits scatters by 7 %; that of a mean over lines and positions less.
    ratio = predicted.total / np.sqrt(np.mean(np.abs(seen - exact) ** 2, axis=0))
    assert abs(np.median(ratio) - 1) < 0.1
    assert np.all((ratio > 0.7) & (ratio < 1.4))


def test_what_is_known_of_responses_does_not_depend_on_the_states_basis():
    posed = problem(local_responses(POSITIONS, np.random.default_rng(2)))
    T = np.random.default_rng(3).standard_normal((3, 3))
    turned = pack(transform(unpack(TRUTH, SIZES), T))
    asked = _asked()
    ours, other = (
        response_uncertainty(asked, one, parameter_uncertainty(posed, one, FREE, 1 / posed.root_weight**2).covariance)
        for one in (TRUTH, turned)
    )
    np.testing.assert_allclose(ours.total, other.total, rtol=1e-4)


def test_where_no_variance_is_known_the_residual_stands_for_it():
    responses = local_responses(POSITIONS, np.random.default_rng(4))
    posed = problem(responses)
    fit, _ = solve(posed, TRUTH, free=FREE)
    found = parameter_uncertainty(posed, fit, FREE, responses.variance)
    known, unknown = found.covariance, parameter_uncertainty(posed, fit, FREE, None).covariance
    assert found.n_determined == FREE.sum() - 9
    assert found.misfit == pytest.approx(1.0, abs=4 / np.sqrt(2000))
    ratio = np.sqrt(np.diag(unknown)[FREE.ravel()] / np.diag(known)[FREE.ravel()])
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert ratio[0] == pytest.approx(1.0, abs=4 / np.sqrt(2 * 2000))
    assert np.all(known[~FREE.ravel()] == 0)


def test_variances_of_few_realizations_give_right_deviations_where_weights_average_them():
    generator = np.random.default_rng(6)
    fits, predicted = [], []
    asked = _asked()
    for _ in range(100):
        exact = local_responses(POSITIONS, generator, frequency=np.linspace(0.002, 0.4, 60))
        rough = exact.variance * generator.chisquare(6, exact.variance.shape) / 6
        responses = replace(exact, variance=rough)
        posed = make_problem(responses, polynomial_basis(POSITIONS, 4), 3, np.ones(2), weighted=True, window=15)
        fit, _ = solve(posed, TRUTH, free=FREE)
        fits.append(response(unpack(asked.values @ fit, SIZES), asked.z))
        covariance = parameter_uncertainty(posed, fit, FREE, rough).covariance
        predicted.append(response_uncertainty(asked, fit, covariance).total ** 2)
    seen = np.mean(np.abs(np.array(fits) - np.mean(fits, axis=0)) ** 2, axis=0)
    assert np.median(np.mean(predicted, axis=0) / seen) == pytest.approx(1.0, abs=0.15)
