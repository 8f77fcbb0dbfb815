"""Friction torque along a periodic motion: against an ODE solver and against MuJoCo's own LuGre."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from exact_systems import two_mass_robot
from robid.frf.compensation import periodic_speed
from robid.robot.actuators import friction_rows
from robid.robot.friction import KINDS, LAWS, LUGRE, Curve, Friction, TorqueLaw, friction_torque, periodic_recurrence
from robid.robot.model import build_model

PERIOD_S = 1.0
LAW = TorqueLaw(
    coulomb_nm=1.5,
    static_nm=2.0,
    stribeck_rad_s=2.0,
    width=0.05,
    relative_std=0.1,
    ripple_nm=0.06,
    ripple_order=6,
)
LINES = np.array([1, 3, 7, 11])
AMPLITUDE = np.array([4.0, 1.5, 0.8, 0.3])
PHASE = np.array([0.3, 1.2, 4.0, 2.2])


def motion(time):
    """Angle and speed of a multisine."""
    omega = 2 * np.pi * LINES / PERIOD_S
    phase = np.multiply.outer(time, omega) + PHASE
    return np.sin(phase) @ (AMPLITUDE / omega), np.cos(phase) @ AMPLITUDE


@pytest.mark.parametrize("oversampling", [1, 2, 5])
def test_speed_of_a_multisine_is_exact(oversampling):
    n_sample = 200
    angle = motion(np.arange(n_sample) * PERIOD_S / n_sample)[0]
    grid = np.arange(n_sample * oversampling) * PERIOD_S / (n_sample * oversampling)
    speed = periodic_speed(angle[:, None], PERIOD_S / n_sample, 50.0, oversampling)[:, 0]
    np.testing.assert_allclose(speed, motion(grid)[1], atol=1e-10)


def test_speed_drops_what_is_above_the_cut():
    n_sample = 200
    time = np.arange(n_sample) * PERIOD_S / n_sample
    angle = motion(time)[0]
    noisy = angle + 1e-3 * np.sin(2 * np.pi * 60 * time)
    found = periodic_speed(noisy, PERIOD_S / n_sample, 50.0, 1)
    np.testing.assert_allclose(found, periodic_speed(angle, PERIOD_S / n_sample, 50.0, 1), atol=1e-10)


def bristle_torque(law, time):
    """The bristle's torque in the periodic steady state, by a general ODE solver."""
    ratio = law.static_nm / law.coulomb_nm

    def slope(t, z):
        speed = motion(t)[1]
        limit = law.width * (1 + (ratio - 1) * np.exp(-((speed / law.stribeck_rad_s) ** 2)))
        return speed - abs(speed) * z / limit

    solution = solve_ivp(slope, (0, 2), [0.0], t_eval=time + 1.0, method="LSODA", rtol=1e-9, atol=1e-12, max_step=2e-3)
    return solution.y[0] * law.coulomb_nm / law.width


def test_lugre_against_an_ode_solver_with_second_order_convergence():
    errors = []
    for n_step in (1000, 2000, 4000):
        time = np.arange(n_step) * PERIOD_S / n_step
        speed = motion(time)[1]
        found = friction_torque(speed[:, None], PERIOD_S / n_step, (LAW,))[:, 0]
        errors.append(np.abs(found - bristle_torque(LAW, time)).max())
    assert errors[1] < 0.005 * LAW.coulomb_nm
    # Reversals fall between grid points at random, so only the slope over both halvings is smooth.
    assert np.log(errors[0] / errors[2]) / np.log(4) > 1.7, errors


def test_lugre_limits():
    constant = np.full((400, 1), 50.0)
    np.testing.assert_allclose(friction_torque(constant, 1e-3, (LAW,)), LAW.coulomb_nm, rtol=1e-9)
    np.testing.assert_allclose(friction_torque(-constant, 1e-3, (LAW,)), -LAW.coulomb_nm, rtol=1e-9)
    creeping = np.full((400, 1), 0.1)
    np.testing.assert_allclose(friction_torque(creeping, 0.1, (LAW,)), LAW.static_nm, rtol=3e-3)
    time = np.arange(2000) / 2000
    tiny = 1e-4 * np.cos(2 * np.pi * time)[:, None]
    torque = friction_torque(tiny, 1 / 2000, (LAW,))
    stiffness = (torque.max() - torque.min()) / (2 * 1e-4 / (2 * np.pi))
    np.testing.assert_allclose(stiffness, LAW.coulomb_nm / LAW.width, rtol=1e-3)


def test_lugre_against_the_simulators_friction():
    robot = two_mass_robot(motor_inertia=1e-2, load_inertia=1e-4, stiffness=1e3, damping=0.1)
    friction = Friction(0.0, LAW.coulomb_nm, LAW.static_nm, LAW.stribeck_rad_s, LAW.width)
    joint = replace(robot.joints[0], motor=replace(robot.joints[0].motor, friction=friction))
    step_s, n_step = 1e-4, 10000
    model = build_model(replace(robot, joints=(joint,)), friction=LUGRE, timestep_s=step_s).mujoco
    data = mujoco.MjData(model)
    angle, speed = motion(np.arange(2 * n_step) * step_s)
    data.qpos[:], data.qvel[:] = angle[0], speed[0]
    shown, force = np.empty(2 * n_step), np.empty(2 * n_step)
    passive = model.actuator("friction_drive").id
    for sample in range(2 * n_step):
        data.ctrl[0] = 2000 * (angle[sample] - data.qpos[0]) + 20 * (speed[sample] - data.qvel[0])
        shown[sample] = data.qvel[0]
        mujoco.mj_step(model, data)
        force[sample] = data.actuator_force[passive]
    found = friction_torque(shown[n_step:, None], step_s, (LAW,))[:, 0]
    assert np.abs(found + force[n_step:]).max() < 0.02 * LAW.coulomb_nm
    assert np.abs(found + force[n_step:]).mean() < 0.002 * LAW.coulomb_nm


def test_motors_do_not_mix():
    time = np.arange(500) / 500
    speed = motion(time)[1]
    other = replace(LAW, coulomb_nm=0.4, static_nm=0.4, width=0.01)
    both = friction_torque(np.stack([speed, 2 * speed], axis=-1), 2e-3, (LAW, other))
    np.testing.assert_array_equal(both[:, 0], friction_torque(speed[:, None], 2e-3, (LAW,))[:, 0])
    np.testing.assert_array_equal(both[:, 1], friction_torque(2 * speed[:, None], 2e-3, (other,))[:, 0])


def test_frictionless_motor_gives_no_torque():
    none = TorqueLaw(0.0, 0.0, 1.0, 0.02, 0.1, 0.0, 6)
    assert none.is_zero
    assert not LAW.is_zero
    assert none.coefficient_std == (0.0,) * len(KINDS)
    assert all(value > 0 for value in LAW.coefficient_std)
    assert (friction_torque(motion(np.arange(100) / 100)[1][:, None], 1e-2, (none,)) == 0).all()


@pytest.mark.parametrize("n_step", [7, 1000, 1009])
def test_recurrence_repeats_and_obeys_its_rule(n_step):
    generator = np.random.default_rng(3)
    decay, drive = generator.uniform(0.5, 1, (n_step, 2, 3)), generator.standard_normal((n_step, 2, 3))
    decay[:, 0, 0] = 1
    found = periodic_recurrence(decay, drive)
    after = decay * found + drive
    np.testing.assert_allclose(found[1:], after[:-1], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found[0, 1], after[-1, 1], rtol=1e-12, atol=1e-12)
    assert found[0, 0, 0] == 0


def test_law_without_memory_is_its_curve():
    law = replace(LAW, law=LAWS["stribeck"], width=0.3)
    speed = np.array([-50.0, -0.3, 0.0, 0.3, 2.0, 50.0])[:, None]
    level = 1.5 + 0.5 * np.exp(-((speed / 2.0) ** 2))
    np.testing.assert_allclose(friction_torque(speed, 1e-3, (law,)), level * np.tanh(speed / 0.3), rtol=1e-12)
    both = friction_torque(np.tile(speed, 2), 1e-3, (LAW, law))
    np.testing.assert_array_equal(both[:, 1:], friction_torque(speed, 1e-3, (law,)))
    np.testing.assert_array_equal(both[:, :1], friction_torque(speed, 1e-3, (LAW,)))


class Arctan(Curve):
    """A law that the house does not have: a softer sign than tanh's."""

    def curve(self, friction, speed):
        """Torque at some speeds."""
        return friction.coulomb_nm * 2 / np.pi * np.arctan(speed / friction.stribeck_rad_s)

    def periodic_torque(self, speed, _step_s, coefficients):
        """The same of several motors."""
        return coefficients.coulomb * 2 / np.pi * np.arctan(speed / coefficients.width)


def test_a_further_law_is_one_class():
    law, friction = Arctan("arctan", sign_share=1.0, breaks_away=False, knots=40), Friction(0.0, 0.5, 0.5, 2.0)
    robot = two_mass_robot()
    joint = replace(robot.joints[0], motor=replace(robot.joints[0].motor, friction=friction))
    model = build_model(replace(robot, joints=(joint,)), friction=law)
    assert len(friction_rows(model.mujoco, model.robot, law)) == 40
    speed = np.linspace(-5, 5, 11)[:, None]
    own = TorqueLaw(0.5, 0.5, 2.0, 2.0, 0.1, 0.0, 6, law)
    both = friction_torque(np.tile(speed, 2), 1e-3, (LAW, own))
    np.testing.assert_allclose(both[:, 1:], law.curve(friction, speed))
    assert own.at(own.coordinates).law is law
