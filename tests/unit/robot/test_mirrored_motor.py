"""A negative gear ratio is a motor that turns the other way: all is the same with its angle and torque mirrored."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from exact_systems import sensed_everywhere, springs_everywhere, two_joint_robot
from robid.design.configurations.candidates import visit_cost_s
from robid.robot.export import to_mjcf
from robid.robot.friction import Friction
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from tolerances import IDENTITY

CONFIGURATIONS = np.array([[0.3, -0.8], [-0.5, 1.1]])
LINES_HZ = np.geomspace(2, 80, 30)
SIGNS = np.array([-1.0, 1.0])


def mirrored(robot):
    """The robot whose first motor turns the other way."""
    first, *others = robot.joints
    motor = replace(first.motor, gear_ratio=-first.motor.gear_ratio)
    turned = [
        replace(joint, couplings={name: -turn for name, turn in joint.couplings.items() if name == first.name})
        for joint in others
    ]
    return replace(robot, joints=(replace(first, motor=motor), *turned))


@pytest.mark.parametrize("make", [two_joint_robot, springs_everywhere])
def test_statics_mirror_the_motor(make):
    model, other = build_model(make()), build_model(mirrored(make()))
    rest, turned = solve_statics(model, CONFIGURATIONS), solve_statics(other, CONFIGURATIONS)
    np.testing.assert_allclose(turned.motor_torque, SIGNS * rest.motor_torque, rtol=IDENTITY)
    np.testing.assert_allclose(turned.position[:, other.motor], SIGNS * rest.position[:, model.motor], rtol=IDENTITY)
    np.testing.assert_allclose(turned.deflection, rest.deflection, rtol=1e3 * IDENTITY, atol=IDENTITY)


@pytest.mark.parametrize("make", [two_joint_robot, springs_everywhere, sensed_everywhere])
@pytest.mark.parametrize("period_s", [None, 1e-3])
def test_the_response_changes_its_sign_between_mirrored_and_other_channels(make, period_s):
    def whole(robot):
        model = build_model(robot)
        linear = linearize(model, solve_statics(model, CONFIGURATIONS), robot.output_names)
        return response(linear, nominal_parameters(robot, linear, 1e-3), LINES_HZ, period_s).sampled

    found, turned = whole(make()), whole(mirrored(make()))
    outputs = np.concatenate([SIGNS, np.ones(found.shape[2] - 2)])
    np.testing.assert_allclose(turned, outputs[:, None] * SIGNS * found, rtol=1e-6, atol=1e-9 * np.abs(found).max())


def simulated(robot):
    friction = Friction(0.002, 0.3, 0.4, 1.0, 0.02)
    joints = [replace(one, motor=replace(one.motor, friction=friction, ripple_nm=0.05)) for one in robot.joints]
    lines = np.array([5, 11, 23])
    phases = np.random.default_rng(1).uniform(0, 2 * np.pi, (1, 2, lines.size))
    reference = time_signal(multisine(np.full((2, lines.size), 3.0), phases), lines, 500)
    signs = np.sign([joint.motor.gear_ratio for joint in joints])
    options = SimulateOptions(
        imperfections=Imperfections(friction="lugre", ripple=True, hysteresis_nm=5.0), steps_per_sample=2
    )
    experiment = SimulatedExperiment(
        robot=replace(robot, joints=tuple(joints)),
        controller=Controller(),
        options=options,
        reference=reference * signs,
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        periods=1,
        outputs=("shoulder.arm", "elbow.arm"),
    )
    return simulate(experiment, CONFIGURATIONS[0], 0)


def test_a_simulation_with_friction_and_ripple_is_mirrored():
    record, turned = simulated(two_joint_robot()), simulated(mirrored(two_joint_robot()))
    np.testing.assert_allclose(turned.inputs, SIGNS * record.inputs, atol=1e-6 * np.abs(record.inputs).max())
    signs = np.concatenate([SIGNS, [1, 1]])
    np.testing.assert_allclose(turned.outputs, signs * record.outputs, atol=1e-6 * np.abs(record.outputs).max())


def test_an_exported_model_turns_its_motor_the_other_way():
    robot = mirrored(two_joint_robot())
    model = build_model(robot)
    root = ElementTree.fromstring(to_mjcf(model, solve_statics(model, CONFIGURATIONS[:1]), ("rest",), ""))
    (tendon,) = [one for one in root.iter("fixed") if one.get("name") == "gear_1"]
    turns = {joint.get("joint"): float(joint.get("coef")) for joint in tendon.findall("joint")}
    assert turns == pytest.approx({"q_m_shoulder": -1 / 120, "q_a_shoulder": -1.0}, rel=IDENTITY)


def test_the_time_of_travel_does_not_depend_on_the_sign():
    cost = [visit_cost_s(robot, CONFIGURATIONS, 3.0, 0.5) for robot in (two_joint_robot(), mirrored(two_joint_robot()))]
    np.testing.assert_array_equal(*cost)
    # 1.9 rad of the elbow at half of 4 rad/s; 0.8 rad of the shoulder at half of 3.3 rad/s.
    np.testing.assert_allclose(cost[0], [3.0, 3.0 + 1.9 / 2.0])
