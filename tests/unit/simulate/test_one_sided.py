"""Gears that are stiffer one way: swings of two masses, rest under gravity, responses of a loaded arm."""

import mujoco
import numpy as np
import pytest

from elastic_loops import CONFIGURATION, PLAIN, analytic, diagonal, experiment
from exact_systems import two_joint_robot, two_mass_robot, with_spring_factors
from robid.frf.estimate import estimate_frf
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.simulate.engine import rest_of, true_model
from robid.simulate.experiment import simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions

SHARE = 0.2


@pytest.mark.parametrize("share", [SHARE, -SHARE])
@pytest.mark.parametrize("backlash", [0.0, 0.02])
def test_half_swings_each_way_take_as_long_as_their_stiffness_says(share, backlash):
    # Starts at the edge of the dead band with all of the energy in the motion: half a swing of a linear spring.
    motor_inertia, load_inertia, stiffness, step_s = 5e-3, 4e-3, 500.0, 1e-5
    robot = two_mass_robot(motor_inertia, load_inertia, stiffness, damping=0.0)
    model = build_model(robot, one_sided=share, backlash=(backlash, 0.0), timestep_s=step_s)
    reduced = 1 / (1 / motor_inertia + 1 / load_inertia)
    for way in (1.0, -1.0):
        data = mujoco.MjData(model.mujoco)
        data.qpos[model.motor] = way * 0.5 * backlash
        data.qvel[model.motor] = way
        count = 0
        while count == 0 or way * float(model.deflection[0] @ data.qpos) > 0.5 * backlash:
            mujoco.mj_step(model.mujoco, data)
            count += 1
        wanted = np.pi * np.sqrt(reduced / (stiffness * (1 + way * share)))
        assert count * step_s == pytest.approx(wanted, rel=2e-3)


def bent_stiffness(robot, share):
    """Factors of an arm's springs where gravity bends its gears."""
    rest = solve_statics(build_model(robot), CONFIGURATION[None]).deflection[0]
    gears = np.array([spring.place == "transmission" for spring in robot.springs])
    assert (np.abs(rest[gears]) > 1e-4).all()
    return np.where(gears, 1 + share * np.sign(rest), 1.0)


def test_an_arm_starts_where_gravity_lets_it_rest():
    robot, flaws = two_joint_robot(), Imperfections(one_sided=SHARE)
    model = true_model(robot, Controller(), SimulateOptions(imperfections=flaws, steps_per_sample=1), sensors=False)
    rest = rest_of(model, CONFIGURATION, flaws)
    data = mujoco.MjData(model.mujoco)

    def pull(position):
        data.qpos[:], data.ctrl[:2] = position, rest.motor_torque[0]
        mujoco.mj_forward(model.mujoco, data)
        return np.abs(data.qfrc_passive - data.qfrc_bias + data.qfrc_actuator).max()

    assert pull(rest.position[0]) < 1e-6
    assert pull(solve_statics(model, CONFIGURATION[None]).position[0]) > 1.0


@pytest.mark.parametrize("share", [SHARE, -SHARE])
def test_a_loaded_arm_has_the_stiffness_of_the_way_in_which_it_is_bent(share):
    robot = two_joint_robot()
    run = experiment(robot, rms=0.2, transient_periods=3, imperfections=Imperfections(one_sided=share))
    frf = estimate_frf(simulate(run, CONFIGURATION, 0), PLAIN)
    factors = bent_stiffness(robot, share)
    wanted = with_spring_factors(robot, factors, np.ones(factors.size))
    errors = [
        np.median(
            np.abs(
                diagonal(frf.response) / diagonal(analytic(each, CONFIGURATION, frf.frequency_hz, run.controller)) - 1
            )
        )
        for each in (wanted, robot)
    ]
    assert errors[0] < 1e-4
    assert errors[1] > 0.01
