"""The simulated Cartesian loop against its linearisation, and what it records."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.errors import DataError
from robid.robot.description import StiffnessLaw
from robid.settings.load import load_robot
from robid.settings.robot_parts import tool_arm
from robid.signals.waveforms import chirp
from robid.simulate.options import Imperfections, PoseInterface, SimulateOptions
from robid.simulate.pose_loop import PoseExperiment, simulate_poses
from robid.simulate.pose_path import followed
from robid.simulate.pose_response import pose_response

ROOT = Path(__file__).parents[3]
HOME = np.array([1.0, *np.deg2rad([40.0, -70, 30])])
CHANNELS = ("X", "Y", "R", "A")
PERIOD_S, N_SAMPLE = 0.012, 200
LINES = np.arange(1, 13)
EXACT = PoseInterface(
    delay_samples=2,
    moving_average=3,
    speed_feedforward=0.5,
    external_axes=("rail",),
    resolution_m=0.0,
    resolution_rad=0.0,
)


@pytest.fixture(scope="module")
def file():
    return load_robot(ROOT / "tests/stages/pose_arm.yaml")


def experiment(file, interface=EXACT, size=1e-4, channels=CHANNELS, **options):
    robot = file.to_robot()
    signal = chirp(0.5 * PERIOD_S, 5 * PERIOD_S, N_SAMPLE, peak=0)
    reference = np.einsum("ec,s->esc", size * np.eye(len(channels)), signal)[None]
    chosen = SimulateOptions(**{"transient_periods": 1, **options})
    arm = tool_arm(file, robot)
    return PoseExperiment(robot, arm, file.controller, interface, chosen, channels, reference, LINES, 1)


def responses(record):
    inputs, outputs = (np.fft.rfft(each[0, 0, :, 0], axis=1)[:, LINES] for each in (record.inputs, record.outputs))
    own = np.einsum("eke->ke", inputs)
    return np.moveaxis(outputs / own.T[:, :, None], 0, 2)


def linear(whole, measured="motors", robot=None):
    return pose_response(
        robot or whole.robot,
        whole.arm,
        whole.controller,
        whole.interface,
        HOME,
        LINES / (N_SAMPLE * PERIOD_S),
        whole.channels,
        measured,
    )


@pytest.mark.parametrize("measured", ["motors", "tool"])
def test_small_commands_give_the_response_of_the_linearised_loop(file, measured):
    whole = experiment(file, measured_pose=measured)
    found, expected = responses(simulate_poses(whole, HOME, 0)), linear(whole, measured)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    coupling = np.abs(expected * (1 - np.eye(4))).max()
    assert coupling > 10e-3, "the map has coupling to compare"
    assert np.abs(linear(whole, "tool") - linear(whole, "motors")).max() > 10e-3, "the arm gives way"


def test_springs_that_depend_on_a_position_have_the_stiffness_of_the_home(file):
    whole = experiment(file, measured_pose="tool")
    law = StiffnessLaw(0, "stiffness", np.array([1.0, -0.5]))
    springs = tuple(replace(spring, stiffness_over=law) for spring in whole.robot.springs)
    softer = replace(whole, robot=replace(whole.robot, springs=springs))
    found, expected = responses(simulate_poses(softer, HOME, 0)), linear(softer, "tool")
    assert np.abs(expected - linear(whole, "tool")).max() > 10e-3, "the law matters"
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize(
    "change", [{"delay_samples": 3}, {"moving_average": 2}, {"speed_feedforward": 0.0}, {"sampling_period_s": 0.01}]
)
def test_the_linearised_loop_knows_what_the_interface_does(file, change):
    whole = experiment(file)
    differs = linear(replace(whole, interface=replace(EXACT, **change)))
    assert np.abs(differs - linear(whole)).max() > 0.01


def test_slow_commands_are_followed_and_late_by_delay_average_and_interpolation(file):
    stiff = replace(file.controller, position_gain_1_s=40.0, speed_bandwidth_hz=80.0)
    whole = replace(experiment(file, replace(EXACT, speed_feedforward=1.0)), controller=stiff)
    found = pose_response(whole.robot, whole.arm, stiff, whole.interface, HOME, np.array([0.05]), CHANNELS)[0]
    np.testing.assert_allclose(np.abs(found), np.eye(4), atol=1e-3)
    late = -np.angle(np.diag(found)) / (2 * np.pi * 0.05)
    # Two samples of delay, an average of three, and half a sample plus a half of held and averaged interpolation.
    told = (2 + 1 + 1) * PERIOD_S - file.controller.sampling_period_s
    assert late.min() > told - 1e-3
    assert late.max() < told + 5e-3


def test_records_hold_commands_as_sent_and_what_was_measured(file):
    coarse = replace(EXACT, resolution_m=1e-5, resolution_rad=2e-5)
    record = simulate_poses(experiment(file, coarse, size=2e-3), HOME, 0)
    assert record.inputs.shape == record.outputs.shape == (1, 1, 4, 1, N_SAMPLE, 4)
    assert record.sampling_period_s == PERIOD_S
    assert record.input_names == record.output_names == CHANNELS
    assert [(one.quantity, one.unit, one.side) for one in record.input_channels[2:]] == [
        ("position_command", "m", "tool"),
        ("position_command", "rad", "tool"),
    ]
    assert [(one.quantity, one.unit, one.side) for one in record.output_channels[2:]] == [
        ("position", "m", "tool"),
        ("angle", "rad", "tool"),
    ]
    assert record.reference is None
    np.testing.assert_array_equal(record.inputs[0, 0, 1, 0, :, [0, 2, 3]], 0)
    np.testing.assert_array_equal(record.output_offset, 0)
    step = np.array([1e-5, 1e-5, 1e-5, 2e-5])
    np.testing.assert_allclose(record.outputs / step, np.round(record.outputs / step), atol=1e-6)
    assert "2 samples of transport delay, a moving average of 3 samples" in record.notes[0]


def test_nothing_moves_before_the_delay_is_over(file):
    interface = replace(EXACT, moving_average=1, delay_samples=4)
    record = simulate_poses(experiment(file, interface, transient_periods=0), HOME, 0)
    own = np.abs(record.outputs[0, 0, 0, 0, :, 0])
    first = np.flatnonzero(followed(record.inputs[0, 0, :, 0], interface)[0, :, 0])[0]
    assert own[: first + 1].max() < 1e-12
    assert own[first + 1] > 1e-10


def test_what_the_encoders_get_wrong_reaches_the_measured_pose(file):
    noisy = Imperfections(encoder_noise_rad=1e-4)
    quiet, loud = (simulate_poses(experiment(file, imperfections=flaws), HOME, 0) for flaws in (Imperfections(), noisy))
    spread = (loud.outputs - quiet.outputs)[0, 0, :, 0].std(axis=(0, 1))
    # The rail's motor noise over its gear ratio, and the loop's own answer to it.
    assert 1e-4 / 300 < spread[2] < 2e-4 / 300


def test_the_tool_of_a_stiff_arm_is_where_its_motors_say(file):
    """The rail's way is not in the pose."""
    robot = file.to_robot()
    springs = tuple(replace(s, stiffness=20 * s.stiffness, damping=20 * s.damping) for s in robot.springs)

    def outputs(springs, measured):
        whole = experiment(file, size=2e-3, measured_pose=measured)
        return simulate_poses(replace(whole, robot=replace(robot, springs=springs)), HOME, 0).outputs

    apart = [np.abs(outputs(own, "tool") - outputs(own, "motors")).max() for own in (robot.springs, springs)]
    assert apart[0] > 1e-4
    assert apart[1] == pytest.approx(apart[0] / 20, rel=0.5)


def test_the_same_seed_gives_the_same_record_and_noise_differs_between_homes(file):
    noisy = experiment(file, replace(EXACT, noise_m=1e-5, noise_rad=1e-5), transient_periods=0)
    first, again, other = (simulate_poses(noisy, HOME, index) for index in (0, 0, 1))
    np.testing.assert_array_equal(first.outputs, again.outputs)
    spread = (first.outputs - other.outputs).std() / np.sqrt(2)
    assert spread == pytest.approx(1e-5, rel=0.1)


def test_commands_out_of_reach_name_the_configuration(file):
    with pytest.raises(DataError, match="out of reach") as error:
        simulate_poses(experiment(file, size=1.5, steps_per_sample=1), HOME, 2)
    assert "configuration 3" in error.value.where
