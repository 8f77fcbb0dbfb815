"""Friction that follows the gears' load and the direction, a second ripple: closed forms of two masses."""

from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from exact_systems import two_mass_robot, with_arm_friction
from robid.robot.actuators import friction_rows
from robid.robot.friction import LAWS as FRICTION_LAWS
from robid.robot.friction import Friction
from robid.robot.model import build_model
from robid.simulate.engine import LoadEffects, true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions

FRICTION = Friction(0.01, 0.5, 0.5, 2.0, 0.05)
ARM_VISCOUS = 0.03
LAWS = ("lugre", "tanh", "stribeck")


def drive(ratio=1.0):
    plain = two_mass_robot(damping=0.5, ratio=ratio)
    motor = replace(plain.joints[0].motor, friction=FRICTION)
    return with_arm_friction(replace(plain, joints=(replace(plain.joints[0], motor=motor),)), ARM_VISCOUS)


def settled_speed(flaws, torque, ratio=1.0, seconds=5.0):
    """Motor speed [rad/s] that constant torques [N m] settle at."""
    controller = Controller()
    robot, options = drive(ratio), SimulateOptions(imperfections=flaws, steps_per_sample=4)
    model = true_model(robot, controller, options, sensors=False)
    batch = Batch(model.mujoco, len(torque), nthread=1)
    effects = LoadEffects(model, batch, flaws, controller.sampling_period_s)
    batch.ctrl[:, 0] = torque
    for _ in range(round(seconds / controller.sampling_period_s)):
        effects.follow()
        batch.step(nstep=4)
    return batch.qvel[:, model.motor[0]].copy()


@pytest.mark.parametrize(("law", "ratio", "one_sided"), [*product(LAWS, (1.0, -2.0), (0.0,)), ("lugre", 1.0, 0.4)])
def test_levels_follow_load_and_direction(law, ratio, one_sided):
    load_friction, asymmetry, torque = 0.3, 0.2, np.array([1.5, -1.5, 2.5])
    levels = {"load_friction": load_friction, "friction_asymmetry": asymmetry}
    flaws = Imperfections(friction=law, one_sided=one_sided, **levels)
    found = settled_speed(flaws, torque, ratio)
    # Arm-side friction loads the gear, so that every torque of the balance is known.
    load = ARM_VISCOUS * found / ratio**2
    level = (FRICTION.coulomb_nm + load_friction * np.abs(load)) * (1 + asymmetry * np.sign(found))
    np.testing.assert_allclose(FRICTION.viscous_nms_rad * found + load + np.sign(found) * level, torque, rtol=1e-3)
    plain = settled_speed(Imperfections(friction=law), torque, ratio)
    assert (np.abs(plain / found - 1)[[0, 2]] > 0.05).all()  # the second one's load and direction nearly cancel


def test_without_such_an_imperfection_nothing_is_rewritten():
    flaws = Imperfections(friction="lugre")
    model = true_model(drive(), Controller(), SimulateOptions(imperfections=flaws, steps_per_sample=1), sensors=False)
    batch = Batch(model.mujoco, 1, nthread=1)
    LoadEffects(model, batch, flaws, 1e-3).follow()
    assert batch.expanded("actuator_biasprm") is None
    assert batch.expanded("tendon_damping") is None


def test_every_ramp_of_a_motor_is_found():
    model = build_model(drive(), friction=FRICTION_LAWS["stribeck"])
    rows = friction_rows(model.mujoco, model.robot, FRICTION_LAWS["stribeck"])
    assert len({row for _, row in rows}) == len(rows) == 24
    assert {motor for motor, _ in rows} == {0}


def test_a_second_ripple_comes_to_the_first():
    plain = drive()
    motor = replace(plain.joints[0].motor, ripple_nm=0.07, ripple_order=3)
    robot = replace(plain, joints=(replace(plain.joints[0], motor=motor),))
    model = build_model(robot, ripple=True, second_ripple=(0.11, 5))
    data = mujoco.MjData(model.mujoco)
    for angle in (0.3, 1.1, -2.0):
        data.qpos[:] = angle
        mujoco.mj_forward(model.mujoco, data)
        wanted = 0.07 * np.sin(3 * angle) + 0.11 * np.sin(5 * angle)
        np.testing.assert_allclose(data.qfrc_actuator[model.motor[0]], wanted, rtol=1e-9)
