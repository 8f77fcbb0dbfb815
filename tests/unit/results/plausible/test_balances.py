"""Counterbalances in mean torques: named where they explain more than all else, never in place of another cause."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.results.plausible.evidence import Carrier, Fitted
from robid.results.plausible.findings import data_findings
from robid.robot.description import HarmonicBalance
from robid.robot.friction import Friction
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2], [-1.2, -1.5], [0.8, -1.4], [-0.1, 1.8]])
FRICTION = Friction(1e-4, 0.03, 0.03, 1.0, 0.02)


def arm():
    robot = two_joint_robot()
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=FRICTION)) for joint in robot.joints)
    return replace(robot, joints=joints)


def changed(robot, index, **changes):
    joints = (*robot.joints[:index], replace(robot.joints[index], **changes), *robot.joints[index + 1 :])
    return replace(robot, joints=joints)


def with_balance(robot, index, waves):
    return changed(robot, index, counterbalance=HarmonicBalance(*(np.array([wave]) for wave in waves)))


def heavier_link(robot, index, factor):
    link = robot.joints[index].link
    # The split link of the elbow must leave something of the inertia.
    return changed(robot, index, link=replace(link, mass_kg=factor * link.mass_kg, inertia_kgm2=3 * link.inertia_kgm2))


def heavier_payload(robot, kg):
    return replace(robot, payload=replace(robot.payload, mass_kg=robot.payload.mass_kg + kg))


def held(robot, places=PLACES, scale=1.0):
    """The stated arm's response with the mean torques of another one; motors swing far beyond their presliding."""
    frf = exact_frf(arm(), places, np.geomspace(1, 40, 20))
    torque = solve_statics(build_model(robot, balanced=True), places).motor_torque * scale
    angle = places @ robot.motor_per_arm.T
    return replace(frf, mean_input=torque, mean_output=angle, motion_rms=np.full_like(angle, 0.3))


def named(frf, fitted=None):
    return [finding.cause for finding in data_findings(arm(), frf, 0.0, fitted)]


def found(waves, deviation_nm):
    """A shoulder's counterbalance as a fit found it."""

    def carrier(*waves):
        return Carrier(with_balance(arm(), 0, waves), np.ones(2))

    off = [carrier(*(np.array(waves) + deviation_nm * each)) for each in np.eye(2)]
    return Fitted(carrier(*waves), tuple(off), 1.0)


@pytest.mark.parametrize(("index", "joint"), [(0, "shoulder"), (1, "elbow")])
@pytest.mark.parametrize("waves", [(60.0, -150.0), (100.0, 0.0), (0.0, 90.0), (-80.0, 0.0)])
def test_a_counterbalance_that_the_file_lacks_is_named_alone(index, joint, waves):
    (finding,) = data_findings(arm(), held(with_balance(arm(), index, waves)))
    assert (finding.cause, finding.decisive) == ("counterbalance", False)
    assert f"N m at {joint} (" in finding.message
    assert f"try `free: [{joint}.counterbalance]` in an elastic fit" in finding.message
    told = [float(finding.message.partition(before)[2].split()[0]) for before in (f"{joint} (", "sine and ")]
    assert told == pytest.approx(waves, abs=6.0)  # it bends gears that the file's arm does not


OTHERS = {
    "payload": (heavier_payload(arm(), 2.0), 1.0),
    "light payload": (heavier_payload(arm(), -2.0), 1.0),
    "torque constant of the shoulder": (arm(), np.array([1.2, 1.0])),
    "torque constant of the elbow": (arm(), np.array([1.0, 0.7])),
    "both torque constants": (arm(), np.array([0.8, 1.3])),
    "light shoulder": (heavier_link(arm(), 0, 0.7), 1.0),
    "heavy shoulder": (heavier_link(arm(), 0, 1.3), 1.0),
    "light elbow": (heavier_link(arm(), 1, 0.8), 1.0),
    "payload and torque constant": (heavier_payload(arm(), 2.0), np.array([1.2, 1.0])),
}


@pytest.mark.parametrize("other", OTHERS)
def test_no_counterbalance_is_named_where_the_cause_is_another_one(other):
    robot, scale = OTHERS[other]
    causes = named(held(robot, scale=scale))
    assert causes
    assert "counterbalance" not in causes


def test_a_counterbalance_does_not_hide_a_payload():
    causes = named(held(heavier_payload(with_balance(arm(), 0, (60.0, -150.0)), 2.0)))
    assert sorted(causes) == ["counterbalance", "payload"]


def test_three_angles_of_a_joint_show_no_counterbalance():
    places = np.column_stack([np.tile([0.3, -0.5, 1.1], 3), np.linspace(-2, 2, 9)])
    assert "counterbalance" not in named(held(with_balance(arm(), 0, (60.0, -150.0)), places))
    places[:3, 0] += 0.4
    assert named(held(with_balance(arm(), 0, (60.0, -150.0)), places)) == ["counterbalance"]


def test_a_counterbalance_that_a_fit_found_carries_its_part_as_far_as_it_is_known():
    frf = held(with_balance(arm(), 0, (60.0, -150.0)))
    assert named(frf, found((60.0, -150.0), 5.0)) == []
    far = (30.0, -90.0)
    assert named(frf, found(far, 5.0)) != []
    assert named(frf, found(far, 50.0)) == []
    # What another motor carries is held against it all the same.
    heavy = held(heavier_payload(with_balance(arm(), 0, (60.0, -150.0)), 2.0))
    assert named(heavy, found(far, 50.0)) == ["payload"]


def test_a_torque_constant_that_a_fit_found_scales_what_was_recorded():
    frf = held(arm(), scale=np.array([1.2, 1.0]))
    nothing = Fitted(Carrier(arm(), np.ones(2)), (), 1.0)
    assert named(frf) == named(frf, nothing) == ["torque_constant"]
    assert named(frf, Fitted(Carrier(arm(), np.array([1.2, 1.0])), (), 1.0)) == []
    off = Carrier(arm(), np.array([1.05, 1.0]))
    assert named(frf, Fitted(Carrier(arm(), np.ones(2)), (off,), 1.0)) == []  # 20 % are four deviations
