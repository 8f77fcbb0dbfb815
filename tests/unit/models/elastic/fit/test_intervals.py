"""How wide intervals are, and what is called identified by them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from exact_systems import certain, exact_frf, two_joint_robot, with_spring_factors
from realizations import averaged
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import Spread

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
FREQUENCY_HZ = np.geomspace(2.0, 60.0, 30)
OPTIONS = ElasticOptions(strategy="plain", statics_updates=1)


@pytest.fixture(scope="module")
def solution():
    robot = two_joint_robot()
    shoulder, elbow = robot.joints
    sure = replace(shoulder, motor=replace(shoulder.motor, inertia_relative_std=1e-4))
    frf = averaged(exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ), 0.003, seed=1)
    return fit_elastic(certain(replace(robot, joints=(sure, elbow))), frf, OPTIONS, 0.0)


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
    # Deviations of 19 and 21 % on either side of the limit of 20 %, whatever was predicted.
    n_param = len(solution.estimate.names)
    unknown = replace(solution.estimate, prior_relative_std=np.full(n_param, np.inf))
    for deviation, good in ((0.19, True), (0.21, False)):
        for predicted in (True, False):
            half = np.full(n_param, 1.96 * deviation)
            after = replace(unknown, relative_half_width=half, identifiable=np.full(n_param, predicted))
            assert (after.identified == good).all()
    # What was known to 10 % beforehand is identified where the data have added to it.
    for std, added in ((0.09, False), (0.04, True)):
        known = replace(
            solution.estimate,
            prior_relative_std=np.full(n_param, 0.1),
            identifiable=np.zeros(n_param, bool),
            relative_std=np.full(n_param, std),
            relative_half_width=np.full(n_param, 1.96 * std),
        )
        assert (known.identified == added).all()


def test_the_rule_without_more_than_noise_and_assumed_error(solution):
    assert solution.estimate.interval_rule == "noise and assumed model error"
    assert np.isinf(solution.estimate.degrees_of_freedom).all()


def test_what_is_freed_because_it_is_doubted_is_never_known_beforehand(solution):
    estimate = solution.estimate
    known = replace(estimate, identifiable=np.zeros_like(estimate.identifiable), prior_relative_std=0 * estimate.value)
    assert known.known_beforehand.all()
    assert not replace(known, kinds=("doubt",) * len(known.kinds)).known_beforehand.any()


def test_what_has_run_off_may_be_where_it_was_known_to_be():
    prior = np.log(10) * np.ones(4)
    prior[2] = np.inf
    std = np.array([0.1, 2.3, 2.3, 0.55])
    spread = Spread(np.array([0.3, 9.0, 9.0, -0.7]), np.diag(std**2), np.full(4, np.inf), "")
    lower, upper = spread.ends(0.95, prior)
    plain, known = spread.reach(0.95), norm.ppf(0.975) * np.log(10)
    np.testing.assert_allclose(lower, np.where([False, True, False, False], -known, spread.values - plain))
    np.testing.assert_allclose(upper, spread.values + plain)
    np.testing.assert_allclose(replace(spread, values=-spread.values).ends(0.95, prior), (-upper, -lower))


def test_a_rigid_spring_is_stiff_or_what_the_file_says_and_the_others_keep_their_intervals():
    robot = certain(two_joint_robot())
    rigid = robot.springs[3].name
    places = np.random.default_rng(2).uniform(-1.4, 1.4, (6, 2))
    frf = averaged(exact_frf(with_spring_factors(robot, stiffness=[1, 1, 1, 1e8]), places, FREQUENCY_HZ), 0.003, seed=1)
    estimate = fit_elastic(robot, frf, OPTIONS, 0.0).estimate
    row = estimate.names.index(f"{rigid}.stiffness")
    ends = estimate.effective_lower[row], estimate.value[row], estimate.effective_upper[row]
    lower, value, upper = np.log(np.array(ends) / estimate.nominal[row])
    assert lower == pytest.approx(-norm.ppf(0.975) * np.log(10))
    assert upper > value > np.log(10)
    for name in ("gear_1.stiffness", "gear_2.stiffness", "bearing_1.stiffness"):
        own = estimate.names.index(name)
        ends = estimate.effective_lower[own], estimate.effective_upper[own]
        assert estimate.effective_value[own] == pytest.approx(np.sqrt(np.prod(ends)), rel=1e-3)
        assert ends[1] < 1.1 * ends[0]
