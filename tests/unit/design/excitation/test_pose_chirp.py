"""Pose chirps: what is commanded, what it asks of the motors, and what the robot cannot follow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.excitation.lines import LINE_SHARE, signal_lines
from robid.design.excitation.options import PoseChirpOptions
from robid.design.excitation.pose_chirp import PoseRobot, design_pose_chirp
from robid.errors import SettingsError
from robid.robot.reach import Reach
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from robid.settings.robot_parts import tool_arm
from robid.simulate.options import PoseInterface
from tolerances import IDENTITY

ROOT = Path(__file__).parents[4]
FLAT_HOME = np.array([[1.0, *np.deg2rad([40.0, -70, 30])]])
HOME = np.array([[3.0, *np.deg2rad([0.0, -90, 90, 0, 45, 0])]])
PERIOD_S = 0.012
OPTIONS = PoseChirpOptions(amplitude_mm={"X": 5, "R": 4}, amplitude_deg=1, period_s=6, low_hz=0.5, high_hz=5)


def robot_of(name, **interface):
    file = load_robot(ROOT / name)
    robot = file.to_robot()
    return PoseRobot(tool_arm(file, robot), replace(file.pose_interface, **interface), build_rigid_model(robot))


@pytest.fixture(scope="module")
def flat():
    return robot_of("tests/stages/pose_arm.yaml", moving_average=1)


@pytest.fixture(scope="module")
def kr300():
    return robot_of("configs/robots/kr300_pose.yaml")


def designed(robot, options=OPTIONS, channels=("X", "R", "A"), homes=FLAT_HOME, reach=None, **more):
    reach = reach or Reach(robot.arm.robot)
    return design_pose_chirp(options, channels, robot, homes, more.pop("realizations", 1), reach, **more)


def test_each_channel_is_told_the_papers_chirp_in_its_turn(flat):
    excitation = designed(flat, realizations=2, periods=3, transient_periods=1)
    assert excitation.reference.shape == (2, 3, 500, 3)
    time = PERIOD_S * np.arange(500)
    wave = (1 - time / 6) * np.sin(2 * np.pi * 0.5 * time + np.pi / 6 * 4.5 * time**2)
    size = np.diag([5e-3, 4e-3, np.deg2rad(1)])
    expected = np.broadcast_to(size[:, None] * wave[:, None], (2, 3, 500, 3))
    np.testing.assert_allclose(excitation.reference, expected, atol=IDENTITY)
    assert [one.name for one in excitation.channels] == ["X", "R", "A"]
    assert excitation.sampling_period_s == PERIOD_S
    assert excitation.plan.duration_s == 2 * 3 * 6 * 4
    spectrum = 2 * np.fft.rfft(excitation.reference, axis=2)[:, :, excitation.excited_lines] / 500
    np.testing.assert_allclose(excitation.spectrum, spectrum, atol=IDENTITY)
    np.testing.assert_allclose(excitation.rms, np.diag(size) * np.sqrt(np.mean(wave**2)))


def test_the_amplitude_may_rise_before_it_falls(flat):
    excitation = designed(flat, replace(OPTIONS, chirp_peak=0.5))
    reference = np.abs(excitation.reference[0, 0, :, 0])
    assert 200 < np.argmax(reference) < 300
    assert reference[0] == reference[-1].round(3) == 0


def test_the_lines_are_those_of_the_band_that_the_chirp_carries():
    lines, detection = signal_lines(OPTIONS, PERIOD_S)
    assert detection.size == 0
    assert lines[0] == 3
    assert lines[-1] <= 30
    assert len(lines) >= 26
    narrow, _ = signal_lines(replace(OPTIONS, high_hz=1.0), PERIOD_S)
    assert narrow[-1] <= 6
    time = np.arange(500) / 500
    signal = (1 - time) * np.sin(2 * np.pi * 3 * time + np.pi * 27 * time**2)
    size = np.abs(np.fft.rfft(signal))[3:31]
    np.testing.assert_array_equal(lines, 3 + np.flatnonzero(size >= LINE_SHARE * size.max()))


def test_the_rails_motor_goes_as_fast_as_the_command_over_its_gear(flat):
    excitation = designed(flat, channels=("R",))
    command = excitation.reference[0, 0, :, 0]
    speed = 300 * np.abs(np.diff(command, append=command[0])).max() / PERIOD_S
    np.testing.assert_allclose(excitation.plan.speed_peak[0], [speed, 0, 0, 0], atol=1e-9)
    middle = np.array([1.0, 0, 0, 0])
    away = np.abs(FLAT_HOME[0] - middle)
    away[0] = np.abs(command).max()
    np.testing.assert_allclose(excitation.plan.excursion_peak[0], away, atol=1e-9)
    np.testing.assert_allclose(excitation.plan.excursion_limit, [1, *np.deg2rad([170, 150, 120])])


def test_the_plans_torque_accelerates_rail_and_arm(flat):
    """All masses move with the rail; its rotor turns."""
    excitation = designed(flat, channels=("R",))
    command = excitation.reference[0, 0, :, 0]
    speed = (np.roll(command, -1) - command) / PERIOD_S
    acceleration = (speed - np.roll(speed, 1)) / PERIOD_S
    inertia = (80 + 15 + 8 + 3) / 300 + 300 * 1e-3
    torque = inertia * acceleration + 300 * 1e-3 * speed + 0.05 * np.sign(speed)
    assert excitation.plan.torque_peak[0, 0] == pytest.approx(np.abs(torque).max(), rel=1e-6)


def test_what_the_interface_averages_asks_less_of_the_motors(flat):
    averaged = replace(flat, interface=replace(flat.interface, moving_average=8))
    plain, smooth = designed(flat).plan, designed(averaged).plan
    assert (smooth.torque_peak[0] < 0.9 * plain.torque_peak[0]).all()


def test_amplitudes_of_the_papers_size_are_followed_and_planned(kr300):
    options = PoseChirpOptions(period_s=30, high_hz=0.1, amplitude_mm=600, amplitude_deg=35, low_hz=0.04)
    excitation = designed(kr300, options, kr300.arm.channels, HOME)
    at_home = np.abs(HOME[0, 2] - np.deg2rad(-72.5))
    assert excitation.plan.excursion_peak[0, 2] > at_home + np.deg2rad(10)
    assert (excitation.plan.admissible_scale >= 1).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"amplitude_mm": {"X": 1200, "R": 5}},
            ["channel X, configuration ", "`elbow`", "turn without moving the tool"],
        ),
        ({"amplitude_mm": 100, "high_hz": 8}, ["channel X, configuration 1", "motor rail: torque peak", "mm would do"]),
    ],
)
def test_what_cannot_be_followed_names_channel_home_reason_and_remedy(flat, changes, words):
    slow = replace(OPTIONS, low_hz=0.16, high_hz=0.5)
    homes = np.repeat(FLAT_HOME, 2, axis=0) + np.eye(2, 4) * 0.1
    with pytest.raises(SettingsError) as error:
        designed(flat, replace(slow, **changes), homes=homes)
    for word in [*words, "and 1 more"]:
        assert word in error.value.what
    assert "amplitude" in error.value.remedy


@pytest.mark.parametrize(
    ("channel", "home", "words"),
    [
        ("A", [1.0, *np.deg2rad([40.0, -70, 118])], ("joint `wrist` would go to 12", "from -120 to 120 deg")),
        ("R", [1.999, *FLAT_HOME[0, 1:]], ("joint `rail` would go to 2.00", "from 0 to 2 m")),
    ],
)
def test_a_joint_near_its_limit_is_named(flat, channel, home, words):
    with pytest.raises(SettingsError) as error:
        designed(flat, replace(OPTIONS, amplitude_deg=5), (channel,), np.array([home]))
    for word in (f"channel {channel}, configuration 1", *words):
        assert word in error.value.what
    # 1 mm is left to the rail of the 4 that are asked for, 2 degrees to the wrist, which turns less than the tool.
    enough = float(error.value.what.split("about ")[1].split()[0])
    assert (0.9 < enough <= 1.0) if channel == "R" else (2 < enough < 4)


def test_a_joint_that_rests_at_its_limit_hinders_no_other(flat):
    home = np.array([[0.0, *FLAT_HOME[0, 1:]]])
    assert designed(flat, channels=("X", "A"), homes=home).plan is not None
    with pytest.raises(SettingsError, match="joint `rail` would go to"):
        designed(flat, channels=("R",), homes=home)


def test_the_amplitude_that_would_do_does(flat):
    with pytest.raises(SettingsError) as error:
        designed(flat, replace(OPTIONS, amplitude_deg=40.0), channels=("A",))
    enough = float(error.value.what.split("about ")[1].split(" deg would do")[0])
    assert 5 < enough < 40
    plan = designed(flat, replace(OPTIONS, amplitude_deg=0.97 * enough), channels=("A",)).plan
    assert max((plan.speed_peak / plan.speed_limit).max(), (plan.torque_peak / plan.torque_limit).max()) > 0.8


def test_a_pose_below_the_floor_is_told(kr300):
    options = PoseChirpOptions(channels=("X",), period_s=30, high_hz=0.1, low_hz=0.04, amplitude_mm=500)
    arm = kr300.arm
    assert designed(kr300, options, ("X",), HOME, Reach(arm.robot, floor_m=0.0)).plan is not None
    with pytest.raises(SettingsError, match="below the floor"):
        designed(kr300, options, ("X",), HOME, Reach(arm.robot, floor_m=0.1))


def test_a_stretched_arm_names_the_joints_that_lose_their_effect(kr300):
    options = PoseChirpOptions(channels=("X",), period_s=30, high_hz=0.1, low_hz=0.04, amplitude_mm=1500)
    with pytest.raises(SettingsError) as error:
        designed(kr300, options, ("X",), HOME)
    assert "`axis_2`, `axis_3`" in error.value.what


def test_periods_that_are_no_whole_samples_and_bands_beyond_nyquist_are_told(flat):
    with pytest.raises(SettingsError, match="not a whole number"):
        designed(flat, replace(OPTIONS, period_s=10.0))
    with pytest.raises(SettingsError, match="Nyquist"):
        designed(flat, replace(OPTIONS, high_hz=50.0))
    assert PoseInterface().sampling_period_s == PERIOD_S
