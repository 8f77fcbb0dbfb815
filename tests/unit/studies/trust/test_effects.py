"""What a defect does by the truth: shifts of exact responses, moved springs, and the power of a test."""

from dataclasses import replace

import numpy as np
import pytest

from elastic_loops import analytic
from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Inertial, Spring
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.robot.zeros import with_zeros
from robid.simulate.options import Controller, Imperfections, Truth
from robid.simulate.truth import TrueRobot
from robid.studies.trust.effects import exact_responses, moved, power
from robid.studies.trust.responses import Fitting

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3


def shift_of(true, truth=None, flaws=None):
    robot, frf = two_joint_robot(), exact_frf(two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=DELAY_S)
    true_robot = TrueRobot(true, truth or Truth(), flaws or Imperfections(), DELAY_S, 1, 1)
    flawed, plain = exact_responses(robot, true_robot, frf)
    return np.log(flawed / plain)


def responses(robots):
    controller = Controller()
    return np.array(
        [analytic(own, place, FREQUENCY_HZ, controller)[0] for own, place in zip(robots, PLACES, strict=True)]
    )


def test_sound_robots_have_no_shift():
    true = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    assert np.abs(shift_of(true)).max() < 1e-12


def test_late_drives_turn_the_phase():
    shift = shift_of(two_joint_robot(), Truth(late_torque_s={"elbow": 4e-4}, late_angle_s={"shoulder": 1e-3}))
    turn = -2j * np.pi * FREQUENCY_HZ
    late = [[1e-3, 1.4e-3], [0.0, 4e-4]]
    np.testing.assert_allclose(shift, np.broadcast_to(turn[:, None, None] * np.array(late), shift.shape), atol=1e-12)


def test_a_zero_that_is_off_is_that_of_the_turned_robot():
    robot = two_joint_robot()
    shift = shift_of(with_zeros(robot, {"elbow": 2.0}), Truth(zero_deg={"elbow": 2.0}))
    ratio = responses([with_zeros(robot, {"elbow": 2.0})] * 5) / responses([robot] * 5)
    np.testing.assert_allclose(np.exp(shift), ratio, rtol=1e-9)
    assert np.abs(shift).max() > 0.01


def test_gears_and_friction_are_those_of_each_configuration():
    robot = two_joint_robot()
    friction = [replace(j.motor, friction=replace(j.motor.friction, viscous_nms_rad=0.02)) for j in robot.joints]
    robot = replace(robot, joints=tuple(replace(j, motor=m) for j, m in zip(robot.joints, friction, strict=True)))
    shift = shift_of(robot, flaws=Imperfections(one_sided=0.1, viscous_drift=0.5, drift_configurations=1e9))
    bent = np.sign(solve_statics(build_model(robot), PLACES).deflection) * [1.0, 1.0, 0.0, 0.0]
    ratio = responses([with_spring_factors(robot, 1 + 0.1 * way, np.ones(4)) for way in bent]) / responses([robot] * 5)
    np.testing.assert_allclose(np.exp(shift), ratio, rtol=1e-6)
    assert len({tuple(way) for way in bent.tolist()}) > 1
    drifted = shift_of(robot, flaws=Imperfections(viscous_drift=0.5, drift_configurations=1e-3))
    assert np.abs(drifted[0]).max() < 1e-12 < 1e-3 < np.abs(drifted[1:]).max(axis=(1, 2, 3)).min()


def test_a_spring_in_line_with_little_between_is_no_defect():
    robot = two_joint_robot()
    link = robot.joints[0].link
    most = Inertial(0.999 * link.mass_kg, link.com_m, 0.999 * link.inertia_kgm2)
    hinge = Spring("hinge", 0, "split", np.array([0.0, 0.0, 1.0]), 4e4, 60.0, 0.0, np.zeros(3), most)
    shift = shift_of(replace(robot, springs=(*robot.springs, hinge)))
    across = replace(hinge, axis=np.array([0.0, 1.0, 0.0]))
    away = shift_of(replace(robot, springs=(*robot.springs, across)))
    assert np.abs(shift).max() < 0.02 * np.abs(away).max()


@pytest.fixture(scope="module")
def fit():
    robot = two_joint_robot()
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)
    return robot, frf, fit_elastic(robot, frf, OPTIONS, DELAY_S)


def of_fit(robot, late_s):
    truth = Truth(late_torque_s={"elbow": late_s})
    return Fitting((), robot, OPTIONS, DELAY_S, TrueRobot(robot, truth, Imperfections(), DELAY_S, 1, 1))


def test_a_softer_gear_moves_its_spring_by_as_much_and_is_hidden_by_it(fit):
    robot, frf, solution = fit
    softer = with_spring_factors(robot, [0.97, 1.0, 1.0, 1.0], np.ones(4))
    both = responses([softer] * 5), responses([robot] * 5)
    row = solution.estimate.names.index("gear_1.stiffness")
    half = 0.5 * np.log(solution.estimate.upper[row] / solution.estimate.lower[row])
    assert moved(of_fit(robot, 0.0), solution, frf, both) == pytest.approx(-np.log(0.97) / half, rel=0.02)
    assert power(of_fit(robot, 0.0), solution, frf, both, ()) < 0.1


def test_power_rises_with_the_defect_from_the_level_of_the_test_to_one(fit):
    robot, frf, solution = fit

    def of(late_s, named=("delay",)):
        fitting = of_fit(robot, late_s)
        return power(fitting, solution, frf, exact_responses(robot, fitting.truth, frf), named)

    assert of(0.0) == pytest.approx(0.05, abs=1e-3)
    assert of(1e-3) > 0.99
    found = [of(late_s) for late_s in np.geomspace(1e-7, 1e-3, 9)]
    assert (np.diff(found) > -1e-3).all()
    assert any(0.1 < each < 0.95 for each in found)
