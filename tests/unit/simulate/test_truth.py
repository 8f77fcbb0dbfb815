"""The true robot: seeded, within its bounds, and different only where it says so."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import springs_everywhere, two_joint_robot, with_arm_friction
from robid.models.elastic.fitting import true_values
from robid.robot.balances import balance_torque
from robid.robot.description import Spring
from robid.robot.friction import Friction
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot, recorded_torque_factor, true_robot, with_imperfections

FRICTION = Friction(0.01, 0.5, 0.6, 2.0, 0.05, 0.1)


@pytest.fixture
def robot():
    plain = two_joint_robot()
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=FRICTION)) for joint in plain.joints)
    return replace(plain, joints=joints)


def values(robot):
    springs = [(spring.stiffness, spring.damping) for spring in robot.springs]
    laws = [joint.motor.friction for joint in robot.joints]
    friction = [
        (law.viscous_nms_rad, law.coulomb_nm, law.static_nm, law.stribeck_rad_s, law.presliding_rad) for law in laws
    ]
    return np.array(springs), np.array(friction)


def test_same_seed_same_robot_other_seed_other_robot(robot):
    truth = Truth(spring_factor=2.0, friction_relative=0.15, seed=3)
    for one, other in zip(values(true_robot(robot, truth)), values(true_robot(robot, truth)), strict=True):
        np.testing.assert_array_equal(one, other)
    for one, other in zip(
        values(true_robot(robot, truth)), values(true_robot(robot, replace(truth, seed=4))), strict=True
    ):
        assert (one != other).any()


def test_deviations_fill_their_bounds_and_stay_within(robot):
    nominal = values(robot)
    springs, friction = [], []
    for seed in range(300):
        found = values(true_robot(robot, Truth(spring_factor=2.0, friction_relative=0.15, seed=seed)))
        springs.append(found[0] / nominal[0])
        friction.append(found[1] / nominal[1])
    springs, friction = np.log2(springs), np.array(friction) - 1
    assert np.abs(springs).max() <= 1
    assert np.abs(friction).max() <= 0.15 + 1e-12
    assert (np.abs(springs).max(axis=0) > 0.95).all()
    assert (np.abs(friction).max(axis=0) > 0.14).all()
    # Log-uniform: the mean of the logarithm is zero, its deviation 1/sqrt(3).
    np.testing.assert_allclose(springs.mean(axis=0), 0.0, atol=4 / np.sqrt(3 * 300))
    np.testing.assert_allclose(springs.std(axis=0), 1 / np.sqrt(3), rtol=0.15)


def test_friction_of_arms_deviates_as_that_of_their_motors(robot):
    rubbing = with_arm_friction(robot, 40.0, 9.0)
    found = true_robot(rubbing, Truth(friction_relative=0.15, seed=3))
    factor = [joint.motor.friction.viscous_nms_rad / FRICTION.viscous_nms_rad for joint in found.joints]
    assert factor[0] != 1
    np.testing.assert_allclose(found.arm_viscous, np.array([40.0, 9.0]) * factor)


def test_no_deviation_is_the_file_and_all_else_stays(robot):
    for one, other in zip(values(true_robot(robot, Truth())), values(robot), strict=True):
        np.testing.assert_array_equal(one, other)
    true = true_robot(robot, Truth(spring_factor=2.0, friction_relative=0.15))
    np.testing.assert_array_equal(true.motor_inertia_kgm2, robot.motor_inertia_kgm2)
    assert true.payload is robot.payload
    assert [joint.motor.friction.relative_std for joint in true.joints] == [0.1, 0.1]


def test_imperfections_of_the_description(robot):
    flawed = with_imperfections(robot, Imperfections(stiffening_1_rad2=50.0, unmodelled_payload_kg=2.0))
    for spring, before in zip(flawed.springs, robot.springs, strict=True):
        share = 50.0 if spring.place == "transmission" else 0.0
        assert spring.cubic == share * before.stiffness
    assert flawed.payload.mass_kg == pytest.approx(robot.payload.mass_kg + 2.0)
    np.testing.assert_allclose(flawed.payload.inertia_kgm2, 1.5 * robot.payload.inertia_kgm2)
    assert with_imperfections(robot, Imperfections()).payload is robot.payload


def test_stated_inertias_and_masses_are_factors_and_nothing_else_moves():
    robot = springs_everywhere()
    factors = {"elbow": 1.2, "payload": 0.5, "base": 3.0}
    true = true_robot(robot, Truth(rotor_inertia_factor={"shoulder": 1.02}, mass_factor=factors))
    np.testing.assert_allclose(true.motor_inertia_kgm2, robot.motor_inertia_kgm2 * [1.02, 1.0])
    split = next(spring for spring in true.springs if spring.outboard is not None)
    before = next(spring for spring in robot.springs if spring.outboard is not None)
    pairs = [(true.joints[0].link, robot.joints[0].link, 1.0), (true.joints[1].link, robot.joints[1].link, 1.2)]
    pairs += [(split.outboard, before.outboard, 1.2), (true.payload, robot.payload, 0.5), (true.base, robot.base, 3.0)]
    for body, nominal, factor in pairs:
        assert body.mass_kg == pytest.approx(factor * nominal.mass_kg)
        np.testing.assert_allclose(body.inertia_kgm2, factor * nominal.inertia_kgm2)
        np.testing.assert_array_equal(body.com_m, nominal.com_m)
    for one, other in zip(values(true), values(robot), strict=True):
        np.testing.assert_array_equal(one, other)


def test_springs_that_the_file_lacks_are_the_truths_own(robot):
    tilt = Spring("tilt", 0, "base", np.array([1.0, 0.0, 0.0]), 1e5, 50.0)
    truth = Truth(spring_factor=2.0, seed=3)
    with_tilt, without = true_robot(robot, truth, (tilt,)), true_robot(robot, truth)
    assert with_tilt.springs[-1] == tilt
    for one, other in zip(with_tilt.springs[:-1], without.springs, strict=True):
        assert one.stiffness == other.stiffness
        assert one.damping == other.damping


def test_recorded_torques_have_the_wrong_constant_and_sign(robot):
    truth = Truth(torque_constant_factor={"shoulder": 1.25}, reversed_torque=("elbow",))
    np.testing.assert_allclose(recorded_torque_factor(robot, truth), [1 / 1.25, -1.0])
    assert true_robot(robot, truth).joints[0].motor == robot.joints[0].motor


def test_masses_and_inertias_deviate_each_on_its_own_within_their_bounds():
    robot = springs_everywhere()
    plain = [true_robot(robot, Truth(spring_factor=2.0, seed=seed)) for seed in range(60)]
    drawn = [true_robot(robot, Truth(spring_factor=2.0, mass_relative=(0.03, 0.05), seed=seed)) for seed in range(60)]
    for one, other in zip(plain, drawn, strict=True):
        for before, after in zip(one.springs, other.springs, strict=True):
            assert (before.stiffness, before.damping) == (after.stiffness, after.damping)
    before = robot.joints[1].link
    links = [true.joints[1].link for true in drawn]
    shares = (
        np.array(
            [[link.mass_kg / before.mass_kg, link.inertia_kgm2[0, 0] / before.inertia_kgm2[0, 0]] for link in links]
        )
        - 1
    )
    assert (np.abs(shares) >= 0.03).all()
    assert (np.abs(shares) <= 0.05).all()
    assert {tuple(signs) for signs in np.sign(shares).tolist()} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    for true, link in zip(drawn, links, strict=True):
        split = next(spring.outboard for spring in true.springs if spring.outboard is not None)
        half = next(spring.outboard for spring in robot.springs if spring.outboard is not None)
        assert split.mass_kg / half.mass_kg == pytest.approx(link.mass_kg / before.mass_kg)
        assert true.payload is robot.payload


def test_a_true_inertia_is_off_beside_its_mass(robot):
    truth = Truth(mass_factor={"elbow": 1.1}, inertia_factor={"elbow": 1.2})
    link, before = true_robot(robot, truth).joints[1].link, robot.joints[1].link
    assert link.mass_kg == pytest.approx(1.1 * before.mass_kg)
    np.testing.assert_allclose(link.inertia_kgm2, 1.32 * before.inertia_kgm2)


def test_couplings_and_counterbalances_that_the_file_lacks(robot):
    truth = Truth(couplings={"elbow": {"shoulder": 3e-4}}, counterbalance_nm={"shoulder": (5.0, -7.0)})
    true = true_robot(robot, truth)
    np.testing.assert_allclose(true.arm_per_motor - robot.arm_per_motor, [[0.0, 0.0], [3e-4, 0.0]])
    twice = true_robot(true, Truth(couplings={"elbow": {"shoulder": 1e-4}}))
    assert twice.joints[1].couplings["shoulder"] == pytest.approx(4e-4)
    assert balance_torque(true.joints[0].counterbalance, 0.3, slides=False) == pytest.approx(
        5 * np.sin(0.3) - 7 * np.cos(0.3)
    )


def test_a_zero_that_is_off_turns_the_arm_further(robot):
    true = true_robot(robot, Truth(zero_deg={"elbow": -2.0}))
    turned = robot.joints[1].rotation.T @ true.joints[1].rotation
    assert np.rad2deg(np.arctan2(turned[1, 0], turned[0, 0])) == pytest.approx(-2.0)
    np.testing.assert_array_equal(true.joints[0].rotation, robot.joints[0].rotation)
    assert true_values(robot, TrueRobot(true, Truth(zero_deg={"elbow": -2.0}), Imperfections(), 0.0, 1, None))[
        "elbow.zero"
    ] == pytest.approx(-2.0)
