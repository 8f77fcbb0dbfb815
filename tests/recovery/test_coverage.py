"""Intervals hold the truth as often as they say: Monte Carlo over responses of a linear robot with noise."""

from dataclasses import replace

import numpy as np
import pytest

from default_campaign import LOADED
from exact_systems import certain, exact_frf, two_joint_robot, two_mass_robot, with_spring_factors
from realizations import averaged
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights

BENCH_HZ = np.arange(11.0, 251.0, 3.0)
ARM_HZ = np.unique(np.round(np.geomspace(1, 60, 40), 1))
ARM_CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
OPTIMAL = ElasticOptions(weights=Weights("optimal"), statics_updates=1)


def two_mass_case(configurations):
    robot, motor = two_mass_robot(damping=0.5, viscous=0.01), ("stiffness", "damping", "viscous", "motor_inertia")
    exact = exact_frf(robot, np.zeros((configurations, 1)), BENCH_HZ, sampling_period_s=4e-4, delay_s=1e-3)
    return robot, robot, exact, replace(OPTIMAL, free=motor, statics_updates=0)


def two_joint_case():
    nominal = two_joint_robot()
    true = with_spring_factors(nominal, [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    return nominal, true, exact_frf(true, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3), OPTIMAL


def kr300_case():
    nominal = LOADED.robot.to_robot()
    sure = [replace(joint, motor=replace(joint.motor, inertia_relative_std=0.0)) for joint in nominal.joints]
    nominal = replace(nominal, joints=tuple(sure))
    factors = np.exp(np.random.default_rng(1).uniform(-np.log(2), np.log(2), (2, len(nominal.springs))))
    true = with_spring_factors(nominal, *factors)
    limits = np.array([[joint.lower, joint.upper] for joint in nominal.joints])
    # Of fewer configurations the deviation between them has so few degrees of freedom that intervals are wider.
    share = np.random.default_rng(2).uniform(0.2, 0.8, (8, len(limits)))
    frf = exact_frf(true, limits[:, 0] + share * np.ptp(limits, axis=1), np.geomspace(2, 80, 40), delay_s=1e-3)
    return nominal, true, frf, replace(OPTIMAL, free=("stiffness", "damping"))


def truth_by_name(robot):
    return {
        **{f"{spring.name}.stiffness": spring.stiffness for spring in robot.springs},
        **{f"{spring.name}.damping": spring.damping for spring in robot.springs},
        **{f"{joint.name}.viscous": joint.motor.friction.viscous_nms_rad for joint in robot.joints},
        **{f"{joint.name}.motor_inertia": joint.motor.inertia_kgm2 for joint in robot.joints},
        "delay": 1e-3,
    }


def hits(case, runs, noise, bootstrap=0, common=0.0):
    """Whether the intervals hold the truth (runs, n_identifiable): the sandwich's and the bootstrap's."""
    nominal, true, exact, options = case
    truth, options = truth_by_name(true), replace(options, bootstrap=bootstrap)
    held = {name: [] for name in ("sandwich", "bootstrap") if bootstrap or name == "sandwich"}
    for seed in range(runs):
        frf = averaged(exact, noise, seed=seed, common=common)
        solution = fit_elastic(certain(nominal), frf, replace(options, seed=seed), 1e-3)
        assert solution.estimate.status == "converged"
        values = np.array([truth[name] for name in solution.estimate.names])
        intervals = {"sandwich": solution.estimate, "bootstrap": solution.bootstrap}
        for name in held:
            inside = (intervals[name].lower <= values) & (values <= intervals[name].upper)
            held[name].append(inside[solution.estimate.identifiable])
    return {name: np.array(rows) for name, rows in held.items()}


@pytest.mark.parametrize("configurations", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_intervals_hold_the_truth(configurations):
    # Four realizations of one configuration leave three degrees of freedom, which the bootstrap has to know.
    held = hits(two_mass_case(configurations), 50, 3e-3, bootstrap=40)
    for name, rows in held.items():
        assert 0.90 < rows.mean() < 0.99, (name, rows.mean())


def test_errors_common_to_all_lines_are_held_by_the_bootstrap_only():
    held = hits(two_mass_case(3), 50, 3e-3, bootstrap=40, common=0.5)
    assert held["sandwich"].mean() < 0.7
    assert held["bootstrap"].mean() > 0.88


def test_springs_are_held_where_the_robot_file_has_rotor_inertias_two_percent_off():
    nominal, true, _, options = two_joint_case()
    motors = [replace(joint.motor, inertia_kgm2=factor * joint.motor.inertia_kgm2)
              for joint, factor in zip(true.joints, (1.02, 0.98), strict=True)]  # fmt: skip
    true = replace(true, joints=tuple(replace(j, motor=m) for j, m in zip(true.joints, motors, strict=True)))
    exact = exact_frf(true, ARM_CONFIGURATIONS, ARM_HZ, delay_s=1e-3)
    rows = hits((nominal, true, exact, options), 12, 0.005)["sandwich"]
    assert rows.mean() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "bootstrapped"), [(two_joint_case, 200), (kr300_case, 20)], ids=["two joints", "kr300"]
)
def test_coverage_of_200_data_sets(case, bootstrapped):
    made = case()
    rows = hits(made, 200, 0.005)["sandwich"]
    repeated = hits(made, bootstrapped, 0.005, bootstrap=200)["bootstrap"]
    print(f"\ncoverage_95 {rows.mean():.3f}, lowest {rows.mean(axis=0).min():.3f} of {rows.shape[1]} identifiable,"
          f" bootstrap {repeated.mean():.3f} ({bootstrapped} data sets)")  # fmt: skip
    assert 0.92 <= rows.mean() <= 0.98
    assert rows.mean(axis=0).min() >= 0.85
    assert repeated.mean() >= 0.9
