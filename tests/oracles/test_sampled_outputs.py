"""Speeds and accelerations sampled at instants against exact discretisation, derivatives against finite differences."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.signal import cont2discrete

from exact_sampling import exact_acceleration
from exact_systems import (
    ball_screw,
    linear_axis,
    sensed_everywhere,
    two_joint_robot,
    two_mass_robot,
)
from robid.robot.derivatives import jacobian
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response, with_values
from tolerances import DISCRETISATION, FINITE_DIFFERENCE

SHARE = np.r_[np.geomspace(1e-3, 0.1, 12), np.linspace(0.12, 0.45, 23)]
"""Frequencies over the sampling rate."""

ARM = np.array([[-0.3, 0.5]])
CASES = {
    "motor and load": (two_mass_robot(stiffness=700.0), np.zeros((1, 1)), ("drive", "drive.arm")),
    "two joints": (two_joint_robot(), ARM, ("shoulder", "elbow", "elbow.arm")),
    "linear axis": (linear_axis(), np.array([[0.7]]), ("rail", "rail.arm")),
    "ball screw": (ball_screw(), np.array([[0.1]]), None),
    "sensors": (sensed_everywhere(), ARM, ("shoulder", "felt")),
}
SAMPLED = {name: (2,) if name == "sensors" else (0, 1, 2) for name in CASES}
"""An accelerometer feels gravity, so that it has no speed of its own."""


def linear_model(name, rates=()):
    robot, configurations, outputs = CASES[name]
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations), outputs)
    count = linear.output.shape[1]
    return robot, replace(linear, rates=(rates * count)[:count])


@pytest.mark.parametrize(("name", "rate"), [(name, rate) for name in CASES for rate in SAMPLED[name]])
@pytest.mark.parametrize(("period_s", "delay_samples"), [(1e-3, 0.0), (1e-3, 0.3), (4e-3, 1.0), (4e-4, 2.7), (1e-3, 5)])
def test_rates_sampled_at_instants_against_exact_discretisation(name, rate, period_s, delay_samples):
    if name == "ball screw" and period_s > 4e-4:
        pytest.skip("its screw rings above three times the sampling rate")
    robot, linear = linear_model(name, (rate,))
    parameters = nominal_parameters(robot, linear, delay_samples * period_s)
    frequency_hz = SHARE / period_s
    found = response(linear, parameters, frequency_hz, period_s).sampled[0]
    wanted = exact_acceleration(linear, parameters, frequency_hz, period_s, rate)
    error = np.abs(found - wanted) / np.abs(wanted).max(axis=(1, 2), keepdims=True)
    # An acceleration jumps with the torque; low lines of positions have their images in the simple form.
    assert error[(SHARE > 0.15) | (rate > 0)].max() < max(rate, 1) ** 3 * DISCRETISATION
    assert error.max() < 1e-3
    # Each for itself, far off the motors: what little is left of their motion there decides a logarithm too.
    assert (np.abs(found / wanted - 1)[(SHARE <= 0.25) & ((SHARE > 0.15) | (rate > 0))]).max() < 1e-3


@pytest.mark.parametrize("delay_samples", [0, 2])
def test_speed_of_two_masses_against_other_programs(delay_samples):
    motor, load, stiffness, damping, period_s = 4.8e-3, 6e-3, 700.0, 0.03, 1e-3
    mass, coupling = np.diag([motor, load]), np.array([[1.0, -1.0], [-1.0, 1.0]])
    lower = -np.linalg.solve(mass, np.hstack([stiffness * coupling, damping * coupling]))
    A = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), lower])
    system = A, np.array([[0.0], [0.0], [1 / motor], [0.0]]), np.eye(2, 4, 2), np.zeros((2, 1))
    robot = two_mass_robot(motor, load, stiffness, damping)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.zeros((1, 1))), ("drive", "drive.arm"))
    linear = replace(linear, rates=(1, 1))
    frequency_hz = SHARE / period_s
    parameters = nominal_parameters(robot, linear, delay_samples * period_s)
    found = response(linear, parameters, frequency_hz, period_s).sampled[0, :, :, 0]
    omega = 2 * np.pi * frequency_hz
    discrete = cont2discrete(system, period_s, "zoh")[:4]
    for plant in (control.c2d(control.ss(*system), period_s, "zoh"), control.ss(*discrete, period_s)):
        speed = np.array([plant(np.exp(1j * w * period_s))[:, 0] for w in omega])
        wanted = (1j * omega * np.exp(-1j * omega * delay_samples * period_s))[:, None] * speed
        np.testing.assert_allclose(found, wanted, rtol=DISCRETISATION)


def test_speed_of_an_inertia_in_closed_form():
    """Sampled at the instants it is x / tan(x) of what the sampled angle says, x = w T / 2."""
    robot = two_mass_robot(load_inertia=1e-9, stiffness=1.0, damping=1e-5)
    model = build_model(robot)
    linear = replace(linearize(model, solve_statics(model, np.zeros((1, 1)))), rates=(1,))
    period_s, omega = 1e-3, 2 * np.pi * SHARE / 1e-3
    found = response(linear, nominal_parameters(robot, linear, 0.0), SHARE / period_s, period_s).sampled[0, :, 0, 0]
    half, inertia = 0.5 * omega * period_s, 4.780e-3
    angle = (half / np.sin(half)) ** 2 * np.cos(half) * np.exp(-1j * half) / inertia
    np.testing.assert_allclose(found * half / np.tan(half), angle, rtol=DISCRETISATION)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("rates", [(1,), (2,), (None,), (0, 1, 2), (2, 0)], ids=str)
@pytest.mark.parametrize(
    "kind", ["stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay"]
)
def test_jacobian_is_the_derivative(name, rates, kind):
    robot, linear = linear_model(name, rates)
    period_s = 2e-3
    frequency_hz = np.array([1.3, 17.0, 60.0, 111.0, 190.0])
    parameters = nominal_parameters(robot, linear, 1.3e-3)
    here = response(linear, parameters, frequency_hz, period_s)
    found = jacobian(linear, parameters, here, (kind,))
    values = getattr(parameters, kind)
    scale = {"viscous": robot.motor_inertia_kgm2, "arm_viscous": linear.axial}.get(kind, values)
    for index in range(values.size):
        step = np.zeros(values.size)
        step[index] = 1e-4 * scale[index]

        def moved(factor, step=step):
            return response(
                linear, with_values(parameters, kind, values + factor * step), frequency_hz, period_s
            ).sampled

        difference = (8 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / (12 * step[index])
        error = np.abs(found[..., index] - difference).max(axis=1)
        assert (error <= FINITE_DIFFERENCE * np.abs(difference).max(axis=1)).all()
