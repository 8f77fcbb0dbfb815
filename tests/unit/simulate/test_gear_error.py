"""Transmission errors: virtual work, energy, a differential equation, statics, and nothing where there are none."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch
from scipy.integrate import solve_ivp

from elastic_loops import CONFIGURATION, experiment
from exact_systems import linear_axis, two_joint_robot, two_mass_robot, with_arm_friction
from robid.errors import DataError
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.simulate.engine import Followers, rest_of, true_model
from robid.simulate.experiment import simulate
from robid.simulate.gear_error import GearErrors
from robid.simulate.options import Controller, Imperfections, SimulateOptions

ERRORS = Imperfections(
    transmission_error_rad=(4e-3, 0.0, 2e-3),
    transmission_error_phase_rad=(0.3,),
    gear_error_rad=3e-3,
    gear_error_order=0.4,
    gear_error_phase_rad=-1.0,
)
PERIOD_S = 2.5e-4


def error_of(joint, angle):
    """The error of a joint's gear and its derivative, as `ERRORS` say."""
    waves = ((1, 4e-3, 0.3), (3, 2e-3, 0.0), (0.4, 3e-3, -1.0))
    error = sum(size * np.sin(order * angle + phase + joint) for order, size, phase in waves)
    return error, sum(size * order * np.cos(order * angle + phase + joint) for order, size, phase in waves)


def still(robot, ratios=(12.0, -10.0)):
    """A robot without gravity and dampers, gears of low ratio and a coupling."""
    springs = tuple(replace(spring, damping=0.0) for spring in robot.springs)
    joints = tuple(
        replace(joint, motor=replace(joint.motor, gear_ratio=ratio))
        for joint, ratio in zip(robot.joints, ratios, strict=True)
    )
    joints = (joints[0], replace(joints[1], couplings={joints[0].name: 0.04}))
    return replace(robot, springs=springs, joints=joints, gravity_m_s2=np.zeros(3))


def model_of(robot, flaws, controller=None, steps=1):
    options = SimulateOptions(imperfections=flaws, steps_per_sample=steps)
    return true_model(robot, controller or Controller(sampling_period_s=PERIOD_S), options, sensors=False)


def potential(model, flaws, position):
    """Energy of all springs, by each law's integral."""
    total = 0.0
    for spring, row in zip(model.robot.springs, model.deflection, strict=True):
        bend = float(row @ position)
        if spring.place == "transmission":
            if flaws.transmission_error_rad:
                bend += error_of(spring.joint, position[model.motor[spring.joint]])[0]
            bend = np.sign(bend) * max(abs(bend) - flaws.backlash_rad / 2, 0.0)
            total += 0.5 * flaws.one_sided * np.sign(bend) * spring.stiffness * bend**2
        total += 0.5 * spring.stiffness * bend**2 + 0.25 * spring.cubic * bend**4
    return total


@pytest.mark.parametrize(
    "more",
    [{}, {"stiffening_1_rad2": 400.0}, {"backlash_rad": 0.01}, {"one_sided": 0.3, "backlash_rad": 0.004}],
)
def test_torques_are_the_gradient_of_the_energy(more):
    flaws = replace(ERRORS, **more)
    model = model_of(still(two_joint_robot()), flaws)
    batch, generator = Batch(model.mujoco, 1, nthread=1), np.random.default_rng(3)
    errors, data = GearErrors(model, batch, flaws, PERIOD_S), mujoco.MjData(model.mujoco)
    for _ in range(5):
        position = 0.02 * generator.standard_normal(model.mujoco.nv)
        position[model.motor] += generator.uniform(-5, 5, 2)
        position[model.arm] += model.robot.arm_per_motor @ position[model.motor]
        batch.qpos[:], batch.qfrc_applied[:], data.qpos[:] = position, 0.0, position
        errors.follow()
        mujoco.mj_forward(model.mujoco, data)
        steps = 1e-6 * np.eye(position.size)
        gradient = [
            (potential(model, flaws, position + step) - potential(model, flaws, position - step)) / 2e-6
            for step in steps
        ]
        found = data.qfrc_passive + batch.qfrc_applied[0]
        np.testing.assert_allclose(found, -np.array(gradient), rtol=1e-5, atol=1e-5 * np.abs(gradient).max())


def energy_drift(period_s, *, on_motors=True):
    """Energy that a moving robot gains, over the share that the errors change of it."""
    model = build_model(still(two_joint_robot()), timestep_s=2.5e-5)
    batch, mass = Batch(model.mujoco, 1, nthread=1), np.zeros((model.mujoco.nv,) * 2)
    data, errors = mujoco.MjData(model.mujoco), GearErrors(model, batch, ERRORS, period_s)
    speed = np.array([6.0, -9.0])
    batch.qvel[:, model.motor] = speed
    batch.qvel[:, model.arm] = model.robot.arm_per_motor @ speed

    def energy():
        data.qpos[:] = batch.qpos[0]
        mujoco.mj_forward(model.mujoco, data)
        mujoco.mj_fullM(model.mujoco, data, mass)
        return 0.5 * batch.qvel[0] @ mass @ batch.qvel[0] + potential(model, ERRORS, batch.qpos[0])

    before, worst = energy(), 0.0
    for _ in range(round(0.3 / period_s)):
        batch.qfrc_applied[:] = 0.0
        errors.follow()
        if not on_motors:
            _, slope = error_of(np.arange(2), batch.qpos[0, model.motor])
            gear = model.deflection[:2] @ batch.qpos[0] + error_of(np.arange(2), batch.qpos[0, model.motor])[0]
            stiffness = np.array([spring.stiffness for spring in model.robot.springs[:2]])
            batch.qfrc_applied[:, model.motor] += stiffness * gear * slope
        batch.step(nstep=round(period_s / 2.5e-5))
        worst = max(worst, abs(energy() - before))
    return worst / (potential(model, ERRORS, np.zeros(model.mujoco.nv)))


def test_a_moving_robot_keeps_its_energy():
    coarse, fine = energy_drift(1e-3), energy_drift(2.5e-4)
    assert fine < 2e-3
    assert fine < coarse / 2.5
    assert energy_drift(2.5e-4, on_motors=False) > 10 * fine


@pytest.mark.parametrize("hysteresis", [0.0, 0.3])
def test_an_uneven_drive_is_its_differential_equation(hysteresis):
    # Small parts of a sample, so that what is kept over one leaves little.
    period_s, ratio, stiffness, damping, share = 5e-5, 8.0, 900.0, 0.6, 100.0
    plain = two_mass_robot(5e-4, 0.04, stiffness, damping, ratio)
    robot = with_arm_friction(plain, 0.05)
    flaws = replace(ERRORS, hysteresis_nm=hysteresis, stiffening_1_rad2=share)
    model = model_of(robot, flaws, Controller(sampling_period_s=period_s))
    batch = Batch(model.mujoco, 1, nthread=1)
    followers, torque, end_s = Followers(model, batch, Controller(sampling_period_s=period_s), flaws), 0.3, 0.4
    start = np.array([0.0, 0.0, 30.0, 30.0 / ratio, 0.0])
    batch.qvel[:, [model.motor[0], model.arm[0]]] = start[2:4]
    times = np.arange(round(end_s / period_s)) * period_s
    found = []
    for time in times:
        found.append([batch.qpos[0, model.motor[0]], batch.qpos[0, model.arm[0]]])
        batch.ctrl[:, 0] = torque * np.cos(20 * (time + period_s / 2))
        followers.follow()
        batch.step()

    def rates(time, state):
        motor, arm, motor_rate, arm_rate, bristle = state
        error, slope = error_of(0, motor)
        bend, rate = motor / ratio - arm + error, motor_rate * (1 / ratio + slope) - arm_rate
        gear = stiffness * bend * (1 + share * bend**2) + damping * rate + 0.1 * stiffness * bristle
        slip = abs(rate) * bristle * 0.1 * stiffness / hysteresis if hysteresis else 0.0
        motor_gain = (torque * np.cos(20 * time) - gear * (1 / ratio + slope)) / 5e-4
        return [motor_rate, arm_rate, motor_gain, (gear - 0.05 * arm_rate) / 0.04, bool(hysteresis) * (rate - slip)]

    wanted = solve_ivp(rates, (0, end_s), start, t_eval=times, method="LSODA", rtol=1e-9, atol=1e-12).y[:2].T
    swing = np.abs(wanted[:, 0] / ratio - wanted[:, 1]).max()
    away = np.array(found) - wanted
    assert swing > 5e-3
    assert np.ptp(wanted[:, 0]) > 5
    assert np.abs(away[:, 0] / ratio - away[:, 1]).max() < (2e-3 if hysteresis else 1e-4) * swing
    assert np.abs(away).max() < 3e-5 * np.ptp(wanted[:, 0])


def test_a_loaded_arm_rests_where_its_gears_bend_as_they_must():
    robot = two_joint_robot()
    model = model_of(robot, ERRORS)
    plain, rest = solve_statics(model, CONFIGURATION[None]), rest_of(model, CONFIGURATION, ERRORS)
    error, slope = error_of(np.arange(2), rest.position[0, model.motor])
    np.testing.assert_allclose((rest.position - plain.position)[0, model.arm], error, rtol=1e-9)
    load = np.array([spring.stiffness for spring in robot.springs[:2]]) * plain.deflection[0, :2]
    np.testing.assert_allclose((rest.motor_torque - plain.motor_torque)[0], slope * load, rtol=1e-9)
    batch = Batch(model.mujoco, 1, nthread=1)
    batch.qpos[:], batch.ctrl[:, :2] = rest.position, rest.motor_torque
    GearErrors(model, batch, ERRORS, PERIOD_S).follow()
    data = mujoco.MjData(model.mujoco)
    data.qpos[:], data.ctrl[:2], data.qfrc_applied[:] = rest.position[0], rest.motor_torque[0], batch.qfrc_applied[0]
    mujoco.mj_forward(model.mujoco, data)
    pull = data.qfrc_passive + data.qfrc_applied + data.qfrc_actuator - data.qfrc_bias
    # The arm's own turn by its gear's error moves its weight a little.
    assert np.abs(pull).max() < 0.01 * np.abs(data.qfrc_applied).max()
    assert np.abs(data.qfrc_applied).max() > 0.03 * np.abs(load).max()


def slow(robot, flaws, size=1.0):
    """A drive that swings slowly, its controller told a position."""
    run = experiment(robot, period_s=2.0, count=4, inject="position_reference", imperfections=flaws)
    wave = size * np.sin(2 * np.pi * np.arange(2000) / 2000)
    return replace(
        run,
        reference=wave[None, None, :, None],
        options=replace(run.options, steps_per_sample=4, transient_periods=2),
        excited_lines=np.array([1]),
        outputs=("drive.arm",),
        periods=2,
    )


def test_a_slow_motions_deflection_is_torque_over_stiffness_and_the_error():
    ratio, stiffness, viscous, inertia = 50.0, 900.0, 1.5, 0.3
    robot = with_arm_friction(two_mass_robot(2e-3, inertia, stiffness, 1.0, ratio), viscous)
    record = simulate(slow(robot, ERRORS, 40.0), np.zeros(1), 0)
    motor, arm = (record.outputs + record.output_offset[:, None, None, None, None])[0, 0, 0, -1].T
    error = error_of(0, motor)[0]
    omega = 2 * np.pi * np.fft.rfftfreq(motor.size, 1e-3)
    spectrum = np.fft.rfft(np.column_stack([arm, motor / ratio - arm + error]), axis=0)
    spectrum[omega > 2 * np.pi * 60] = 0.0
    torque = np.fft.irfft((viscous * 1j * omega - inertia * omega**2) * spectrum[:, 0])
    seen = np.fft.irfft((stiffness + 1.0 * 1j * omega) * spectrum[:, 1])
    assert np.std(seen - torque) < 0.01 * stiffness * np.std(error)
    bend = stiffness * (motor / ratio - arm)
    assert np.std(bend - bend.mean() - torque) > 0.5 * stiffness * np.std(error)


def test_a_period_repeats():
    run = experiment(rms=5.0, transient_periods=1, imperfections=Imperfections(transmission_error_rad=(1e-4,)))
    run = replace(run, periods=2, outputs=("elbow.arm",))
    first, second = simulate(run, CONFIGURATION, 0).outputs[0, 0, 0]
    assert np.abs(second - first).std(axis=0).max() < 1e-3 * first.std(axis=0).min()


def test_without_errors_nothing_is_applied_and_no_bit_changes():
    none = Imperfections(
        transmission_error_rad=(0.0, 0.0),
        transmission_error_phase_rad=(1.0,),
        gear_error_order=0.4,
        gear_error_phase_rad=2.0,
    )
    run = replace(experiment(rms=5.0), outputs=("elbow.arm",))
    plain = simulate(run, CONFIGURATION, 0)
    found = simulate(replace(run, options=replace(run.options, imperfections=none)), CONFIGURATION, 0)
    np.testing.assert_array_equal(found.inputs, plain.inputs)
    np.testing.assert_array_equal(found.outputs, plain.outputs)
    sliding = build_model(linear_axis())
    assert not GearErrors(sliding, Batch(sliding.mujoco, 1, nthread=1), ERRORS, PERIOD_S).any


def test_errors_that_pass_in_few_samples_are_refused():
    run = experiment(rms=50.0, imperfections=Imperfections(gear_error_rad=1e-5, gear_error_order=60.0))
    with pytest.raises(DataError, match=r"D650 .*`shoulder`"):
        simulate(run, CONFIGURATION, 0)


def test_bristles_beside_a_gear_are_dahls_element():
    # Masses that nothing moves: the motor turns at its speed, the arm stays.
    stiffness, slip_nm = 900.0, 2.0
    robot = two_mass_robot(1e6, 1e6, stiffness, 0.0)
    model = model_of(robot, Imperfections(hysteresis_nm=slip_nm), Controller(sampling_period_s=1e-4))
    batch = Batch(model.mujoco, 1, nthread=1)
    reach = 10 * slip_nm / stiffness  # where the bristles slip: they are a tenth as stiff
    path = []
    for speed in (1.0, -1.0):
        batch.qvel[:, model.motor] = speed
        for _ in range(round(8 * reach / 1e-4)):
            path.append([float(model.deflection[0] @ batch.qpos[0]), slip_nm / reach * batch.act[0, 0]])
            batch.step()
    bend, torque = np.array(path).T
    turn = len(path) // 2
    np.testing.assert_allclose(torque[:turn], slip_nm * (1 - np.exp(-bend[:turn] / reach)), atol=5e-3 * slip_nm)
    back = bend[turn] - bend[turn:]
    np.testing.assert_allclose(torque[turn:], slip_nm * (2 * np.exp(-back / reach) - 1), atol=1e-2 * slip_nm)
