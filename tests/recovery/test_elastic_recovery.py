"""Known elastic parameters come back from responses, without noise exactly, with noise within their intervals."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, friction_frf, two_joint_robot, two_mass_robot, with_spring_factors
from robid.errors import DataError, SettingsError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.result import distinct_minima
from robid.signals.quantities import motor_channels
from tolerances import RECOVERY, RECOVERY_SIGMA

BENCH_HZ = np.arange(11.0, 251.0, 3.0)
ARM_HZ = np.unique(np.round(np.geomspace(1, 60, 40), 1))
ARM_CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
EVERYTHING = ("stiffness", "damping", "viscous", "motor_inertia", "link_inertia", "delay")
# A prior too wide to matter: what comes back is the data's.
WIDE = ElasticOptions(prior_decades=1e6)
VARIANTS = {
    "logarithmic, inflated": WIDE,
    "logarithmic, optimal": replace(WIDE, weights=Weights("optimal")),
    "logarithmic, user": replace(WIDE, weights=Weights("user", off_diagonal=0.5, low_cut_hz=2.0)),
    "plain, inflated": replace(WIDE, estimator="nls"),
    "plain, user": replace(WIDE, estimator="nls", weights=Weights("user")),
}


def truth_of(robot, delay_s):
    return {
        **{f"{spring.name}.stiffness": spring.stiffness for spring in robot.springs},
        **{f"{spring.name}.damping": spring.damping for spring in robot.springs},
        **{f"{joint.name}.viscous": joint.motor.friction.viscous_nms_rad for joint in robot.joints},
        **{f"{joint.name}.motor_inertia": joint.motor.inertia_kgm2 for joint in robot.joints},
        "delay": delay_s,
    }


def check_recovered(solution, truth, scale=None):
    assert solution.estimate.status == "converged"
    for name, estimate in zip(solution.estimate.names, solution.estimate.value, strict=True):
        if name in truth:
            size = abs(truth[name]) or (scale or {}).get(name, 1.0)
            assert abs(estimate - truth[name]) <= RECOVERY * size, name


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_masses_without_noise(variant):
    robot = two_mass_robot(viscous=0.01)
    outputs = ("drive", "drive.arm")
    frf = exact_frf(robot, [[0.0]], BENCH_HZ, sampling_period_s=4e-4, delay_s=5e-4, output_names=outputs,
                    declared_noise=1e-6)  # fmt: skip
    wrong = two_mass_robot(viscous=0.0, motor_inertia=5.5e-3, load_inertia=4.0e-3, rotor_std=1e6)
    nominal = with_spring_factors(wrong, 0.7, 3.0)
    solution = fit_elastic(nominal, frf, replace(VARIANTS[variant], free=EVERYTHING), 4e-4)
    check_recovered(solution, truth_of(robot, 5e-4) | {"drive.link_inertia": 4.752e-3})


@pytest.mark.parametrize("variant", VARIANTS)
def test_two_joints_without_noise(variant):
    nominal = two_joint_robot()
    robot = with_spring_factors(nominal, [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    frf = exact_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3, declared_noise=1e-6)
    solution = fit_elastic(nominal, frf, VARIANTS[variant], 1.2e-3)
    scale = {f"{joint.name}.viscous": 2 * np.pi * joint.motor.inertia_kgm2 for joint in nominal.joints}
    check_recovered(solution, truth_of(robot, 1e-3), scale)
    assert solution.costs.dropped == 0
    np.testing.assert_allclose(solution.responses.modelled, frf.response, rtol=1e-3)


def test_statics_follow_the_fitted_springs():
    # Springs three times softer sag three times as far, which a fit with the nominal sag cannot explain.
    nominal = with_spring_factors(two_joint_robot(), 3.0)
    robot = two_joint_robot()
    frf = exact_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3, declared_noise=1e-6)
    cost = [fit_elastic(nominal, frf, ElasticOptions(statics_updates=count), 1e-3).costs.total for count in (0, 3)]
    assert cost[1] < 1e-2 * cost[0]
    springs = {name: value for name, value in truth_of(robot, 1e-3).items() if name.endswith("stiffness")}
    check_recovered(fit_elastic(nominal, frf, replace(WIDE, statics_updates=3), 1e-3), springs)


def test_with_noise_within_the_predicted_deviations():
    nominal = two_joint_robot()
    robot = with_spring_factors(nominal, [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    frf = exact_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3, relative_noise=0.005, seed=4)
    solution = fit_elastic(nominal, frf, ElasticOptions(weights=Weights("optimal")), 1e-3)
    truth = truth_of(robot, 1e-3)
    deviation = np.sqrt(np.diag(solution.internal.covariance))
    for name, estimate, nominal_value, kind, sigma in zip(
        solution.estimate.names,
        solution.estimate.value,
        solution.estimate.nominal,
        solution.estimate.kinds,
        deviation,
        strict=True,
    ):
        if kind in ("stiffness", "damping"):
            internal = np.log(estimate / nominal_value) - np.log(truth[name] / nominal_value)
            assert abs(internal) <= RECOVERY_SIGMA * sigma, name


@pytest.mark.parametrize(
    "options",
    [
        ElasticOptions(weights=Weights("optimal")),
        pytest.param(ElasticOptions(weights=Weights("user")), marks=pytest.mark.slow),
        pytest.param(ElasticOptions(estimator="nls", weights=Weights("optimal")), marks=pytest.mark.slow),
    ],
    ids=["logarithmic, optimal", "logarithmic, user", "plain, optimal"],
)
def test_sandwich_against_monte_carlo(options):
    robot, runs = certain(two_mass_robot(damping=0.5, viscous=0.01)), 150
    options = replace(options, free=("stiffness", "damping", "viscous", "motor_inertia", "delay"), statics_updates=0)
    found, claimed, covered = [], [], []
    truth = truth_of(robot, 5e-4)
    for seed in range(runs):
        frf = exact_frf(robot, [[0.0]], BENCH_HZ, sampling_period_s=4e-4, delay_s=5e-4, relative_noise=3e-3, seed=seed)
        solution = fit_elastic(robot, frf, options, 5e-4)
        found.append(solution.internal.values)
        claimed.append(solution.internal.covariance)
        values = np.array([truth[name] for name in solution.estimate.names])
        covered.append((solution.estimate.effective_lower <= values) & (values <= solution.estimate.effective_upper))
    empirical, claimed = np.cov(np.array(found).T), np.mean(claimed, axis=0)
    size = np.sqrt(np.diag(claimed))
    error = (empirical - claimed) / np.outer(size, size)
    # A sample variance deviates by sqrt(2/runs); four of these for the worst of fifteen entries.
    assert np.abs(error).max() < 4 * np.sqrt(2 / runs), error
    assert np.abs(np.mean(found, axis=0) / size).max() < 4 / np.sqrt(runs)
    assert 0.91 < np.mean(covered) < 0.985


def test_friction_scales_come_back():
    robot = two_joint_robot()
    scales = np.array([0.08, -0.05])
    solution = fit_elastic(
        with_spring_factors(robot, 0.8), friction_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, scales), ElasticOptions(), 1e-3
    )
    friction = [kind == "friction" for kind in solution.estimate.kinds]
    np.testing.assert_allclose(solution.estimate.value[friction], scales, rtol=1e-3)
    np.testing.assert_allclose(solution.responses.measured, solution.responses.modelled, rtol=1e-3)
    frf = friction_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, scales)
    blind = replace(frf, sensitivity=np.zeros((3, 0, ARM_HZ.size, 2, 2), complex),
                    coefficient_names=(), coefficient_relative_std=np.zeros(0))  # fmt: skip
    assert fit_elastic(robot, blind, ElasticOptions(), 1e-3).costs.total > 1e3 * solution.costs.total


def test_friction_that_nothing_shows_keeps_its_prior():
    robot = two_joint_robot()
    frf = friction_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, [0.0, 0.0], declared=1e-3)
    frf = replace(frf, sensitivity=1e-9 * frf.sensitivity, coefficient_relative_std=np.array([0.1, 0.3]))
    solution = fit_elastic(robot, frf, ElasticOptions(), 1e-3)
    friction = np.array([kind == "friction" for kind in solution.estimate.kinds])
    np.testing.assert_allclose(solution.estimate.value[friction], 0.0, atol=1e-6)
    np.testing.assert_allclose(solution.estimate.relative_std[friction], [0.1, 0.3], rtol=1e-3)


def test_starts_reach_one_minimum():
    nominal = two_joint_robot()
    robot = with_spring_factors(nominal, [1.3, 0.8, 1.2, 0.9])
    frf = exact_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3, relative_noise=0.005, seed=1)
    solution = fit_elastic(nominal, frf, ElasticOptions(starts=8, agreeing_starts=0, start_decades=0.5), 1e-3)
    assert (solution.starts.minimum == 0).sum() >= 7
    assert (solution.starts.evaluations > solution.starts.iterations).all()
    assert solution.starts.cap_share == 0


def test_starts_at_the_iteration_limit_are_counted():
    robot = two_joint_robot()
    frf = exact_frf(robot, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3, relative_noise=0.005, seed=1)
    hasty = ElasticOptions(starts=4, max_iterations=2, strategy="plain", statics_updates=0)
    assert fit_elastic(with_spring_factors(robot, 0.5), frf, hasty, 1e-3).starts.cap_share == 1


def test_minima_are_told_apart_by_cost():
    labels = distinct_minima(np.array([2.0, 1.0, 1.0005, 2.0001, 5.0]))
    assert labels.tolist() == [1, 0, 0, 1, 2]


def test_fixed_parameters_stay():
    robot = two_mass_robot()
    frf = exact_frf(robot, [[0.0]], BENCH_HZ, sampling_period_s=4e-4, declared_noise=1e-6)
    fixed = ElasticOptions(free=("stiffness", "damping", "motor_inertia"), fixed=("drive.motor_inertia",))
    solution = fit_elastic(with_spring_factors(robot, 0.7), frf, fixed, 0.0)
    assert solution.estimate.names == ("coupling.stiffness", "coupling.damping")
    check_recovered(solution, truth_of(robot, 0.0))


def test_parameter_without_influence_is_refused():
    robot = two_mass_robot()
    # Nothing turns about this axis.
    idle = replace(robot.springs[0], name="idle", place="bearing", axis=np.array([1.0, 0.0, 0.0]))
    frf = exact_frf(robot, [[0.0]], BENCH_HZ, sampling_period_s=4e-4, declared_noise=1e-6)
    with pytest.raises(DataError, match=r"change nothing: idle\.stiffness"):
        fit_elastic(replace(robot, springs=(*robot.springs, idle)), frf, ElasticOptions(), 0.0)


def test_response_that_is_not_the_robots_is_refused():
    robot = two_mass_robot()
    frf = exact_frf(robot, [[0.0]], BENCH_HZ)
    with pytest.raises(DataError, match="the response's inputs are wheel, the robot's motors drive"):
        fit_elastic(robot, replace(frf, input_channels=motor_channels(("wheel",), "torque")), ElasticOptions(), 0.0)
    for side, channels in (
        ("input_channels", motor_channels(frf.input_names, "position_command")),
        ("output_channels", motor_channels(frf.output_names, "angle")),
    ):
        with pytest.raises(DataError, match="An elastic model needs responses from motor torque or current to accel"):
            fit_elastic(robot, replace(frf, **{side: channels}), ElasticOptions(), 0.0)
    hole = frf.response.copy()
    hole[0, 3] = np.nan
    with pytest.raises(DataError, match="not finite at 20 Hz"):
        fit_elastic(robot, replace(frf, response=hole), ElasticOptions(), 0.0)


def test_unknown_fixed_name_and_zero_damping_are_told_at_once():
    robot = with_spring_factors(two_mass_robot(), 1.0, 0.0)
    frf = exact_frf(robot, [[0.0]], BENCH_HZ)
    with pytest.raises(SettingsError, match=r"names `gear`.*; S\d{3} `coupling\.damping`") as caught:
        fit_elastic(robot, frf, ElasticOptions(fixed=("gear",)), 0.0)
    assert caught.value.remedy
