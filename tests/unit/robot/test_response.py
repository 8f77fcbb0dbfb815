"""The sampled response against closed forms, its derivatives against finite differences."""

from dataclasses import fields, replace

import numpy as np
import pytest

from exact_systems import (
    sensed_everywhere,
    springs_everywhere,
    two_joint_robot,
    two_mass_robot,
    with_arm_friction,
)
from robid.robot.derivatives import jacobian
from robid.robot.description import Inertial
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import ElasticParameters, nominal_parameters, response, with_values
from tolerances import FINITE_DIFFERENCE

FREQUENCY_HZ = np.array([1.3, 5.0, 11.0, 17.0, 29.0, 47.0, 60.0, 83.0])
KINDS = tuple(field.name for field in fields(ElasticParameters) if field.name not in ("cubic", "location"))
CASES = {
    "two joints": (two_joint_robot(), np.array([[-0.3, 0.5], [0.9, 1.2]]), None),
    "rotors on the links": (two_joint_robot("on_link"), np.array([[-0.3, 0.5]]), None),
    "springs everywhere": (springs_everywhere(), np.array([[-0.3, 0.5]]), ("shoulder", "elbow", "elbow.arm")),
    "sensors": (sensed_everywhere(), np.array([[-0.3, 0.5], [0.4, 0.2]]), ("shoulder", "elbow", "tip", "felt")),
    "motor and load": (two_mass_robot(viscous=0.01), np.zeros((1, 1)), ("drive", "drive.arm")),
    "arms that rub": (with_arm_friction(springs_everywhere(), 40.0, 9.0), np.array([[-0.3, 0.5]]), ("elbow.arm",)),
}


def linear_model(robot, configurations, outputs=None):
    model = build_model(robot)
    return linearize(model, solve_statics(model, configurations), outputs)


@pytest.mark.parametrize("ratio", [1.0, 150.0])
@pytest.mark.parametrize(("viscous", "rubs"), [(0.0, 0.0), (0.02, 0.0), (0.02, 0.08)])
def test_two_masses_in_continuous_time(ratio, viscous, rubs):
    motor, load, stiffness, damping = 4e-3, 5e-3 * ratio**2, 500.0 * ratio**2, 0.05 * ratio**2
    rubs = rubs * ratio**2
    robot = with_arm_friction(two_mass_robot(motor, load, stiffness, damping, ratio, viscous), rubs)
    model = linear_model(robot, np.zeros((1, 1)), ("drive", "drive.arm"))
    found = response(model, nominal_parameters(robot, model, 0.0), FREQUENCY_HZ, None).sampled[0, :, :, 0]
    s = 2j * np.pi * FREQUENCY_HZ
    spring = stiffness + s * damping
    load_angle = spring / ratio / (s**2 * load + s * rubs + spring)  # per motor angle
    stiffness_of_motor = s**2 * motor + s * viscous + spring / ratio * (1 / ratio - load_angle)
    wanted = s**2 / stiffness_of_motor
    np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-9)
    np.testing.assert_allclose(found[:, 1], wanted * load_angle, rtol=1e-9)


@pytest.mark.parametrize("name", [spring.name for spring in springs_everywhere().springs])
def test_every_spring_and_damper_changes_the_response(name):
    robot, at = springs_everywhere(), np.array([[-0.3, 0.5]])
    model = linear_model(robot, at)
    nominal = nominal_parameters(robot, model, 0.0)
    before = response(model, nominal, FREQUENCY_HZ, None).sampled
    for field in ("stiffness", "damping"):
        springs = tuple(
            replace(spring, **{field: 1.1 * getattr(spring, field)}) if spring.name == name else spring
            for spring in robot.springs
        )
        changed = replace(robot, springs=springs)
        other = linear_model(changed, at)
        after = response(other, nominal_parameters(changed, other, 0.0), FREQUENCY_HZ, None).sampled
        assert np.abs(after / before - 1).max() > 1e-4


def test_coupled_motors_in_closed_form():
    """Two loads on one axis line each, free of gravity; the first motor turns the second arm along."""
    motor, load, stiffness, damping, ratio, turn = 1e-3, 2.0, 5e3, 8.0, 50.0, 0.004
    drive = two_mass_robot(motor, load, stiffness, damping, ratio)
    first = replace(drive.joints[0], name="first")
    # The second axis is at right angles to the first and passes through its load, which is a sphere.
    across = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    second = replace(drive.joints[0], name="second", rotation=across, couplings={"first": turn})
    springs = (replace(drive.springs[0], name="g1"), replace(drive.springs[0], name="g2", joint=1))
    robot = replace(drive, joints=(first, second), springs=springs)
    model = linear_model(robot, np.zeros((1, 2)), ("first", "second", "first.arm", "second.arm"))
    found = response(model, nominal_parameters(robot, model, 0.0), FREQUENCY_HZ, None).sampled[0]
    gears = np.array([[1 / ratio, 0.0], [turn, 1 / ratio]])
    deflection = np.hstack([gears, -np.eye(2)])
    for index, frequency in enumerate(FREQUENCY_HZ):
        s = 2j * np.pi * frequency
        inertia = np.diag([motor, motor, 2 * load, load])
        matrix = s**2 * inertia + (stiffness + s * damping) * deflection.T @ deflection
        wanted = s**2 * np.linalg.inv(matrix)[:, :2]
        np.testing.assert_allclose(found[index], wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("period_s", [None, 1e-3], ids=["continuous", "sampled"])
@pytest.mark.parametrize("kind", KINDS)
def test_jacobian_is_the_derivative(case, period_s, kind):
    robot, configurations, outputs = CASES[case]
    model = linear_model(robot, configurations, outputs)
    parameters = nominal_parameters(robot, model, 1.3e-3)
    here = response(model, parameters, FREQUENCY_HZ, period_s)
    found = jacobian(model, parameters, here, (kind,))
    values = getattr(parameters, kind)
    scale = {"viscous": robot.motor_inertia_kgm2, "arm_viscous": model.axial}.get(kind, values)
    for index in range(values.size):
        step = np.zeros(values.size)
        step[index] = 1e-4 * scale[index]

        def moved(factor, step=step):
            return response(
                model, with_values(parameters, kind, values + factor * step), FREQUENCY_HZ, period_s
            ).sampled

        # Fourth order: the truncation error must not be what is measured.
        difference = (8 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / (12 * step[index])
        error = np.abs(found[..., index] - difference).max(axis=1)
        assert (error <= FINITE_DIFFERENCE * np.abs(difference).max(axis=1)).all()


def test_kinds_come_in_the_order_asked_for():
    robot, configurations, _ = CASES["two joints"]
    model = linear_model(robot, configurations)
    parameters = nominal_parameters(robot, model, 1e-3)
    here = response(model, parameters, FREQUENCY_HZ, 1e-3)
    both = jacobian(model, parameters, here, ("delay", "damping"))
    alone = [jacobian(model, parameters, here, (kind,)) for kind in ("delay", "damping")]
    np.testing.assert_array_equal(both, np.concatenate(alone, axis=-1))


def test_link_inertia_is_that_of_the_robot_file():
    robot = replace(two_joint_robot(), gravity_m_s2=np.zeros(3))
    extra = 0.05
    link = robot.joints[0].link
    more = Inertial(link.mass_kg, link.com_m, link.inertia_kgm2 + np.diag([0.0, 0.0, extra]))
    heavier = replace(robot, joints=(replace(robot.joints[0], link=more), robot.joints[1]))
    configurations = np.array([[0.4, -0.9]])
    model, changed = linear_model(robot, configurations), linear_model(heavier, configurations)
    parameters = nominal_parameters(robot, model, 0.0)
    moved = with_values(parameters, "link_inertia", parameters.link_inertia + np.array([extra, 0.0]))
    wanted = response(changed, nominal_parameters(heavier, changed, 0.0), FREQUENCY_HZ, None).sampled
    found = response(model, moved, FREQUENCY_HZ, None).sampled
    np.testing.assert_allclose(found, wanted, rtol=1e-9)
    assert np.abs(response(model, parameters, FREQUENCY_HZ, None).sampled / wanted - 1).max() > 0.005


def test_spong_response_is_reciprocal_and_sampling_keeps_it():
    robot, configurations, _ = CASES["two joints"]
    model = linear_model(robot, configurations)
    found = response(model, nominal_parameters(robot, model, 1e-3), FREQUENCY_HZ, 1e-3).sampled
    np.testing.assert_allclose(found, np.swapaxes(found, 2, 3), rtol=1e-9)


def test_low_and_high_frequency_limits():
    robot = two_mass_robot(damping=0.0)
    model = linear_model(robot, np.zeros((1, 1)))
    found = response(model, nominal_parameters(robot, model, 0.0), np.array([1e-2, 1e4]), None).sampled
    np.testing.assert_allclose(found[0, :, 0, 0], [1 / (4.780e-3 + 4.752e-3), 1 / 4.780e-3], rtol=1e-4)
