"""Counterbalances against closed forms and their energy."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_robots import planar_arm
from robid.robot.description import HarmonicBalance, Inertial, SpringBalance
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from tolerances import FINITE_DIFFERENCE, IDENTITY


def pendulum(balance, mass=8.0, arm=0.5):
    """A point mass on a horizontal axis, its joint's angle counted from the horizontal, with a gear of 50."""
    robot = planar_arm(1)
    body = Inertial(mass, np.array([arm, 0.0, 0.0]), 1e-9 * np.eye(3))
    motor = replace(robot.joints[0].motor, gear_ratio=50.0)
    return replace(robot, joints=(replace(robot.joints[0], link=body, motor=motor, counterbalance=balance),))


def held(robot, angles):
    model = build_rigid_model(robot)
    still = np.zeros((angles.size, 1))
    return 50.0 * model.torques(model.nominal, 50.0 * angles[:, None], still, still)[:, 0]


ANGLES = np.linspace(-1.5, 1.5, 31)


def test_an_ideal_spring_balances_a_pendulum_everywhere():
    # A spring of no free length from a point above the axis to one on the arm: k = m g l / (a b).
    above, out = 0.3, 0.4
    spring = SpringBalance(
        np.array([0.0, above, 0.0]), np.array([out, 0.0, 0.0]), 0.0, 8.0 * 9.81 * 0.5 / (above * out)
    )
    bare = held(pendulum(None), ANGLES)
    np.testing.assert_allclose(bare, 8.0 * 9.81 * 0.5 * np.cos(ANGLES), rtol=1e-7)
    assert np.abs(held(pendulum(spring), ANGLES)).max() < IDENTITY * np.abs(bare).max()


def test_harmonics_balance_a_pendulum_everywhere():
    harmonics = HarmonicBalance(np.array([0.0, 3.0]), np.array([8.0 * 9.81 * 0.5, 0.0]))
    np.testing.assert_allclose(held(pendulum(harmonics), ANGLES), -3.0 * np.sin(2 * ANGLES), atol=1e-9)
    names = build_rigid_model(pendulum(harmonics)).names
    assert names[-4:] == tuple(f"joint1.counterbalance_{name}" for name in ("sin1", "sin2", "cos1", "cos2"))
    without = build_rigid_model(pendulum(harmonics), RigidOptions(counterbalances=False))
    assert not any("counterbalance" in name for name in without.names)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_spring_gives_back_the_energy_that_it_takes(kind):
    spring = SpringBalance(np.array([-0.2, 0.5, 0.1]), np.array([0.3, -0.1, 0.4]), 0.35, 4e3, 120.0)
    robot = pendulum(spring)
    robot = replace(robot, joints=(replace(robot.joints[0], type=kind),))
    step = 1e-6

    def energy(position):
        turned = np.array(
            [np.cos(position) * 0.3 + np.sin(position) * 0.1, np.sin(position) * 0.3 - np.cos(position) * 0.1]
        )
        point = np.array([*turned, 0.4]) if kind == "revolute" else np.array([0.3, -0.1, 0.4 + position])
        stretch = np.linalg.norm(point - spring.carrier_point_m) - 0.35
        return 2e3 * stretch**2 + 120.0 * stretch

    wanted = [(energy(at + step) - energy(at - step)) / (2 * step) for at in ANGLES]
    bare = replace(robot, joints=(replace(robot.joints[0], counterbalance=None),))
    found = held(robot, ANGLES) - held(bare, ANGLES)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=FINITE_DIFFERENCE * np.abs(wanted).max())
