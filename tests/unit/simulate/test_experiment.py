"""The closed loop against the analytic response, its refusals, and what must not change its bits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from elastic_loops import CONFIGURATION, PLAIN, analytic, diagonal, experiment
from exact_systems import sensed_everywhere, springs_everywhere, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.robot.friction import Friction
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.settings.load import load_robot
from robid.simulate.controller import Cascade, angle_reference, frequency_response
from robid.simulate.drives import encoder_readings
from robid.simulate.experiment import simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions, Truth
from robid.simulate.truth import true_robot

ROBOT_FILE = Path(__file__).parents[3] / "configs" / "robots" / "kr300.yaml"


@pytest.fixture(scope="module")
def plain_record():
    return simulate(experiment(), CONFIGURATION, 0)


def test_kr300_in_closed_loop_is_the_analytic_response():
    robot = load_robot(ROBOT_FILE).to_robot()
    run = experiment(robot, period_s=4.0, rms=20.0, count=60, transient_periods=1)
    configuration = np.deg2rad([10.0, -80.0, 60.0, 20.0, 40.0, -30.0])
    frf = estimate_frf(simulate(run, configuration, 0), PLAIN)
    exact = analytic(robot, configuration, frf.frequency_hz, run.controller)
    error = np.abs(diagonal(frf.response) / diagonal(exact) - 1)
    assert np.median(error) < 5e-4
    assert error.max() < 0.05


def test_springs_everywhere_in_closed_loop_are_the_analytic_response():
    run = experiment(springs_everywhere(), rms=2.0, transient_periods=3)
    record = simulate(run, CONFIGURATION, 0)
    np.testing.assert_allclose(record.output_offset[0] @ run.robot.arm_per_motor.T, CONFIGURATION)
    frf = estimate_frf(record, PLAIN)
    exact = analytic(run.robot, CONFIGURATION, frf.frequency_hz, run.controller)
    assert np.median(np.abs(diagonal(frf.response) / diagonal(exact) - 1)) < 1e-5


@pytest.mark.parametrize("steps", [1, 3])
def test_sensors_in_closed_loop_are_the_analytic_response(steps):
    outputs = ("elbow.arm", "tip", "felt")
    run = experiment(sensed_everywhere(), rms=0.5, transient_periods=3, steps_per_sample=steps)
    record = simulate(replace(run, outputs=outputs), CONFIGURATION, 0)
    assert record.output_names == ("shoulder", "elbow", *outputs)
    assert [(one.quantity, one.unit, one.side) for one in record.output_channels] == [
        ("angle", "rad", "motor"),
        ("angle", "rad", "motor"),
        ("angle", "rad", "arm"),
        ("position", "m", "tool"),
        ("acceleration", "m/s^2", "tool"),
    ]
    frf = estimate_frf(record, PLAIN)
    exact = analytic(run.robot, CONFIGURATION, frf.frequency_hz, run.controller, record.output_names, frf.output_rates)
    error = np.abs(frf.response / exact - 1)[0].max(axis=-1)
    assert np.median(error[:, :4]) < 1e-4
    assert np.median(error[:, 4]) < 1e-4
    plain = simulate(run, CONFIGURATION, 0)
    np.testing.assert_allclose(record.outputs[..., :2], plain.outputs, atol=1e-9)


def test_noise_of_the_sensors_is_theirs_alone():
    run = replace(experiment(sensed_everywhere(), rms=0.5), outputs=("elbow.arm", "tip", "felt"))
    flaws = Imperfections(link_encoder_noise_rad=1e-4, tracker_noise_m=1e-3, accelerometer_noise_m_s2=0.1)
    noisy = simulate(replace(run, options=SimulateOptions(imperfections=flaws)), CONFIGURATION, 0)
    difference = noisy.outputs - simulate(run, CONFIGURATION, 0).outputs
    assert not difference[..., :2].any()
    np.testing.assert_allclose(difference[..., 2:].std(axis=(0, 1, 2, 3, 4)), [1e-4, 1e-3, 0.1], rtol=0.05)


@pytest.mark.parametrize("inject", ["speed_reference", "position_reference", "torque"])
def test_every_injection_gives_the_same_response(inject):
    rms = {"speed_reference": 5.0, "position_reference": 0.1, "torque": 0.3}[inject]
    run = experiment(rms=rms, inject=inject)
    frf = estimate_frf(simulate(run, CONFIGURATION, 0), PLAIN)
    exact = analytic(run.robot, CONFIGURATION, frf.frequency_hz, run.controller)
    assert np.median(np.abs(diagonal(frf.response) / diagonal(exact) - 1)) < 5e-4


def test_error_of_the_response_falls_with_the_square_of_the_amplitude():
    # What is left at a large amplitude is the arm's own geometry, which is odd around a configuration.
    errors = []
    for rms in (80.0, 40.0):
        run = experiment(rms=rms)
        frf = estimate_frf(simulate(run, CONFIGURATION, 0), PLAIN)
        exact = estimate_frf(simulate(experiment(rms=0.5), CONFIGURATION, 0), PLAIN).response
        errors.append(np.median(np.abs(diagonal(frf.response) / diagonal(exact) - 1)))
    assert 1.0 < np.log2(errors[0] / errors[1]) < 3.0


def test_halving_the_step_changes_little(plain_record):
    fine = simulate(experiment(steps_per_sample=2), CONFIGURATION, 0)
    coarse, finer = (diagonal(estimate_frf(record, PLAIN).response) for record in (plain_record, fine))
    assert np.median(np.abs(coarse / finer - 1)) < 1e-3
    assert not np.array_equal(coarse, finer)


def test_a_wrong_torque_constant_or_sign_is_in_the_record_alone(plain_record):
    truth = Truth(torque_constant_factor={"shoulder": 1.25}, reversed_torque=("elbow",))
    record = simulate(experiment(truth=truth), CONFIGURATION, 0)
    np.testing.assert_array_equal(record.outputs, plain_record.outputs)
    np.testing.assert_allclose(record.inputs, plain_record.inputs * [0.8, -1.0])


def test_a_counterbalance_in_closed_loop_is_in_statics_and_response():
    truth = Truth(counterbalance_nm={"shoulder": (270.0, -480.0)})
    robot, plain = true_robot(two_joint_robot(), truth), two_joint_robot()
    run = experiment(robot, rms=0.5, transient_periods=3)
    record = simulate(run, CONFIGURATION, 0)
    frf = estimate_frf(record, PLAIN)
    exact, without = (analytic(each, CONFIGURATION, frf.frequency_hz, run.controller) for each in (robot, plain))
    errors = [np.median(np.abs(diagonal(frf.response) / diagonal(each) - 1)) for each in (exact, without)]
    assert errors[0] < 1e-4
    assert errors[1] > 1e-3
    models = build_model(robot, balanced=True), build_model(plain)
    rests = [solve_statics(model, CONFIGURATION[None]) for model in models]
    np.testing.assert_allclose(record.inputs.mean(axis=(0, 1, 2, 3, 4)), rests[0].motor_torque[0], rtol=1e-3)
    angle = rests[0].position[0, models[0].arm[0]]
    taken = (rests[1].motor_torque - rests[0].motor_torque)[0, 0] * robot.gear_ratio[0]
    assert taken == pytest.approx(270 * np.sin(angle) - 480 * np.cos(angle), rel=0.02)


def test_dampers_that_grow_with_load_are_the_linear_ones_at_rest():
    robot = replace(two_joint_robot(), rotor="spong")
    model = build_model(robot)
    rest = np.abs(solve_statics(model, CONFIGURATION[None]).deflection[0])
    growth = 0.5 / rest[1]
    gears = [spring.place == "transmission" for spring in robot.springs]
    loaded = np.where(gears, 1 + growth * rest, 1.0)
    springs = tuple(replace(s, damping=s.damping * f) for s, f in zip(robot.springs, loaded.tolist(), strict=True))
    flaws = Imperfections(load_damping_1_rad=float(growth))
    run = experiment(robot, rms=0.2, transient_periods=3, imperfections=flaws)
    frf = estimate_frf(simulate(run, CONFIGURATION, 0), PLAIN)
    wanted, plain = (
        analytic(each, CONFIGURATION, frf.frequency_hz, run.controller)
        for each in (replace(robot, springs=springs), robot)
    )
    errors = [np.median(np.abs(diagonal(frf.response) / diagonal(each) - 1)) for each in (wanted, plain)]
    assert errors[0] < 1e-3
    assert errors[1] > 5 * errors[0]


@pytest.mark.parametrize("law", ["tanh", "stribeck"])
def test_friction_without_memory_hardly_depends_on_the_step(law):
    robot = two_joint_robot()
    friction = Friction(0.002, 0.3, 0.4, 2.0, 0.05)
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=friction)) for joint in robot.joints)
    robot = replace(robot, joints=joints)
    flaws = Imperfections(friction=law)
    coarse, fine, none = (
        simulate(experiment(robot, imperfections=flaw, steps_per_sample=steps), CONFIGURATION, 0)
        for flaw, steps in ((flaws, 2), (flaws, 4), (Imperfections(), 2))
    )
    size = np.abs(coarse.inputs - none.inputs).max()
    assert size > 0.2
    assert np.sqrt(np.mean((coarse.inputs - fine.inputs) ** 2)) < 2e-3 * size


def test_records_hold_what_the_controller_did(plain_record):
    run = experiment()
    spectra = [
        np.fft.rfft(x[0, 0, :, 0], axis=1)[:, run.excited_lines] for x in (plain_record.inputs, plain_record.outputs)
    ]
    reference = np.fft.rfft(plain_record.reference[0, 0], axis=1)[:, run.excited_lines]
    omega = 2 * np.pi * run.excited_lines / plain_record.period_s
    forward, back = frequency_response(run.controller, run.robot.motor_inertia_kgm2, omega)
    wanted = forward * reference - back * spectra[1]
    # One transient period leaves the slow position loop's last motion in the record.
    assert np.median(np.abs(spectra[0] - wanted) / np.abs(spectra[0])) < 1e-3


def test_same_bits_with_any_number_of_threads():
    flaws = Imperfections(encoder_noise_rad=1e-5, torque_noise_nm=0.05, friction="lugre", ripple=True)
    run = experiment(period_s=0.5, count=8, imperfections=flaws)
    one, two = simulate(run, CONFIGURATION, 3, threads=1), simulate(run, CONFIGURATION, 3, threads=2)
    np.testing.assert_array_equal(one.inputs, two.inputs)
    np.testing.assert_array_equal(one.outputs, two.outputs)


def test_noise_is_seeded_by_configuration_and_campaign():
    flaws = Imperfections(encoder_noise_rad=1e-5)
    run = experiment(period_s=0.2, count=4, imperfections=flaws)
    first = simulate(run, CONFIGURATION, 0).outputs
    np.testing.assert_array_equal(first, simulate(run, CONFIGURATION, 0).outputs)
    assert not np.array_equal(first, simulate(run, CONFIGURATION, 1).outputs)
    reseeded = replace(run, options=replace(run.options, seed=2))
    assert not np.array_equal(first, simulate(reseeded, CONFIGURATION, 0).outputs)


def test_explosion_is_refused_and_leaves_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    run = experiment(with_spring_factors(two_joint_robot(), 1e6, 1e6), period_s=0.2, count=4)
    with pytest.raises(DataError, match=r"configuration 8 at \[ 17.2 -45.8\] deg: D217 the simulation blew up"):
        simulate(run, CONFIGURATION, 7)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "flaws",
    [
        {"friction": "lugre"},
        {"friction": "lugre", "load_friction": 0.1},
        {"friction": "tanh", "friction_asymmetry": 0.3},
        {"ripple": True},
        {"second_ripple_nm": 0.05},
        {"load_damping_1_rad": 1e3},
        {"stiffening_1_rad2": 1e6},
        {"one_sided": 0.1},
        {"backlash_rad": 2e-5},
        {"hysteresis_nm": 1.0},
        {"unmodelled_payload_kg": 2.0},
        {"encoder_noise_rad": 1e-4},
        {"encoder_resolution_rad": 1e-3},
        {"torque_noise_nm": 0.1},
        {"resolver_error_rad": 5e-3},
    ],
    ids=lambda flaws: list(flaws)[-1],
)
def test_every_imperfection_acts(flaws):
    # Without gravity, whose load would keep every gear on one flank of its backlash.
    robot = replace(two_joint_robot(), gravity_m_s2=np.zeros(3))
    law = {"coulomb_nm": 0.2, "static_nm": 0.25, "presliding_rad": 0.05}
    motors = [
        replace(joint.motor, ripple_nm=0.05, friction=replace(joint.motor.friction, **law)) for joint in robot.joints
    ]
    joints = tuple(replace(joint, motor=motor) for joint, motor in zip(robot.joints, motors, strict=True))
    run = experiment(replace(robot, joints=joints), period_s=0.5, count=8)
    without = [{key: value for key, value in flaws.items() if key == "friction" and len(flaws) > 1}, flaws]
    clean, torque = (
        simulate(
            replace(run, options=replace(run.options, imperfections=Imperfections(**each))), CONFIGURATION, 0
        ).inputs
        for each in without
    )
    assert np.sqrt(np.mean((torque - clean) ** 2)) > 1e-3 * clean.std()


def test_encoder_shows_resolver_error_noise_and_steps():
    angle = np.linspace(-4, 4, 101)
    flaws = Imperfections(encoder_resolution_rad=0.1, resolver_error_rad=0.5, resolver_order=2)
    shown = encoder_readings(angle, np.full(101, 0.3), flaws)
    np.testing.assert_allclose(shown, np.round(10 * (angle + 0.3 + 0.5 * np.sin(2 * angle))) / 10, atol=1e-12)
    np.testing.assert_array_equal(encoder_readings(angle, np.zeros(101), Imperfections()), angle)


def test_torque_stays_within_the_limit():
    robot = two_joint_robot()
    run = experiment(rms=400.0, period_s=0.5, count=8)
    torque = simulate(run, CONFIGURATION, 0).inputs
    limit = np.array([joint.motor.max_torque_nm for joint in robot.joints])
    np.testing.assert_allclose(np.abs(torque).max(axis=(0, 1, 2, 3, 4)), limit, rtol=1e-12)


def test_cascade_is_its_frequency_response():
    controller, inertia = Controller(), np.array([8e-4])
    n_sample = 4000
    time = np.arange(n_sample) * controller.sampling_period_s
    omega = 2 * np.pi * 5.0
    angle, speed = 0.2 * np.sin(omega * time + 0.4), 3.0 * np.cos(omega * time)
    reference = angle_reference(speed[:, None], controller.sampling_period_s)[:, 0]
    cascade = Cascade(controller, inertia, np.array([1e6]), np.array([[angle[-1]]]), np.zeros(1))
    for _ in range(2):
        torque = np.array(
            [cascade.command(np.array([[a]]), np.array([[r]]), np.array([[v]]))[0, 0]
             for a, r, v in zip(angle, reference, speed, strict=True)]
        )  # fmt: skip
    line = 20
    found, measured, injected = (np.fft.rfft(x)[line] for x in (torque, angle, speed))
    forward, back = frequency_response(controller, inertia, np.array([omega]))
    np.testing.assert_allclose(found, forward[0, 0] * injected - back[0, 0] * measured, rtol=1e-6)
