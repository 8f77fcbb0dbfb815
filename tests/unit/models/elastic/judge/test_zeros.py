"""A joint whose zero is off is named with the amount in the setting's own sign, and gone where that is followed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf, linear_axis, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.robot.kinematics import ToolArm
from robid.robot.zeros import with_zeros
from robid.settings.load import load_robot

KR300 = Path(__file__).parents[5] / "configs" / "robots" / "kr300.yaml"
FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3


def measured(zeros_deg):
    robot = with_zeros(two_joint_robot(), zeros_deg)
    return exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.001, seed=5)


def explained(frf, options=OPTIONS):
    robot = two_joint_robot()
    solution = fit_elastic(robot, frf, options, DELAY_S)
    return solution, explain(fitted_model(robot, solution, frf, options, DELAY_S))


@pytest.mark.parametrize(("joint", "degrees"), [("elbow", 1.0), ("elbow", -0.4), ("shoulder", 3.0)])
def test_a_zero_that_is_off_is_named_with_its_amount_and_gone_where_it_is_freed(joint, degrees):
    frf = measured({joint: degrees})
    before, found = explained(frf)
    assert (found[0].cause, found[0].free) == ("zero", (f"{joint}.zero",))
    assert found[0].amounts[0] == pytest.approx(degrees, rel=0.1)
    assert f"changed by {'+' if degrees > 0 else '-'}" in found[0].correct[0]
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(two_joint_robot(), frf, options, DELAY_S)
    assert after.costs.total < 1.2 * after.costs.expected.sum() < 0.5 * before.costs.total
    assert after.estimate.found[f"{joint}.zero"] == pytest.approx(degrees, rel=0.1)
    truth = np.array([spring.stiffness for spring in two_joint_robot().springs])
    off = [np.abs(each.estimate.value[:4] / truth - 1).max() for each in (before, after)]
    assert off[1] < 0.01 < off[0]


def test_what_is_told_to_correct_is_what_the_fit_has_wrong():
    frf = measured({"shoulder": 3.0})
    solution, found = explained(frf)
    told = float(found[0].correct[0].partition("changed by ")[2].split()[0])
    assert told == pytest.approx(3.0, rel=0.1)
    corrected = with_zeros(two_joint_robot(), {"shoulder": told})
    after = fit_elastic(corrected, frf, OPTIONS, DELAY_S)
    assert after.costs.total < 0.1 * solution.costs.total
    grade = assess_fit(two_joint_robot(), solution, frf, OPTIONS, DELAY_S)
    assert grade.causes[0] == "zero"


def test_a_larger_offset_of_the_robot_file_is_a_zero_of_that_sign():
    file = load_robot(KR300)
    joint = file.joints[2]
    more = joint.model_copy(update={"dh": joint.dh.model_copy(update={"offset_deg": joint.dh.offset_deg + 2.0})})
    turned = file.model_copy(update={"joints": (*file.joints[:2], more, *file.joints[3:])}).to_robot()
    wanted = with_zeros(file.to_robot(), {"axis_3": 2.0})
    for one, other in zip(turned.joints, wanted.joints, strict=True):
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-12)
        np.testing.assert_allclose(one.link.com_m, other.link.com_m, atol=1e-12)


def test_an_arm_with_a_zero_stands_where_one_without_stands_further():
    robot, q = two_joint_robot(), np.array([0.3, -0.7])
    further = q + np.deg2rad([0.0, 2.0])
    off, right = (
        ToolArm(each, 0, np.array([0.5, 0.1, 0.2]), np.eye(3)) for each in (with_zeros(robot, {"elbow": 2.0}), robot)
    )
    for one, other in zip(off.poses(q), right.poses(further), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    # The bearing stays with what carries the joint.
    turned = with_zeros(robot, {"shoulder": 2.0})
    bearing = next(spring for spring in turned.springs if spring.place == "bearing")
    own = next(spring for spring in robot.springs if spring.place == "bearing")
    fixed, moved = robot.joints[0].rotation @ own.axis, turned.joints[0].rotation @ bearing.axis
    np.testing.assert_allclose(moved, fixed, atol=1e-12)


def test_what_slides_has_no_zero_that_is_off():
    assert not [each for each in list_nuisances(linear_axis(), OPTIONS) if each.cause == "zero"]
    one, other = (each.joints[0].rotation for each in (with_zeros(linear_axis(), {"rail": 3.0}), linear_axis()))
    np.testing.assert_array_equal(one, other)
