"""Springs in line with a gear: which they are, and that robot and gear of both in series respond alike."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, linear_axis, two_joint_robot
from robid.robot.description import Inertial, Spring
from robid.robot.in_line import gears_in_line, with_chains

X, Y, Z = np.eye(3)
FREQUENCY_HZ = np.geomspace(1.0, 25.0, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])


def part(body, share):
    return Inertial(share * body.mass_kg, body.com_m, share * body.inertia_kgm2)


def hinge(robot, joint, axis=Z, point=(0.0, 0.0, 0.0), share=0.95, place="split", stiffness=2e4):
    outboard = part(robot.joints[joint].link, share) if place == "split" else None
    return Spring("hinge", joint, place, axis, stiffness, 1e-3 * stiffness, 0.0, np.array(point), outboard)


ELBOW = (0.7, 0.0, 0.25)  # where the second joint's axis crosses the first link's frame


@pytest.mark.parametrize(
    ("wanted", "given"),
    [
        (("gear_1",), {"joint": 0}),
        (("gear_1",), {"joint": 0, "axis": -Z}),
        (("gear_1",), {"joint": 0, "point": (0.0, 0.0, 0.3)}),
        ((), {"joint": 0, "point": (0.1, 0.0, 0.0)}),  # parallel, beside the line
        (("gear_2",), {"joint": 0, "point": ELBOW}),  # a link that twists along the next joint's axis
        ((), {"joint": 0, "axis": X}),
        (("gear_2",), {"joint": 1}),
        (("gear_1",), {"joint": 0, "place": "bearing"}),
        ((), {"joint": 1, "place": "bearing", "axis": X}),
        (("gear_1",), {"joint": 0, "place": "base", "axis": Y, "point": (0.0, 0.5, 0.4)}),
        ((), {"joint": 0, "place": "base", "axis": Y, "point": (0.0, 0.5, 0.0)}),  # beneath the first joint
        ((), {"joint": 1, "place": "payload"}),
    ],
)
def test_what_turns_about_a_gear_s_own_line_is_in_line_with_it(wanted, given):
    robot = two_joint_robot()
    assert gears_in_line(robot, hinge(robot, **given)) == wanted


def test_nothing_is_in_line_with_a_screw():
    robot = linear_axis()
    assert gears_in_line(robot, Spring("hinge", 0, "bearing", Z, 1e5, 1e2)) == ()


def test_a_gear_and_a_hinge_with_next_to_nothing_between_respond_as_one_spring():
    robot = two_joint_robot()
    known = robot.springs
    true = replace(robot, springs=(*known, hinge(robot, 0, share=1 - 1e-5)))
    chained = replace(robot, springs=with_chains(true, known))
    whole, one = (exact_frf(each, PLACES, FREQUENCY_HZ).response for each in (true, chained))
    plain = exact_frf(robot, PLACES, FREQUENCY_HZ).response
    # Dampers in series act as one where they are weak: to first order in their loss.
    assert np.abs(one / whole - 1).max() < 0.01 < 0.1 < np.abs(plain / whole - 1).max()
    gear = chained.springs[0]
    assert gear.stiffness == pytest.approx(1e4)  # two of 2e4 N m/rad
    assert gear.damping == pytest.approx(0.25 * (30 + 20))


def test_a_hinge_that_is_known_belongs_to_no_gear():
    robot = two_joint_robot()
    true = replace(robot, springs=(*robot.springs, hinge(robot, 0)))
    named_otherwise = replace(hinge(robot, 0), name="link_shoulder_z")
    found = with_chains(true, (*robot.springs, named_otherwise))
    assert [spring.stiffness for spring in found] == [spring.stiffness for spring in robot.springs]
    assert with_chains(true, true.springs) == true.springs


def test_a_stiffening_gear_stiffens_the_chain_by_its_share_of_the_deflection():
    robot = two_joint_robot()
    gear = replace(robot.springs[0], cubic=3e7)
    bent = replace(robot, springs=(gear, *robot.springs[1:]))
    chain = with_chains(replace(bent, springs=(*bent.springs, hinge(robot, 0))), bent.springs)[0]
    # The chain's deflection by a torque, and its law, must agree to third order.
    own = np.array([1e-3, 2e-3])
    torque = gear.stiffness * own + gear.cubic * own**3
    whole = own + torque / 2e4
    left = torque - chain.stiffness * whole - chain.cubic * whole**3
    assert left[1] / left[0] == pytest.approx(2**5, rel=0.1)
