"""Data that contradict the robot file are named with the cause that was put into them; sound data are not."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from exact_systems import NO_PAYLOAD, exact_frf, linear_axis, two_joint_robot, two_mass_robot
from robid.design.excitation.lines import choose_lines
from robid.frf.estimate import estimate_frf
from robid.frf.joined import join
from robid.frf.options import EstimateOptions
from robid.models.known import load_experiment
from robid.results.plausible.evidence import gather_evidence, join_evidence
from robid.results.plausible.findings import data_findings, evidence_findings
from robid.robot.description import Inertial, Joint, Motor, Robot, Spring
from robid.robot.friction import Friction
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.signals.quantities import motor_channels
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.truth import true_robot

FREQUENCY_HZ = np.geomspace(1.0, 40.0, 30)
CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2], [-1.2, -1.5]])


def two_joints():
    """The two-joint robot with friction of a usual size: some five per cent of the motors' torque."""
    robot = two_joint_robot()
    law = Friction(1e-4, 0.03, 0.03, 1.0, 0.02)
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=law)) for joint in robot.joints)
    return replace(robot, joints=joints)


def with_means(frf, robot, *, offset=0.0, swing=0.3):
    """The response with the means of a robot that holds its configurations exactly."""
    held = solve_statics(build_model(robot), frf.configurations).motor_torque
    angle = frf.configurations @ robot.motor_per_arm.T + offset
    return replace(frf, mean_input=held, mean_output=angle, motion_rms=np.full_like(angle, swing))


def exact(robot=None, configurations=CONFIGURATIONS):
    robot = robot or two_joints()
    return with_means(exact_frf(robot, configurations, FREQUENCY_HZ), robot)


def torque_reversed(frf, motor):
    sign = np.where(np.arange(frf.response.shape[-1]) == motor, -1.0, 1.0)
    return replace(frf, response=frf.response * sign, mean_input=frf.mean_input * sign)


def angle_reversed(frf, motor):
    sign = np.where(np.arange(frf.response.shape[-2]) == motor, -1.0, 1.0)
    return replace(frf, response=frf.response * sign[:, None], mean_output=frf.mean_output * sign)


def relative(frf):
    """Every log's angles count from where it began."""
    return replace(frf, mean_output=np.zeros_like(frf.mean_output) + 0.02)


def causes(robot, frf):
    return [finding.cause for finding in data_findings(robot, frf)]


def with_ratio(robot, index, factor):
    joints = list(robot.joints)
    motor = joints[index].motor
    joints[index] = replace(joints[index], motor=replace(motor, gear_ratio=factor * motor.gear_ratio))
    return replace(robot, joints=tuple(joints))


def heavier(robot, kg):
    return replace(robot, payload=replace(robot.payload, mass_kg=robot.payload.mass_kg + kg))


def test_exact_data_give_no_finding():
    for frf in (exact(), relative(exact()), exact(configurations=CONFIGURATIONS[:1])):
        assert data_findings(two_joints(), frf) == ()


@pytest.mark.parametrize("motor", [0, 1])
def test_a_reversed_torque_is_told_from_a_reversed_angle(motor):
    robot = two_joints()
    for frf in (exact(), relative(exact())):
        finding, *more = data_findings(robot, torque_reversed(frf, motor))
        assert (finding.cause, finding.decisive, more) == ("torque_sign", True, [])
        assert finding.message.startswith(robot.joints[motor].name)
        finding, *more = data_findings(robot, angle_reversed(frf, motor))
        assert (finding.cause, finding.decisive, more) == ("angle_sign", True, [])
        assert finding.message.startswith(robot.joints[motor].name)


def test_torque_and_angle_of_one_motor_reversed_are_seen_by_its_couplings():
    # The driving point looks right, and without gravity only the couplings are left.
    robot = replace(two_joints(), gravity_m_s2=np.zeros(3))
    third = Joint("wrist", np.array([0.5, 0, 0]), np.eye(3), robot.joints[1].link, -2.0, 2.0, robot.joints[1].motor)
    spring = Spring("gear_3", 2, "transmission", np.array([0.0, 0.0, 1.0]), 6e3, 8.0)
    robot = replace(robot, joints=(*robot.joints, third), springs=(*robot.springs, spring))
    frf = relative(exact(robot, np.column_stack([CONFIGURATIONS, [0.4, -0.3, 0.6, 0.1]])))
    assert causes(robot, frf) == []
    both = angle_reversed(torque_reversed(frf, 1), 1)
    assert sorted(causes(robot, both)) == ["angle_sign", "torque_sign"]
    assert {finding.message.partition(":")[0] for finding in data_findings(robot, both)} == {"elbow"}


def test_a_motor_that_sticks_is_not_reversed():
    # On a spring its response points the wrong way as well: -w^2 / (k - J w^2).
    frf, robot = relative(exact()), two_joints()
    omega = 2 * np.pi * FREQUENCY_HZ[:, None]
    spring = -(omega**2) / (80.0 * (1 + 0.3j) - omega**2 * 1e-3)
    stuck = replace(frf, response=spring[None, :, None] * np.eye(2) * np.ones((4, 1, 1, 1)))
    assert "torque_sign" not in causes(robot, stuck)
    assert "angle_sign" not in causes(robot, stuck)


def test_swapped_configurations_are_paired():
    robot, frf = two_joints(), exact()
    swapped = replace(frf, configurations=CONFIGURATIONS[[0, 3, 2, 1]])
    finding, *more = data_findings(robot, swapped)
    assert (finding.cause, finding.decisive, more) == ("configurations", True, [])
    assert "configuration 2 fits 4, of 4 fits 2" in finding.message
    finding, *more = data_findings(robot, relative(swapped))
    assert (finding.cause, more) == ("configurations", [])
    assert "configuration 2 fits 4, of 4 fits 2" in finding.message


def test_a_configuration_that_nobody_stated():
    frf = exact()
    away = frf.mean_output.copy()
    away[2, 0] += 120.0 * np.deg2rad(166.0)
    finding, *_ = data_findings(two_joints(), replace(frf, mean_output=away))
    assert finding.cause == "configurations"
    assert "166 deg (shoulder in configuration 3)" in finding.message


@pytest.mark.parametrize(("off_m", "told"), [(0.005, False), (0.02, True)])
def test_a_linear_axis_is_placed_by_millimetres(off_m, told):
    # Two degrees, read as metres, would let 35 mm pass.
    rail = linear_axis()
    frf = exact(rail, np.array([[0.2], [0.7], [1.1], [1.6]]))
    away = frf.mean_output.copy()
    away[2, 0] += off_m * rail.motor_per_arm[0, 0]
    findings = data_findings(rail, replace(frf, mean_output=away))
    assert [finding.cause for finding in findings] == ["configurations"] * told
    assert not told or "20 mm (rail in configuration 3)" in findings[0].message


@pytest.mark.parametrize("factor", [1.0, 0.9, 1.03])
def test_the_ratio_of_a_linear_axis_is_told_over_decimetres(factor):
    rail = linear_axis()
    frf = exact(rail, 0.2 + np.array([[0.0], [0.04], [0.08], [0.3]]))
    findings = data_findings(with_ratio(rail, 0, 1 / factor), frf)
    assert [finding.cause for finding in findings] == ["gear_ratio"] * (factor != 1)


@pytest.mark.parametrize("factor", [0.9, 1.1, 1.03])
def test_a_gear_ratio_is_read_from_the_angles(factor):
    finding, *more = data_findings(two_joints(), exact(with_ratio(two_joints(), 0, factor)))
    assert (finding.cause, more) == ("gear_ratio", [])
    assert finding.message.startswith(f"shoulder: its mean angles are {factor:.4g} times")
    assert finding.decisive == (abs(factor - 1) > 0.05)


def test_a_gear_ratio_is_read_from_encoders_without_a_reference():
    frf = exact(with_ratio(two_joints(), 1, 1.1))
    frf = replace(frf, mean_output=frf.mean_output + np.array([400.0, -90.0]))
    assert causes(two_joints(), frf) == ["gear_ratio"]


def test_encoders_without_a_reference_are_noted_only():
    robot, frf = two_joints(), exact()
    findings, notes = evidence_findings(robot, gather_evidence(replace(frf, mean_output=frf.mean_output + 300.0)))
    assert findings == ()
    assert "as those of encoders without a reference do" in notes[0]
    findings, notes = evidence_findings(robot, gather_evidence(relative(frf)))
    assert findings == ()
    assert "cannot tell where the robot was" in notes[0]


def pendulum(mass_kg=5.0, payload_kg=2.0):
    """A motor that carries a point mass at 0.5 m and a payload at 0.8 m about a horizontal axis."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    link = Inertial(mass_kg, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3))
    motor = Motor(1e-3, 100.0, 300.0, 10.0, Friction(0.0, 0.02, 0.02, 1.0, 0.02))
    joint = Joint("swing", np.zeros(3), turn, link, -np.pi, np.pi, motor)
    spring = Spring("gear", 0, "transmission", np.array([0.0, 0.0, 1.0]), 1e6, 10.0)
    payload = Inertial(payload_kg, np.array([0.8, 0.0, 0.0]), 0.01 * np.eye(3)) if payload_kg else NO_PAYLOAD
    return Robot("pendulum", np.array([0.0, 0.0, -9.81]), (joint,), (spring,), payload)


def test_the_expected_torque_is_that_of_a_pendulum():
    # What holds a pendulum is m g l cos(q) over the gear ratio, here written out.
    angle = np.array([[-1.0], [0.2], [0.8]])
    held = 9.81 * (5.0 * 0.5 + 2.0 * 0.8) * np.cos(angle) / 100.0
    frf = replace(exact(pendulum(), angle), mean_input=held)
    assert causes(pendulum(), frf) == []
    assert causes(pendulum(), replace(frf, mean_input=1.2 * held)) != []
    light = data_findings(
        pendulum(payload_kg=0.5), replace(frf, response=exact(pendulum(payload_kg=0.5), angle).response)
    )
    assert light[0].cause in {"payload", "masses", "torque_constant"}  # one motor cannot tell them apart


def test_a_payload_is_weighed():
    finding, *more = data_findings(two_joints(), exact(heavier(two_joints(), 2.0)))
    assert (finding.cause, finding.decisive, more) == ("payload", False, [])
    weighed = float(finding.message.partition("a payload of ")[2].partition(" kg")[0])
    assert weighed == pytest.approx(6.0, rel=0.01)  # springs that the payload bends further are left out


@pytest.mark.parametrize(("factor", "decisive"), [(1.15, False), (0.7, True)])
def test_a_torque_constant_belongs_to_one_motor(factor, decisive):
    scale = np.array([1.0, factor])
    frf = exact()
    finding, *more = data_findings(two_joints(), replace(frf, mean_input=frf.mean_input * scale))
    assert (finding.cause, finding.decisive, more) == ("torque_constant", decisive, [])
    assert finding.message.startswith(f"elbow: its mean torques are {factor:.3g} times")


def test_friction_that_holds_a_part_of_the_weight_is_no_payload():
    robot, frf = two_joints(), exact()
    stuck = replace(frf, motion_rms=np.full_like(frf.motion_rms, 0.005))
    for sign in (1, -1):  # a robot that came to rest on the way up, or down
        held = stuck.mean_input + sign * 0.03 * np.sign(stuck.mean_input)
        assert causes(robot, replace(stuck, mean_input=held)) == []


def test_robots_without_weight_and_foreign_motors_are_left_alone():
    free = replace(two_joints(), gravity_m_s2=np.zeros(3))
    frf = exact(free)
    assert causes(free, replace(frf, mean_input=frf.mean_input + 0.05)) == []
    assert data_findings(two_joints(), replace(frf, input_channels=motor_channels(("a", "b"), "torque"))) == ()
    old = replace(exact(), mean_input=None, mean_output=None, motion_rms=None)
    assert data_findings(two_joints(), old) == ()


def test_a_response_of_noise_is_no_response():
    robot, frf = two_joints(), exact()
    generator = np.random.default_rng(3)
    noise = generator.standard_normal((2, *frf.response.shape)) / np.sqrt(2)

    def noisy(share):
        """Noise of some deviation over the response itself, and a covariance that says so."""
        level = share * np.abs(np.diagonal(frf.response, axis1=-2, axis2=-1)).mean(axis=(0, 1))
        covariance = np.broadcast_to(np.diag(level**2).astype(complex), (*frf.response.shape[:2], 2, 2))
        moved = frf.response + level[:, None] * (noise[0] + 1j * noise[1])
        return replace(frf, response=moved, noise_covariance=covariance, noise_degrees_of_freedom=1e6)

    assert causes(robot, noisy(0.01)) == []
    weak = data_findings(robot, noisy(0.6))
    assert {finding.cause for finding in weak} == {"excitation"}
    lost = [finding for finding in data_findings(robot, noisy(100.0)) if finding.cause == "excitation"]
    assert len(lost) == 2
    assert all(finding.decisive for finding in lost)


def test_evidence_of_single_configurations_joins():
    frf = exact()
    parts = [gather_evidence(frf.select([index])) for index in range(len(CONFIGURATIONS))]
    whole, joined = gather_evidence(frf), join_evidence(parts)
    for name in (
        "response",
        "clear",
        "mean_angle",
        "mean_torque",
        "motion_rms",
        "configurations",
        "driving",
        "lines_hz",
    ):
        np.testing.assert_array_equal(getattr(whole, name), getattr(joined, name))


def later(frf, delay_s):
    return replace(frf, response=frf.response * np.exp(-2j * np.pi * frf.frequency_hz * delay_s)[:, None, None])


@pytest.mark.parametrize("samples", [8, 24, 90])
def test_a_delay_is_read_from_the_phases(samples):
    robot = two_joints()
    finding, *more = data_findings(robot, later(exact(), samples * 1e-3))
    assert (finding.cause, more) == ("delay", [])
    assert finding.decisive == (samples * 1e-3 * FREQUENCY_HZ[-1] > 0.5)
    least = float(finding.message.partition("below ")[2].partition(" samples, where 0 are declared")[0])
    assert samples - 0.8 <= least <= samples  # ten degrees at the highest line
    assert data_findings(robot, later(exact(), samples * 1e-3), samples * 1e-3) == ()


def test_few_samples_of_delay_are_no_finding():
    for samples in (0, 1, 2, 3):
        assert data_findings(two_joints(), later(exact(), samples * 1e-3)) == ()


def test_a_delay_hides_no_reversed_torque():
    assert set(causes(two_joints(), later(torque_reversed(exact(), 1), 0.024))) == {"delay", "torque_sign"}


@cache
def simulated(seed, *, friction=1.0, rms=8.0):
    """The small arm in closed loop with noise and friction in five random configurations, and its robot file."""
    loaded = load_experiment(Path(__file__).parents[3] / "stages/small.yaml")
    campaign = loaded.experiment.campaigns["estimation"]
    robot, controller = loaded.robot.to_robot(), loaded.robot.controller
    options = campaign.source.simulate
    options = replace(options, seed=seed, truth=replace(options.truth, seed=seed))
    lines, detection = choose_lines(campaign.excitation, controller.sampling_period_s)
    generator = np.random.default_rng(seed)
    level = rms * np.sqrt(2 / lines.size)
    phases = generator.uniform(0, 2 * np.pi, (1, 2, lines.size))
    samples = round(campaign.excitation.period_s / controller.sampling_period_s)
    true = true_robot(robot, options.truth)
    laws = [joint.motor.friction for joint in true.joints]
    laws = [replace(law, coulomb_nm=friction * law.coulomb_nm, static_nm=friction * law.static_nm) for law in laws]
    joints = [
        replace(joint, motor=replace(joint.motor, friction=law)) for joint, law in zip(true.joints, laws, strict=True)
    ]
    experiment = SimulatedExperiment(
        robot=replace(true, joints=tuple(joints)),
        controller=controller,
        options=options,
        reference=time_signal(multisine(np.full((2, lines.size), level), phases), lines, samples),
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=detection,
        periods=2,
    )
    angles = generator.uniform(0.8 * robot.lower, 0.8 * robot.upper, (5, 2))
    plain = EstimateOptions(compensation="none")
    frfs = [estimate_frf(simulate(experiment, angle, index), plain) for index, angle in enumerate(angles)]
    return robot, join(frfs, ["arm"] * 5)


@pytest.mark.parametrize(("seed", "friction", "rms"), [(1, 1.0, 8.0), (2, 2.5, 8.0), (3, 1.0, 1.0), (4, 0.0, 20.0)])
def test_a_sound_simulated_arm_gives_no_finding(seed, friction, rms):
    robot, frf = simulated(seed, friction=friction, rms=rms)
    assert data_findings(robot, frf) == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_mistakes_with_a_simulated_arm_are_named(seed):
    robot, frf = simulated(seed)
    assert causes(robot, torque_reversed(frf, 1)) == ["torque_sign"]
    assert causes(robot, torque_reversed(frf, 0)) == ["torque_sign"]
    assert causes(robot, angle_reversed(frf, 1)) == ["angle_sign"]
    assert causes(robot, replace(frf, configurations=frf.configurations[[1, 0, 2, 3, 4]])) == ["configurations"]
    assert causes(with_ratio(robot, 1, 1 / 1.1), frf) == ["gear_ratio"]


def test_means_are_those_of_the_record():
    _, frf = simulated(1)
    robot = simulated(1)[0]
    held = solve_statics(build_model(robot), frf.configurations).motor_torque
    assert frf.mean_input == pytest.approx(held, abs=0.03)  # some per cent of the friction's 0.24 N m
    assert frf.mean_output == pytest.approx(frf.configurations @ robot.motor_per_arm.T, abs=0.05)
    # The injected speed of 8 rad/s RMS lies at 4 to 80 Hz.
    assert np.all((frf.motion_rms > 8 / (2 * np.pi * 80)) & (frf.motion_rms < 8 / (2 * np.pi * 4)))


@pytest.mark.parametrize(("share", "decisive"), [(0.01, False), (0.12, True)])
def test_saturated_signals_are_doubted_by_how_far_they_may_be_off(share, decisive):
    frf = exact()
    shares = np.zeros((len(CONFIGURATIONS), 2))
    shares[2, 1] = share
    clipped = replace(frf, saturated_inputs=shares, saturated_outputs=0 * shares)
    (finding,) = data_findings(two_joints(), clipped)
    assert (finding.cause, finding.decisive) == ("saturation", decisive)
    assert finding.message.startswith(f"{frf.input_names[1]}: torque saturates for")
    assert finding.strength > 1
    parts = [gather_evidence(clipped.select([index])) for index in range(4)]
    assert evidence_findings(two_joints(), join_evidence(parts))[0] == (finding,)
    assert data_findings(two_joints(), replace(clipped, saturated_inputs=0 * shares)) == ()
    # One clipped sensor is named alone, although the responses from all motors are off.
    (finding,) = data_findings(two_joints(), replace(clipped, saturated_inputs=0 * shares, saturated_outputs=shares))
    assert finding.message.startswith(f"{frf.output_names[1]}: ")
    assert "torque" not in finding.message


def leaning(robot, lean_deg):
    """Mean torques of a robot whose base leans in the plane of its arm."""
    lean = np.deg2rad(lean_deg)
    gravity = 9.81 * np.array([-np.sin(lean), 0.0, -np.cos(lean)])
    return solve_statics(build_model(replace(robot, gravity_m_s2=gravity)), CONFIGURATIONS).motor_torque


@pytest.mark.parametrize("lean_deg", [3.0, 8.0])
def test_a_base_that_leans_is_measured_though_a_planar_arm_feels_one_of_both_ways(lean_deg):
    finding, *more = data_findings(two_joints(), replace(exact(), mean_input=leaning(two_joints(), lean_deg)))
    assert (finding.cause, more) == ("model", [])
    told = float(finding.message.partition("leans by ")[2].split()[0])
    assert told == pytest.approx(lean_deg, rel=0.05)


@pytest.mark.parametrize("lean_deg", [30.0, 60.0, 150.0])
def test_nobody_is_told_of_a_lean_that_nobody_overlooks(lean_deg):
    findings = data_findings(two_joints(), replace(exact(), mean_input=leaning(two_joints(), lean_deg)))
    assert findings
    assert not [finding.message for finding in findings if "leans" in finding.message]


def test_no_mass_is_told_that_cannot_be():
    heavy = exact(heavier(two_joints(), 60.0)).mean_input  # more than the arm itself, of 32 kg
    findings = data_findings(two_joints(), replace(exact(), mean_input=heavy))
    assert findings
    assert not [finding.message for finding in findings if "carry a payload" in finding.message]
    assert not [
        finding.message
        for finding in findings
        if "times the mass" in finding.message and float(finding.message.partition("carry ")[2].split()[0]) > 3
    ]


def test_a_reversed_angle_that_nothing_distinguishes_from_a_torque_is_named_too():
    drive = two_mass_robot()
    frf = relative(exact(drive, np.zeros((1, 1))))
    for turned in (torque_reversed, angle_reversed):
        (finding,) = data_findings(drive, turned(frf, 0))
        assert "F001" in finding.sentence
        assert "F002" in finding.sentence
    for finding in data_findings(two_joints(), torque_reversed(exact(), 1)):
        assert "F002" not in finding.sentence
