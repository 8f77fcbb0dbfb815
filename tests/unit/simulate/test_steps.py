"""The number of steps follows from modes and friction, and is enough: halving the step changes little."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.friction import LUGRE, Friction
from robid.robot.model import build_model
from robid.simulate.experiment import SimulatedExperiment, simulate, with_settled_steps
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.steps import choose_steps, peak_motor_speed, visited

LINES_HZ = np.geomspace(2, 80, 30)
REST = np.zeros((1, 1))


def chosen(robot, options=None, speed=0.0, configurations=REST):
    options = options or SimulateOptions()
    return choose_steps(robot, Controller(), options, configurations, LINES_HZ, np.full(len(robot.joints), speed))


def rubbed(robot, **law):
    joints = tuple(replace(j, motor=replace(j.motor, friction=Friction(**law))) for j in robot.joints)
    return replace(robot, joints=joints)


def stiff_drive(eigenfrequency_hz):
    """A light drive whose two halves swing against each other at this frequency."""
    inertia = 1e-4
    stiffness = 0.5 * inertia * (2 * np.pi * eigenfrequency_hz) ** 2
    return two_mass_robot(inertia, inertia, stiffness, 0.02 * stiffness / (2 * np.pi * eigenfrequency_hz), viscous=1e-4)


@pytest.mark.parametrize("hz", [30.0, 79.0, 200.0, 430.0, 900.0])
def test_the_number_is_enough_for_the_stiffest_mode_and_one_less_is_not(hz):
    robot = stiff_drive(hz)
    steps = chosen(robot)
    run = SimulatedExperiment(
        robot, Controller(speed_bandwidth_hz=5), SimulateOptions(transient_periods=3), np.zeros((1, 1, 1000, 1)),
        "torque", np.arange(3, 80, 4), np.zeros(0, int), 1,
    )  # fmt: skip
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, run.excited_lines.size)
    time = np.arange(1000) / 1000
    signal = 1e-3 * np.cos(2 * np.pi * np.outer(time, run.excited_lines) + phase).sum(axis=1)
    run = replace(run, reference=signal[None, None, :, None])

    def found(count):
        options = replace(run.options, steps_per_sample=count)
        return estimate_frf(simulate(replace(run, options=options), REST[0], 0), EstimateOptions(compensation="none"))

    change = np.abs(found(steps.count).response / found(2 * steps.count).response - 1)
    assert change.max() < 1e-3
    assert f"{hz:.0f} Hz" in steps.reason
    assert steps.count > 1 or hz < 300


def test_stiffer_modes_need_more_steps_and_a_stated_number_stays():
    counts = [chosen(stiff_drive(hz)).count for hz in (30, 300, 1300, 2400)]
    assert counts[0] == 1
    assert counts == sorted(set(counts))
    stated = chosen(stiff_drive(2400), SimulateOptions(steps_per_sample=1))
    assert (stated.count, stated.reason) == (1, "as stated")


def test_bristles_need_steps_by_their_rate_and_their_resonance():
    lugre = SimulateOptions(Imperfections(friction="lugre"))
    heavy = rubbed(two_mass_robot(1e-2, 1e-2, damping=1.5), coulomb_nm=0.5, static_nm=0.6, presliding_rad=0.05)
    assert chosen(heavy, lugre, speed=50.0).count == 1
    # 400 rad/s over 0.05 rad is a rate of 8 per sample of 1 ms: 4 steps of 2.
    fast = chosen(heavy, lugre, speed=400.0)
    assert (fast.count, fast.reason) == (4, "the bristles' rate")
    assert chosen(heavy, speed=400.0).count == 1
    # sigma_0 = 10 N m/rad on 1e-4 kg m^2 is 316 rad/s, 0.316 per sample.
    light = rubbed(two_mass_robot(1e-4, 1e-4, 10.0, damping=0.003), coulomb_nm=0.5, static_nm=0.6, presliding_rad=0.05)
    resting = chosen(light, lugre)
    assert (resting.count, resting.reason) == (4, "the bristles' resonance with the rotors")


@pytest.mark.parametrize("step_s", [1e-3, 5e-4])
def test_resting_bristles_take_damping_as_the_rule_says(step_s):
    robot = rubbed(two_mass_robot(1e-4, 1e-6, 1e-3, damping=0.0), coulomb_nm=0.5, static_nm=0.5, presliding_rad=0.05)
    model = build_model(robot, friction=LUGRE, timestep_s=step_s).mujoco
    data = mujoco.MjData(model)
    data.qvel[0] = 1e-4 * 0.05 * np.sqrt(10 / 1e-4)
    energy = []
    for _ in range(round(0.2 / step_s)):
        mujoco.mj_step(model, data)
        energy.append(data.qvel[0] ** 2)
    turn = round(2 * np.pi / np.sqrt(10 / 1e-4) / step_s)
    first, last = max(energy[: 2 * turn]), max(energy[-2 * turn :])
    time_s = step_s * (
        int(np.argmax(energy[-2 * turn :])) + len(energy) - 2 * turn - int(np.argmax(energy[: 2 * turn]))
    )
    # Energy grows by 2 zeta w_b, where zeta = w_b h / 4.
    found = np.log(last / first) / (2 * np.sqrt(10 / 1e-4) * time_s)
    assert found == pytest.approx(np.sqrt(10 / 1e-4) * step_s / 4, rel=0.15)


@pytest.mark.parametrize(("law", "count"), [("tanh", 3), ("stribeck", 30)])
def test_friction_without_memory_needs_steps_by_its_slope(law, count):
    # Slopes of 0.5 / 2 and 10 * 0.6 / 2 N m s/rad on 1e-4 kg m^2: 2.5 and 30 per sample.
    robot = rubbed(two_mass_robot(1e-4, 1e-4, 10.0, damping=0.003), coulomb_nm=0.5, static_nm=0.6, stribeck_rad_s=2.0)
    steps = chosen(robot, SimulateOptions(Imperfections(friction=law)))
    assert (steps.count, steps.reason) == (count, "the friction's jump at reversals")


def test_what_motors_are_told_gives_their_speed():
    robot, time = two_joint_robot(), np.arange(1000) / 1000
    wave = np.stack([np.sin(2 * np.pi * 10 * time), 3 * np.cos(2 * np.pi * 5 * time)], axis=1)
    speed = {kind: peak_motor_speed(robot, Controller(), wave, kind) for kind in ("speed_reference", "torque")}
    np.testing.assert_allclose(speed["speed_reference"], [1, 3], rtol=1e-3)
    np.testing.assert_allclose(speed["torque"], [1 / (20 * np.pi) / 8e-4, 3 / (10 * np.pi) / 4e-4], rtol=1e-3)
    told = peak_motor_speed(robot, Controller(), wave, "position_reference")
    np.testing.assert_allclose(told, [20 * np.pi, 30 * np.pi], rtol=1e-3)
    np.testing.assert_allclose(peak_motor_speed(robot, Controller(), 1e4 * wave, "torque"), [400, 400])


def test_an_open_number_is_settled_before_the_simulation():
    wave = np.sin(2 * np.pi * 10 * np.arange(200) / 1000)[:, None]
    run = SimulatedExperiment(
        two_joint_robot(), Controller(), SimulateOptions(), np.stack([wave * [1, 0], wave * [0, 1]])[None],
        "speed_reference", np.array([2]), np.zeros(0, int), 1,
    )  # fmt: skip
    settled, steps = with_settled_steps(run, np.array([[0.3, -0.8]]))
    assert settled.options.steps_per_sample == steps.count >= 1
    record, same = (simulate(each, np.array([0.3, -0.8]), 0) for each in (run, settled))
    np.testing.assert_array_equal(record.inputs, same.inputs)


@pytest.mark.parametrize("kind", ["speed_reference", "position_reference"])
def test_far_motions_are_looked_at_where_they_lead(kind):
    robot, rest = two_joint_robot(), np.array([[0.3, -0.8]])
    time = np.arange(2000) / 1000
    way = np.sin(np.pi * time)[:, None] * [0.2, 0.9]
    reference = way @ robot.motor_per_arm.T
    if kind == "speed_reference":
        reference = np.pi * np.cos(np.pi * time)[:, None] * [0.2, 0.9] @ robot.motor_per_arm.T
    far = visited(robot, Controller(), reference[None, None], kind, rest)
    np.testing.assert_allclose(far, rest + way[::250], atol=2e-3)
    assert visited(robot, Controller(), 0.1 * reference[None, None], kind, rest) is rest
    assert visited(robot, Controller(), reference[None, None], "torque", rest) is rest
