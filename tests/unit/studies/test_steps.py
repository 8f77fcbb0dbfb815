"""Steps of the true robot under a model's control against the model's prediction."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot, with_spring_factors
from robid.errors import SettingsError
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.settings.load import load_robot
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.playback import with_tool_point
from robid.studies.settings.study import StepOptions
from robid.studies.zimmermann2023.steps import (
    StepBench,
    StepProfile,
    StepResponses,
    StepTask,
    step_control,
    step_figures,
    step_profiles,
    step_responses,
)

KR300 = Path(__file__).parents[3] / "configs" / "robots" / "kr300.yaml"
CONFIGURATIONS = np.array([[0.3, -0.8]])
PLAIN = SimulateOptions()
SHORT = StepOptions(duration_s=0.5, shortest_ramp_s=0.06)
TOOL = np.array([1.0, 0.0, 0.0])


def gears(robot, factor):
    return with_spring_factors(robot, [factor if s.place == "transmission" else 1.0 for s in robot.springs])


def stiffened(robot, share):
    springs = (replace(s, cubic=share * s.stiffness) for s in robot.springs)
    return replace(robot, springs=tuple(springs))


@pytest.fixture(scope="module")
def compared():
    robot = two_joint_robot()
    bearings = with_spring_factors(robot, [2.0 if s.place != "transmission" else 1.0 for s in robot.springs])
    models = {"exact": robot, "near": gears(robot, 1.05), "far": gears(robot, 1.4), "bearings": bearings}
    return step_responses(robot, models, Controller(), PLAIN, CONFIGURATIONS, SHORT, TOOL)


def test_a_model_that_knows_the_stiffening_predicts_it_exactly():
    robot = replace(two_joint_robot(), springs=two_joint_robot().springs[:2])
    stiff = SimulateOptions(Imperfections(stiffening_1_rad2=5e4))
    models = {"linear": robot, "stiffening": stiffened(robot, 5e4)}
    figures = step_figures(step_responses(robot, models, Controller(), stiff, CONFIGURATIONS, SHORT, TOOL))
    assert figures["stiffening"]["tool_max_m"] < 1e-12
    assert figures["stiffening"]["torque_max_nm"] < 1e-9
    assert figures["linear"]["tool_relative"] > 1e-4
    # Without further springs the exact inverse leaves what hold and sampling leave.
    assert figures["stiffening"]["path_max_m"] < 0.1 * figures["linear"]["path_max_m"]


def test_errors_grow_with_the_error_of_the_springs(compared):
    figures = step_figures(compared)
    assert figures["exact"]["tool_max_m"] == 0
    for name in ("tool_relative", "torque_relative", "path_rms_m", "vibration_relative"):
        near, far = (figures[model][name] for model in ("near", "far"))
        assert near < 0.5 * far, name
    assert figures["exact"]["vibration_relative"] < 0.3 * figures["far"]["vibration_relative"]
    assert figures["bearings"]["tool_relative"] > 0.5 * figures["near"]["tool_relative"]


def test_control_by_the_two_mass_inverse_converges_with_the_sampling_period():
    robot, options = two_mass_robot(ratio=1.0), replace(SHORT, peak_motor_speed_rad_s=0.2)
    errors = []
    for period_s in (2e-3, 1e-3):
        controller = Controller(sampling_period_s=period_s)
        found = step_responses(robot, {"own": robot}, controller, PLAIN, np.zeros((1, 1)), options, TOOL)
        errors.append(step_figures(found)["own"]["path_max_m"] / found.size_m[0, 0])
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) > 1.5


def test_six_axes_make_good_what_further_springs_do_to_the_tool():
    robot = load_robot(KR300).to_robot()
    wrong = with_spring_factors(robot, [1.5 if s.place != "transmission" else 1.0 for s in robot.springs])
    configuration = np.deg2rad([[10.0, -80.0, 60.0, 20.0, 40.0, -30.0]])
    errors = []
    for ramp_s in (0.1, 0.2):
        options = StepOptions(duration_s=0.7, shortest_ramp_s=ramp_s)
        models = {"own": robot, "wrong": wrong} if ramp_s < 0.2 else {"own": robot}
        figures = step_figures(step_responses(robot, models, Controller(), PLAIN, configuration, options))
        errors.append(figures["own"]["path_max_m"])
        if "wrong" in models:
            assert figures["own"]["path_rms_m"] < 0.5 * figures["wrong"]["path_rms_m"]
            assert figures["own"]["vibration_m"] < 0.5 * figures["wrong"]["vibration_m"]
    # A quasi-static spring's neglected rates fall with the square of the ramp at least.
    assert np.log2(errors[0] / errors[1]) > 2


def test_the_robot_ends_where_the_step_leads(compared):
    assert compared.axes == ("shoulder", "elbow")
    assert compared.tool_true.shape == (4, 1, 2, compared.time_s.size, 3)
    chord = 2 * np.sin(np.deg2rad(0.5)) * np.linalg.norm(TOOL[:2])
    assert compared.size_m[0, 1] == pytest.approx(chord, rel=0.01)  # about the elbow, which sags
    np.testing.assert_allclose(compared.tool_true[0, ..., -1, :], compared.path[..., -1, :], atol=0.01 * chord)
    np.testing.assert_array_equal(compared.time_s[compared.time_s < 0].size, 20)


def test_friction_is_fed_forward_where_there_is_any():
    robot = two_joint_robot()
    joints = []
    for joint in robot.joints:
        law = replace(joint.motor.friction, coulomb_nm=0.5, static_nm=0.6, stribeck_rad_s=2.0)
        joints.append(replace(joint, motor=replace(joint.motor, friction=law)))
    rough, lugre = replace(robot, joints=tuple(joints)), SimulateOptions(Imperfections(friction="lugre"))
    models = {"knows": rough, "does not": robot}
    figures = step_figures(step_responses(rough, models, Controller(), lugre, CONFIGURATIONS, SHORT, TOOL))
    assert figures["knows"]["path_rms_m"] < 0.5 * figures["does not"]["path_rms_m"]
    assert figures["knows"]["tool_max_m"] < 1e-12


def test_imperfections_are_the_true_robots_alone():
    flaws = Imperfections(encoder_noise_rad=1e-4, resolver_error_rad=1e-3, unmodelled_payload_kg=1.0)
    robot = two_joint_robot()
    steady = replace(SHORT, shortest_ramp_s=0.1)
    found, plain = (
        step_responses(robot, {"own": robot}, Controller(), options, CONFIGURATIONS, steady, TOOL)
        for options in (SimulateOptions(flaws), PLAIN)
    )
    np.testing.assert_array_equal(found.tool_model, plain.tool_model)
    assert step_figures(found)["own"]["tool_max_m"] > 1e-4


def test_configurations_may_run_in_parallel():
    robot = two_joint_robot()
    counted = []

    def parallel_map(function, tasks):
        counted.append(len(tasks))
        return [function(task) for task in reversed(tasks)][::-1]

    noisy = SimulateOptions(Imperfections(encoder_noise_rad=1e-4))
    two = np.array([[0.3, -0.8], [-0.4, 0.9]])
    arguments = (robot, {"own": robot}, Controller(), noisy, two, SHORT, TOOL)
    there, here = step_responses(*arguments, parallel_map), step_responses(*arguments)
    assert counted == [2]
    np.testing.assert_array_equal(there.tool_true, here.tool_true)


def weak(max_torque_nm):
    robot = two_joint_robot()
    motors = (replace(joint.motor, max_torque_nm=max_torque_nm) for joint in robot.joints)
    joints = tuple(replace(joint, motor=motor) for joint, motor in zip(robot.joints, motors, strict=True))
    return replace(robot, joints=joints)


def test_ramps_last_as_long_as_the_torque_demands():
    robot, controller = weak(3.2), Controller()
    options = replace(SHORT, shortest_ramp_s=1e-3, duration_s=1.0)
    (profiles,) = step_profiles(robot, controller, PLAIN, CONFIGURATIONS, options)
    assert all(profile.ramp_s > 2 * options.shortest_ramp_s for profile in profiles)
    speeds = [
        profile.speed_rad_s * joint.motor.gear_ratio for profile, joint in zip(profiles, robot.joints, strict=True)
    ]
    np.testing.assert_allclose(speeds, 20.0)
    straight = with_tool_point(replace(robot, springs=robot.springs[:2]), TOOL)
    bench = StepBench(straight, {}, controller, PLAIN, options.duration_s)
    control = step_control(straight, bench, StepTask(0, CONFIGURATIONS[0], profiles))
    share = np.abs(control.torque).max(axis=0) / 3.2
    assert (share.max(axis=1) < options.torque_share + 0.02).all()
    held = np.abs(solve_statics(build_model(robot), CONFIGURATIONS).motor_torque[0]).max() / 3.2
    assert (share.max(axis=1) > held + 0.3 * (options.torque_share - held)).all()


def test_a_step_turns_back_from_the_joint_limit():
    robot = two_joint_robot()
    near = np.array([[robot.upper[0] - 0.001, 0.0]])
    (profiles,) = step_profiles(robot, Controller(), PLAIN, near, SHORT)
    assert [np.sign(profile.size_rad) for profile in profiles] == [-1, 1]


def test_all_that_cannot_be_stepped_is_said_at_once():
    with pytest.raises(SettingsError, match=r"configuration 1: the step of shoulder.*elbow.*configuration 2: the step"):
        step_profiles(two_joint_robot(), Controller(), PLAIN, np.zeros((2, 2)), replace(SHORT, step_deg=20.0))
    with pytest.raises(SettingsError, match="gravity takes more than `torque_share` of motor shoulder"):
        step_profiles(weak(0.5), Controller(), PLAIN, np.zeros((1, 2)), SHORT)


def test_vibration_is_what_swings_after_the_move_and_not_what_creeps():
    time = np.linspace(-0.02, 1.0, 1021)
    after = time >= 0.3
    swing = np.where(after, 3e-4 * np.sin(2 * np.pi * 20 * time), 5e-3)
    creep = 1e-3 * (time - 0.4) ** 3
    tool = np.zeros((1, 1, 1, time.size, 3))
    tool[..., 1] = swing + creep
    path = np.zeros((1, 1, time.size, 3))
    path[..., 0] = 0.02
    none = np.zeros((1, 1, 1, time.size))
    found = StepResponses(time, ("m",), ("a",), np.zeros((1, 1)), np.array([[0.3]]), path, tool, tool, none, none)
    assert found.vibration_m[0, 0, 0] == pytest.approx(3e-4 / np.sqrt(2), rel=0.02)
    assert StepProfile(-0.1, 1.0, 0.2).duration_s == pytest.approx(0.3)


def test_figures_of_known_errors():
    time = np.arange(4.0)
    path = np.zeros((1, 2, 4, 3))
    path[0, :, 1:, 0] = np.array([[0.01], [0.04]])
    tool = path[None] + np.array([0.0, 3e-3, 4e-3]) * np.array([0.0, 1.0, 1.0, 1.0])[:, None]
    torque = np.array([[[[1.0, 3.0, 3.0, 3.0], [5.0, 3.0, 3.0, 3.0]]]])
    own = (
        np.zeros((1, 2)),
        path,
        tool,
        tool + np.array([1e-3, 0.0, 0.0]),
        torque,
        torque + np.array([0.5, -0.5, 1.0, 0]),
    )
    found = step_figures(StepResponses(time, ("m",), ("a", "b"), np.zeros((1, 2)), *own))["m"]
    assert found["tool_rms_m"] == pytest.approx(1e-3)
    assert found["tool_max_m"] == pytest.approx(1e-3)
    assert found["tool_relative"] == pytest.approx(1e-3 * np.sqrt((1 / 0.01**2 + 1 / 0.04**2) / 2))
    assert found["torque_rms_nm"] == pytest.approx(np.sqrt(1.5 / 4))
    assert found["torque_max_nm"] == pytest.approx(1.0)
    assert found["torque_relative"] == pytest.approx(np.sqrt(1.5 / 4) / np.sqrt(4 * 6 / 8))
    assert found["path_rms_m"] == pytest.approx(5e-3 * np.sqrt(0.75))
    assert found["path_max_m"] == pytest.approx(5e-3)
