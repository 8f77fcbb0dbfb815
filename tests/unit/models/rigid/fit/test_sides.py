"""Channels of either side of each joint, brought to the motors."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_robots import random_chain, with_gears
from robid.errors import DataError
from robid.models.rigid.fit.shots import shots_of, without_gears
from robid.robot.description import no_motor
from robid.signals.quantities import Channel
from robid.signals.record import Record
from tolerances import IDENTITY

N_JOINT, N_SAMPLE = 4, 7


def _record(robot, arm_moves, arm_drives, position, torque):
    """What is recorded where some joints (n_joint,) are measured at their arms."""
    turns = robot.arm_per_motor
    arm_position, arm_torque = position @ turns.T, np.linalg.solve(turns.T, torque.T).T
    moves = np.where(arm_moves, arm_position, position)
    drives = np.where(arm_drives, arm_torque, torque)
    names = [joint.name for joint in robot.joints]
    shape = (1, 1, 1, 1, N_SAMPLE, N_JOINT)
    outputs = [
        Channel(f"{n}.arm" if arm else n, "angle", "rad", "arm" if arm else "motor")
        for n, arm in zip(names, arm_moves, strict=True)
    ]
    inputs = [Channel(n, "torque", "N m", "arm" if arm else "motor") for n, arm in zip(names, arm_drives, strict=True)]
    return Record(
        sampling_period_s=1e-3,
        inputs=drives.reshape(shape),
        outputs=moves.reshape(shape),
        output_offset=np.zeros((1, N_JOINT)),
        input_channels=tuple(inputs),
        output_channels=tuple(outputs),
    )


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("pattern", range(16))
def test_motor_angles_and_torques_come_from_any_mixture_of_sides(pattern, coupled):
    robot = with_gears(random_chain(1, N_JOINT), couplings=coupled)
    generator = np.random.default_rng(pattern)
    position, torque = generator.standard_normal((2, N_SAMPLE, N_JOINT))
    arm_moves = np.array([pattern >> bit & 1 for bit in range(N_JOINT)], bool)
    (shot,) = shots_of(_record(robot, arm_moves, arm_moves[::-1], position, torque), robot)
    np.testing.assert_allclose(shot.position, position, rtol=0, atol=IDENTITY * 1e3)
    np.testing.assert_allclose(shot.torque, torque, rtol=0, atol=IDENTITY * 1e3)


def test_joints_without_a_motor_are_the_arms_own():
    robot = random_chain(2, N_JOINT)
    felt = replace(robot.joints[1], motor=no_motor(), torque_at="joint")
    robot = replace(robot, joints=(robot.joints[0], felt, *robot.joints[2:]))
    position, torque = np.random.default_rng(0).standard_normal((2, N_SAMPLE, N_JOINT))
    sides = np.array([False, True, False, False])
    (shot,) = shots_of(_record(robot, sides, sides, position, torque), robot)
    np.testing.assert_array_equal(shot.position, position)
    np.testing.assert_array_equal(shot.torque, torque)


def test_a_motion_that_is_measured_twice_is_refused():
    robot = random_chain(3, N_JOINT)
    # The second arm turns with the first motor alone, as good as: both show the same.
    turned = replace(
        robot.joints[1], couplings={robot.joints[0].name: 1.0}, motor=replace(robot.joints[1].motor, gear_ratio=1e9)
    )
    robot = replace(robot, joints=(robot.joints[0], turned, *robot.joints[2:]))
    sides = np.array([False, True, False, False])
    position, torque = np.random.default_rng(0).standard_normal((2, N_SAMPLE, N_JOINT))
    with pytest.raises(DataError, match="twice"):
        shots_of(_record(robot, sides, sides, position, torque), robot)


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("drives", [False, True])
def test_a_gear_ratio_is_in_doubt_unless_angle_and_torque_are_the_joints_own(moves, drives):
    robot = random_chain(3, N_JOINT, slides=0.0)
    ratios = [f"{joint.name}.motor.gear_ratio" for joint in robot.joints]
    robot = replace(robot, assumed=(*ratios, "payload.mass_kg"))
    nothing = np.zeros((N_SAMPLE, N_JOINT))
    first = np.arange(N_JOINT) == 0
    found = without_gears(robot, _record(robot, first & moves, first & drives, nothing, nothing))
    assert found.assumed == (*ratios[moves and drives :], "payload.mass_kg")
