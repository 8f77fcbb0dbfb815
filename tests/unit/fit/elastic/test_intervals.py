"""How wide intervals are: a plain covariance, degrees of freedom, clusters of one place."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t

from exact_systems import exact_frf, two_joint_robot
from realizations import averaged
from robid.fit.elastic.fitting import fit_elastic
from robid.fit.elastic.intervals import Spread, at_least
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.uncertainty import configuration_covariance
from tolerances import IDENTITY

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
FREQUENCY_HZ = np.geomspace(2.0, 60.0, 30)
OPTIONS = ElasticOptions(strategy="plain", statics_updates=1)


def linear_problem(derivative, measured, places):
    """A linear regression (n_conf, n_freq, n_param) as a problem, and its solution."""
    rows = derivative.reshape(-1, derivative.shape[-1])
    found = np.linalg.lstsq(rows, measured.ravel(), rcond=None)[0]
    error = (measured - derivative @ found)[..., None, None].astype(complex)
    problem = SimpleNamespace(
        linear=lambda _: (error, derivative[:, :, None, None].astype(complex)),
        fully_weighted=lambda values: values,
        parameters=SimpleNamespace(prior_std=np.full(found.size, np.inf)),
        frf=SimpleNamespace(configurations=places),
    )
    return problem, found


@pytest.mark.parametrize("amplitudes", [1, 2, 4])
def test_amplitudes_of_one_place_are_one_cluster(amplitudes):
    # What the model lacks is the same at all amplitudes of a place; a constant and a slope are sought.
    generator = np.random.default_rng(1)
    places = np.repeat(generator.uniform(-2, 2, (8, 2)), amplitudes, axis=0)
    places += 1e-4 * generator.uniform(-1, 1, places.shape)
    derivative = np.repeat(generator.standard_normal((8, 5, 2)), amplitudes, axis=0)
    noise = Spread(1e-12 * np.eye(2), np.full(2, np.inf), "noise")
    held = []
    for _ in range(1000):
        lacking = np.repeat(generator.standard_normal((8, 1)) * derivative[::amplitudes, :, 0], amplitudes, axis=0)
        measured = lacking + 0.1 * generator.standard_normal(lacking.shape)
        problem, found = linear_problem(derivative, measured, places)
        spread = at_least(noise, configuration_covariance(problem, found), 8, 0.95)
        held.append(np.abs(found) <= spread.reach(0.95))
    assert 0.93 < np.mean(held) < 0.985


def test_a_jackknife_adds_what_is_missing_with_its_own_correlations_and_no_quantile():
    own = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 4.0]])
    shift = np.array([[3.0, -3.0, 0.2], [1.0, -1.0, 0.1]])
    jackknife = shift.T @ shift
    found = at_least(Spread(own, np.full(3, np.inf), "noise"), jackknife, 5, 0.95)
    np.testing.assert_allclose(np.diag(found.covariance), [10.0, 10.0, 4.0], rtol=IDENTITY)
    np.testing.assert_array_equal(found.degrees_of_freedom, [4, 4, np.inf])
    # Nine tenths of the variance are fully anticorrelated, the rest keeps its correlation.
    assert found.covariance[0, 1] == pytest.approx(0.5 - 9.0)
    np.testing.assert_allclose(found.reach(0.95), [*[t.ppf(0.975, 4) * np.sqrt(10)] * 2, 1.959963985 * 2], rtol=1e-8)
    assert found.rule == "noise; jackknife over 5 places where that is wider (2 of 3 parameters)"


@pytest.fixture(scope="module")
def solution():
    robot = two_joint_robot()
    shoulder, elbow = robot.joints
    sure = replace(shoulder, motor=replace(shoulder.motor, inertia_relative_std=1e-4))
    frf = averaged(exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ), 0.003, seed=1)
    return fit_elastic(replace(robot, joints=(sure, elbow)), frf, OPTIONS, 0.0)


def test_what_is_known_and_hardly_told_by_the_data_is_known_beforehand(solution):
    told = dict(
        zip(
            solution.estimate.names,
            zip(solution.estimate.identifiable, solution.estimate.known_beforehand, strict=True),
            strict=True,
        )
    )
    assert told["shoulder.motor_inertia"] == (False, True)
    assert told["elbow.motor_inertia"] == (True, False)
    assert told["gear_1.stiffness"] == (True, False)
    assert (
        dict(zip(solution.estimate.names, solution.estimate.prior_relative_std, strict=True))["shoulder.motor_inertia"]
        == 1e-4
    )


def test_identified_is_what_the_interval_after_the_fit_bears_out_too(solution):
    assert solution.estimate.identified[solution.estimate.names.index("gear_1.stiffness")]
    # Deviations of 19 and 21 % on either side of the limit of 20 %.
    for deviation, good in ((0.19, True), (0.21, False)):
        after = replace(solution.estimate, relative_half_width=np.full(len(solution.estimate.names), 1.96 * deviation))
        np.testing.assert_array_equal(after.identified, solution.estimate.identifiable & good)


def test_the_rule_without_more_than_noise_and_assumed_error(solution):
    assert solution.estimate.interval_rule == "noise and assumed model error"
    assert np.isinf(solution.estimate.degrees_of_freedom).all()
