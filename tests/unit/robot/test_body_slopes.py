"""Slopes of the linearised matrices along masses, in closed form, against robots that are built and settled anew."""

from dataclasses import fields, replace

import numpy as np
import pytest

from exact_systems import arm_on_rail, sensed_everywhere, stocky, two_joint_robot
from robid.robot.bodies import bodies_of, differ_in_bodies
from robid.robot.body_slopes import body_change, slopes_along_bodies
from robid.robot.derivatives import expand
from robid.robot.description import Inertial
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.rest import MatrixSlopes

ROBOTS = {
    "two_joints": (stocky(two_joint_robot()), [[0.3, -0.7], [-0.5, 0.9]]),
    "on_link": (stocky(two_joint_robot("on_link")), [[0.3, -0.7], [-0.5, 0.9]]),
    "springs_and_sensors": (stocky(sensed_everywhere()), [[0.3, -0.7], [-0.5, 0.9]]),
    "rail": (stocky(arm_on_rail()), [[0.5, 0.3, -0.7]]),
}
SHIFT_M = np.array([0.02, -0.03, 0.01])


def heavier(body, share):
    return Inertial(body.mass_kg * (1 + share), body.com_m, body.inertia_kgm2 * (1 + share))


def shifted(body, share):
    return replace(body, com_m=body.com_m + share * SHIFT_M)


def more_inert(body, share):
    return replace(body, inertia_kgm2=body.inertia_kgm2 * (1 + share))


def with_link(robot, index, change, share):
    """The robot with another link, what its splits carry as before."""
    joints = [replace(j, link=change(j.link, share)) if i == index else j for i, j in enumerate(robot.joints)]
    return replace(robot, joints=tuple(joints))


def with_outboards(robot, change, share):
    """The robot with other parts beyond its splits, of the same links."""
    springs = (s if s.outboard is None else replace(s, outboard=change(s.outboard, share)) for s in robot.springs)
    return replace(robot, springs=tuple(springs))


def with_payload(robot, change, share):
    return replace(robot, payload=change(robot.payload, share))


def with_base(robot, change, share):
    return robot if robot.base is None else replace(robot, base=change(robot.base, share))


def moves(robot):
    """Robots off by a share, of all their bodies and of all that may be off of these."""
    for change in (heavier, shifted, more_inert):
        for index in range(len(robot.joints)):
            yield lambda share, i=index, c=change: with_link(robot, i, c, share)
        for each in (with_outboards, with_payload, with_base):
            yield lambda share, e=each, c=change: e(robot, c, share)


def settled(robot, places):
    model = build_model(robot)
    rest = solve_statics(model, places)
    return model, rest, linearize(model, rest, robot.output_names)


def matrices(robot, places, known, own):
    """Matrices of a robot at rest; links' own inertia of those that are known is that of the file."""
    _, _, linear = settled(robot, places)
    axial = np.where(known, own, linear.axial)
    whole = linear.mass + np.einsum("l,clij->cij", axial, linear.link_inertia)
    return {"mass": whole, **{name: getattr(linear, name) for name in ("gravity_stiffness", "output", "tilt")}}


@pytest.mark.parametrize("first_known", [False, True])
@pytest.mark.parametrize("name", list(ROBOTS))
def test_slopes_are_those_of_robots_that_settle_anew(name, first_known):
    robot, places = ROBOTS[name][0], np.array(ROBOTS[name][1])
    model, rest, linear = settled(robot, places)
    stiffness = np.array([spring.stiffness for spring in robot.springs])
    known = np.arange(len(robot.joints)) == (0 if first_known else -1)
    every = list(moves(robot))
    changes = [body_change(move(-0.1), move(0.1), 0.2) for move in every]
    full = expand(model, rest, linear, robot.output_names)
    found = slopes_along_bodies(model, rest, full, stiffness, changes, known)
    for row, move in enumerate(every):

        def central(step, move=move):
            behind, ahead = (matrices(move(by), places, known, linear.axial) for by in (-step, step))
            return {key: (ahead[key] - behind[key]) / (2 * step) for key in ahead}

        # Richardson: the error of central differences falls with the square of the step.
        coarse, fine = central(2e-2), central(1e-2)
        for field in fields(MatrixSlopes):
            true = (4 * fine[field.name] - coarse[field.name]) / 3
            slope = getattr(found, field.name)[:, row]
            size = max(
                float(np.abs(true).max()), 1e-6 * float(np.abs(getattr(linear, field.name)).max(initial=0)), 1e-9
            )
            np.testing.assert_allclose(slope, true, rtol=0, atol=1e-5 * size)


def test_bodies_have_the_mass_of_links_payload_and_base():
    robot = sensed_everywhere()
    total = sum(joint.link.mass_kg for joint in robot.joints) + robot.payload.mass_kg + robot.base.mass_kg
    assert sum(body.inertial.mass_kg for body in bodies_of(robot).values()) == pytest.approx(total)


def test_robots_that_differ_in_more_than_bodies_are_found():
    robot = sensed_everywhere()
    joint = robot.joints[0]
    longer = replace(robot, joints=(replace(joint, position_m=joint.position_m + 0.1), *robot.joints[1:]))
    stiffer = replace(robot, springs=(replace(robot.springs[0], stiffness=1.0), *robot.springs[1:]))
    assert differ_in_bodies(robot, *(move(0.1) for move in moves(robot)))
    assert not differ_in_bodies(robot, longer)
    assert not differ_in_bodies(robot, stiffer)
    assert not differ_in_bodies(robot, replace(robot, springs=robot.springs[1:]))
