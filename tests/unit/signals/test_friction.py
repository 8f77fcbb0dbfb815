"""Friction torque along a periodic motion: against an ODE solver and against MuJoCo's own LuGre."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from exact_systems import two_mass_robot
from robid.robot.description import Friction
from robid.robot.model import build_model
from robid.signals.friction import KINDS, TorqueLaw, lugre_torque, periodic_speed, torque_regressors

PERIOD_S = 1.0
LAW = TorqueLaw(
    coulomb_nm=1.5,
    static_nm=2.0,
    stribeck_rad_s=2.0,
    presliding_rad=0.05,
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
        limit = law.presliding_rad * (1 + (ratio - 1) * np.exp(-((speed / law.stribeck_rad_s) ** 2)))
        return speed - abs(speed) * z / limit

    solution = solve_ivp(slope, (0, 2), [0.0], t_eval=time + 1.0, method="LSODA", rtol=1e-9, atol=1e-12, max_step=2e-3)
    return solution.y[0] * law.coulomb_nm / law.presliding_rad


def test_lugre_against_an_ode_solver_with_second_order_convergence():
    errors = []
    for n_step in (1000, 2000, 4000):
        time = np.arange(n_step) * PERIOD_S / n_step
        speed = motion(time)[1]
        found = lugre_torque(speed[:, None], PERIOD_S / n_step, (LAW,))[:, 0]
        errors.append(np.abs(found - bristle_torque(LAW, time)).max())
    assert errors[1] < 0.005 * LAW.coulomb_nm
    # Reversals fall between grid points at random, so only the slope over both halvings is smooth.
    assert np.log(errors[0] / errors[2]) / np.log(4) > 1.7, errors


def test_lugre_limits():
    constant = np.full((400, 1), 50.0)
    np.testing.assert_allclose(lugre_torque(constant, 1e-3, (LAW,)), LAW.coulomb_nm, rtol=1e-9)
    np.testing.assert_allclose(lugre_torque(-constant, 1e-3, (LAW,)), -LAW.coulomb_nm, rtol=1e-9)
    creeping = np.full((400, 1), 0.1)
    np.testing.assert_allclose(lugre_torque(creeping, 0.1, (LAW,)), LAW.static_nm, rtol=3e-3)
    time = np.arange(2000) / 2000
    tiny = 1e-4 * np.cos(2 * np.pi * time)[:, None]
    torque = lugre_torque(tiny, 1 / 2000, (LAW,))
    stiffness = (torque.max() - torque.min()) / (2 * 1e-4 / (2 * np.pi))
    np.testing.assert_allclose(stiffness, LAW.coulomb_nm / LAW.presliding_rad, rtol=1e-3)


def test_lugre_against_the_simulators_friction():
    robot = two_mass_robot(motor_inertia=1e-2, load_inertia=1e-4, stiffness=1e3, damping=0.1)
    friction = Friction(0.0, LAW.coulomb_nm, LAW.static_nm, LAW.stribeck_rad_s, LAW.presliding_rad)
    joint = replace(robot.joints[0], motor=replace(robot.joints[0].motor, friction=friction))
    step_s, n_step = 1e-4, 10000
    model = build_model(replace(robot, joints=(joint,)), friction=True, timestep_s=step_s).mujoco
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
    found = lugre_torque(shown[n_step:, None], step_s, (LAW,))[:, 0]
    assert np.abs(found + force[n_step:]).max() < 0.02 * LAW.coulomb_nm
    assert np.abs(found + force[n_step:]).mean() < 0.002 * LAW.coulomb_nm


def test_motors_do_not_mix():
    time = np.arange(500) / 500
    speed = motion(time)[1]
    other = replace(LAW, coulomb_nm=0.4, static_nm=0.4, presliding_rad=0.01)
    both = lugre_torque(np.stack([speed, 2 * speed], axis=-1), 2e-3, (LAW, other))
    np.testing.assert_array_equal(both[:, 0], lugre_torque(speed[:, None], 2e-3, (LAW,))[:, 0])
    np.testing.assert_array_equal(both[:, 1], lugre_torque(2 * speed[:, None], 2e-3, (other,))[:, 0])


def test_frictionless_motor_gives_no_torque():
    none = TorqueLaw(0.0, 0.0, 1.0, 0.02, 0.1, 0.0, 6)
    assert none.is_zero
    assert not LAW.is_zero
    assert none.coefficient_std == (0.0,) * len(KINDS)
    assert all(value > 0 for value in LAW.coefficient_std)
    assert (lugre_torque(motion(np.arange(100) / 100)[1][:, None], 1e-2, (none,)) == 0).all()


def test_regressors_are_derivatives_of_the_torque():
    n_sample, oversampling = 1000, 2
    sampling_s = PERIOD_S / n_sample
    angle = motion(np.arange(n_sample) * sampling_s)[0][:, None] + 0.4
    found = dict(zip(KINDS, torque_regressors(angle, sampling_s, (LAW,), 50.0, oversampling), strict=True))
    step_s = sampling_s / oversampling
    speed = periodic_speed(angle, sampling_s, 50.0, oversampling)
    nominal = lugre_torque(speed, step_s, (LAW,))
    np.testing.assert_allclose(found["level"], nominal, rtol=1e-12)
    change = 1e-4
    shaped = replace(
        LAW,
        stribeck_rad_s=LAW.stribeck_rad_s * (1 + change),
        presliding_rad=LAW.presliding_rad * (1 + change),
    )
    slope = (lugre_torque(speed, step_s, (shaped,)) - nominal) / change
    # The step of the regressor is 5 %: the derivative is a secant.
    assert np.abs(found["shape"] - slope).mean() < 0.06 * np.abs(slope).mean()
    later = np.roll(nominal, oversampling, axis=0) - nominal
    if "lag" in found:
        assert np.abs(found["lag"] - later).mean() < 0.1 * np.abs(later).mean()
    phase = LAW.ripple_order * np.repeat(angle, oversampling, axis=0)
    np.testing.assert_allclose(found["ripple_sin"] ** 2 + found["ripple_cos"] ** 2, LAW.ripple_nm**2, rtol=1e-9)
    np.testing.assert_allclose(found["ripple_sin"][::2], LAW.ripple_nm * np.sin(phase[::2]), rtol=1e-9)
