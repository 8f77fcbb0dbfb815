"""The start of a simulation: near the periodic steady state, and from rest where none is predicted."""

from dataclasses import replace

import numpy as np
import pytest

from elastic_loops import CONFIGURATION, experiment, two_joint_robot
from robid.robot.friction import Friction
from robid.simulate.closed_loop import Told
from robid.simulate.experiment import simulate
from robid.simulate.options import Imperfections
from robid.simulate.steady import sliding_friction, steady_start


def settled(run, **options):
    """One period after one that is dropped, and six recorded ones from rest, of which the last has settled."""
    options = replace(run.options, **options)
    short = simulate(replace(run, options=replace(options, transient_periods=1), periods=1), CONFIGURATION, 0)
    long = simulate(replace(run, options=replace(options, transient_periods=0), periods=6), CONFIGURATION, 0)
    return short.outputs[0, :, :, 0], np.moveaxis(long.outputs[0], 2, 0)


def rms(signals):
    return np.sqrt(np.mean(signals**2, axis=(0, 1, 2)))


@pytest.mark.parametrize("inject", ["speed_reference", "position_reference", "torque"])
def test_a_linear_loop_starts_in_its_steady_state(inject):
    run = replace(experiment(two_joint_robot(), period_s=2.0, count=10), inject=inject)
    if inject != "speed_reference":
        run = replace(run, reference=0.01 * run.reference)
    short, long = settled(run)
    assert (np.abs(short - long[5]).max(axis=(0, 1, 2)) < 1e-4 * rms(long[5])).all()
    assert (np.abs(long[0] - long[5]).max(axis=(0, 1, 2)) > 0.05 * rms(long[5])).all(), "from rest it has to settle"


@pytest.mark.parametrize(
    "flaws", [{"friction": "lugre"}, {"friction": "stribeck"}, {"friction": "tanh"}, {"stiffening_1_rad2": 1e5}]
)
def test_what_is_not_linear_leaves_little_to_settle(flaws):
    friction = Friction(coulomb_nm=0.3, static_nm=0.36, stribeck_rad_s=1.0, viscous_nms_rad=1e-3)
    robot = two_joint_robot()
    joints = [replace(joint, motor=replace(joint.motor, friction=friction)) for joint in robot.joints]
    run = experiment(replace(robot, joints=tuple(joints)), period_s=2.0, count=20)
    short, long = settled(run, imperfections=Imperfections(**flaws))
    # No more than what a whole period from rest leaves, or a thousandth.
    assert (rms(short - long[5]) < 2 * rms(long[1] - long[5]) + 1e-3 * rms(long[5])).all()
    assert (rms(long[0] - long[5]) > 0.02 * rms(long[5])).all()


def test_late_drives_are_in_the_loop():
    run = experiment(two_joint_robot(), period_s=2.0, count=10)
    name = run.robot.joints[0].name
    truth = replace(run.options.truth, late_torque_s={name: 1.5e-3}, late_angle_s={name: 1e-3})
    short, long = settled(run, truth=truth)
    assert (rms(short - long[5]) < 1e-4 * rms(long[5])).all()


def start(run, reference):
    told = Told.excitation(reference, run.inject, run.controller.sampling_period_s)
    options = replace(run.options, steps_per_sample=1)
    return steady_start(told, run.robot, run.controller, options, CONFIGURATION, 0)


def test_no_start_is_predicted_for_large_motions_noise_or_a_loop_that_keeps_its_place():
    run = experiment(two_joint_robot(), period_s=2.0, count=10)
    reference = run.reference.reshape(-1, *run.reference.shape[2:])
    assert start(run, reference) is not None
    assert start(run, 1e4 * reference) is None
    assert start(run, np.random.default_rng(1).standard_normal((1, 4000, 2))) is None
    assert start(replace(run, controller=replace(run.controller, position_gain_1_s=0.0)), reference) is None


def test_dampers_take_the_power_that_coulomb_friction_takes():
    speed = np.random.default_rng(2).standard_normal(400_000) * 3.0
    damping = sliding_friction(np.array([1.5]), np.array([3.0]))
    np.testing.assert_allclose(damping * np.mean(speed**2), np.mean(1.5 * np.abs(speed)), rtol=0.01)
    assert sliding_friction(np.array([1.5]), np.array([0.0])) == 0
