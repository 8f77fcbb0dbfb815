"""Exciting trajectories: at rest at their ends, within limits, better than chance, and true to what a robot does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import linear_axis
from rigid_robots import random_chain, with_gears
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.trajectory.design import design_trajectory, random_trajectory, trajectory_problem
from robid.design.excitation.trajectory.limits import Limits, resting_series
from robid.design.excitation.trajectory.problem import BaseModel, Criterion
from robid.errors import SettingsError
from robid.robot.reach import Reach, Shapes
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from robid.simulate.controller import angle_reference
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from tolerances import FINITE_DIFFERENCE, IDENTITY

ROBOT_FILE = Path(__file__).parents[3] / "stages" / "rigid_arm.yaml"
STEP_S = 1e-3
OPTIONS = TrajectoryOptions(period_s=4.0, starts=1, evaluations=100, torque_share=0.7)
REST = np.deg2rad([[20.0, 30.0]])


@pytest.fixture(scope="module")
def arm():
    return load_robot(ROBOT_FILE).to_robot()


def base_of(robot, friction="coulomb"):
    model = build_rigid_model(robot, RigidOptions(friction=friction))
    base = find_base_parameters(model)
    return BaseModel(model.only(base.columns.tolist()), base.values(model.nominal), np.ones(base.columns.size, bool))


def designed(robot, options=OPTIONS, rest=REST, realizations=1, reach=None):
    return design_trajectory(options, base_of(robot), rest, realizations, STEP_S, reach or Reach(robot))


def motion_of(excitation, robot):
    """Way, speed and acceleration (3, n_real, n_sample, n_joint) of the arm on a grid four times finer than played."""
    omega = 2 * np.pi * excitation.frequency_hz
    spectrum = excitation.spectrum[:, 0]
    if excitation.kind == "speed_reference":
        spectrum = spectrum / (1j * omega)[:, None]
    n_fine = 4 * excitation.reference.shape[2]
    wave = np.exp(1j * omega * np.arange(n_fine)[:, None] * excitation.period_s / n_fine)
    rates = [np.real(np.einsum("tk,rkm->rtm", wave * (1j * omega) ** order, spectrum)) for order in range(3)]
    return np.array(rates) @ robot.arm_per_motor.T


def torques_of(robot, rest, motion):
    model = build_rigid_model(robot)
    motor = np.array([rest + motion[0], *motion[1:]]) @ robot.motor_per_arm.T
    return model.torques(model.nominal, *motor)


def test_shapes_begin_and_end_at_rest_and_are_each_others_derivatives():
    series = resting_series(5, 3.0)
    assert series.count == 7
    ends = series.at(np.array([0.0, 3.0]))
    np.testing.assert_allclose(ends, 0, atol=1e-12 * np.abs(series.grid(50)).max())
    np.testing.assert_allclose(series.grid(300).mean(axis=1), 0, atol=1e-12)
    step, time = 1e-5, np.linspace(0.1, 2.9, 7)
    ahead, behind, here = series.at(time + step), series.at(time - step), series.at(time)
    scale = np.abs(here[1:]).max()
    np.testing.assert_allclose((ahead - behind)[:2] / (2 * step), here[1:], atol=FINITE_DIFFERENCE * scale)
    with pytest.raises(ValueError, match="two harmonics or more"):
        resting_series(1, 3.0)


@pytest.mark.parametrize("kind", ["d_optimal", "condition"])
def test_slopes_of_the_criterion_are_those_of_its_value(kind):
    generator = np.random.default_rng(1)
    columns, direction = generator.standard_normal((2, 40, 3, 5))
    criterion = Criterion(kind, np.array([1.0, 2.0, 0.5]), generator.uniform(0.5, 2, 5))
    value, slopes = criterion.with_slopes(columns)
    scaled = columns * criterion.row_weight[:, None] / criterion.column_size
    rows = scaled.reshape(120, 5)
    singular = np.linalg.svd(rows, compute_uv=False)
    wanted = -np.linalg.slogdet(rows.T @ rows / 120)[1] / 5
    if kind == "condition":
        wanted = np.log(singular[0] / singular[-1])
    assert value == pytest.approx(wanted, rel=IDENTITY)
    assert criterion.condition(columns) == pytest.approx(singular[0] / singular[-1])
    step = 1e-6
    change = criterion.value(columns + step * direction) - criterion.value(columns - step * direction)
    assert change / (2 * step) == pytest.approx(np.sum(slopes * direction), rel=FINITE_DIFFERENCE)


def test_columns_and_torques_are_those_of_the_whole_model_about_each_configuration(arm):
    base, rest = base_of(arm), np.array([[0.3, 0.5], [-0.4, 0.2]])
    motion = np.random.default_rng(3).uniform(-1, 1, (3, 6, 2))
    wanted = np.array([torques_of(arm, row, motion) for row in rest])
    np.testing.assert_allclose(base.torques(rest, motion), wanted, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(base.columns(rest, motion) @ base.values, wanted, rtol=1e-7, atol=1e-8)


def test_what_a_motion_uses_of_each_limit(arm):
    limits = Limits(*(np.array(pair) for pair in ([1.0, 2.0], [2.0, 4.0], [120.0, 50.0], [5.0, np.inf], [4.0, 8.0])))
    way, speed, acceleration = [[0.5, 1.0], [-0.5, -0.5]], [[1.0, 0.5], [0.0, -0.25]], [[1.0, 9.0], [-2.0, 9.0]]
    torque = np.array([[[1.0, 2.0], [-2.0, 2.0]], [[0.0, -6.0], [1.0, 0.0]]])
    used = limits.used(arm, np.array([way, speed, acceleration]), torque)
    np.testing.assert_allclose(used, [[0.5, 0.25], [0.5, 0.5], [0.4, 0.0], [0.5, 0.75]])


@pytest.mark.parametrize("coupled", [False, True])
def test_slopes_of_a_trajectory_are_those_of_its_worth_and_of_its_use_of_limits(coupled):
    """Without Coulomb friction, whose columns jump."""
    robot = with_gears(random_chain(4, n_joint=3), couplings=coupled)
    robot = replace(robot, gravity_m_s2=np.array([0.0, 0.0, -1.0]))
    options = replace(OPTIONS, max_acceleration_deg_s2=2000.0, max_acceleration_m_s2=20.0, torque_share=1.0)
    rest = np.array([[0.1, -0.2, 0.3], [0.2, 0.1, 0.0]])
    base = base_of(robot, "viscous")
    weak = tuple(replace(joint, motor=replace(joint.motor, max_torque_nm=500.0)) for joint in robot.joints)
    base = replace(base, model=replace(base.model, robot=replace(robot, joints=weak)))
    problem = trajectory_problem(base, rest, options, -5.0)
    generator = np.random.default_rng(2)
    point = (random_trajectory(problem, generator) / problem.scale).ravel()
    direction, step = generator.standard_normal(point.size), 1e-5
    found = problem.evaluate(point, 20.0)
    ahead, behind = (problem.evaluate(point + sign * step * direction, 20.0) for sign in (1, -1))
    # Slopes by positions and speeds are one-sided differences of the columns.
    slope = (ahead.value - behind.value) / (2 * step)
    assert found.slope @ direction == pytest.approx(slope, rel=20 * FINITE_DIFFERENCE)
    slopes = (ahead.used - behind.used) / (2 * step)
    assert found.used.size == 4 * 3 + 1
    np.testing.assert_allclose(
        found.used_slope @ direction, slopes, rtol=20 * FINITE_DIFFERENCE, atol=FINITE_DIFFERENCE * np.abs(slopes).max()
    )


@pytest.mark.parametrize("inject", ["speed_reference", "position_reference"])
def test_limits_hold_between_samples_too_and_the_plan_tells_what_is_used(arm, inject):
    reach = Reach(arm, floor_m=-0.9)
    options = replace(OPTIONS, inject=inject, max_acceleration_deg_s2=500.0)
    excitation = designed(arm, options, reach=reach)
    motion = motion_of(excitation, arm)[:, 0]
    np.testing.assert_allclose(motion[:, 0], 0, atol=1e-9 * np.abs(motion).max())
    visited, torque = REST + motion[0], torques_of(arm, REST, motion)
    speed = motion[1] @ arm.motor_per_arm.T
    share = np.where(motion[0] > 0, motion[0] / (arm.upper - REST), motion[0] / (arm.lower - REST)).max(axis=0)
    whole = np.array([[joint.motor.max_speed_rad_s, joint.motor.max_torque_nm] for joint in arm.joints]).T
    fine = 1 + 1e-4
    assert share.max() <= 0.9 * fine
    assert (np.abs(speed).max(axis=0) <= 0.8 * whole[0] * fine).all()
    assert (np.abs(torque).max(axis=0) <= 0.7 * whole[1] * fine).all()
    assert np.abs(motion[2]).max() <= np.radians(500) * fine
    assert not any(reach.problems(visited[::80]))
    plan = excitation.plan
    np.testing.assert_allclose(plan.speed_peak[0], np.abs(speed).max(axis=0), rtol=1e-4)
    np.testing.assert_allclose(plan.torque_peak[0], np.abs(torque).max(axis=0), rtol=1e-3)
    np.testing.assert_allclose(1 - plan.excursion_margin[0], share, rtol=1e-4)
    np.testing.assert_allclose(plan.torque_rms[0], np.sqrt(np.mean(torque**2, axis=0)), rtol=1e-3)
    used = [(np.abs(speed) / whole[0]).max(), (np.abs(torque) / whole[1]).max() / 0.7 * 0.8, share.max() / 0.9 * 0.8]
    assert max(used) > 0.6, "some limit is nearly used"
    assert (plan.admissible_scale > 1).all()
    assert plan.duration_s == 4.0
    assert list(excitation.excited_lines) == list(excitation.played_lines) == [1, 2, 3, 4, 5]


def test_the_floor_bends_a_trajectory(arm):
    low = Reach(arm, floor_m=-0.3)
    free, bound = designed(arm), designed(arm, reach=low)
    visited = [REST + motion_of(each, arm)[0, 0, ::80] for each in (free, bound)]
    assert any(low.problems(visited[0]))
    assert not any(low.problems(visited[1]))
    assert np.ptp(visited[1], axis=0).min() > np.deg2rad(20), "it still moves"


@pytest.mark.parametrize(("criterion", "gain"), [("d_optimal", 0.3), ("condition", 0.5)])
def test_the_best_trajectory_is_better_than_a_hundred_random_ones(arm, criterion, gain):
    """By the logarithm: a third more accuracy of every parameter, or a condition number 1.6 times smaller."""
    problem = trajectory_problem(base_of(arm), REST, replace(OPTIONS, criterion=criterion))
    generator = np.random.default_rng(9)
    drawn = [problem.regressor(random_trajectory(problem, generator)) for _ in range(100)]
    chance = min(problem.criterion.value(each) for each in drawn)
    excitation = designed(arm, replace(OPTIONS, criterion=criterion, starts=2, evaluations=150))
    way = np.linalg.lstsq(problem.waves[0], motion_of(excitation, arm)[0, 0, :: 16000 // 100], rcond=None)[0]
    regressor = problem.regressor(way)
    assert problem.criterion.value(regressor) < chance - gain
    assert excitation.plan.condition[0] == pytest.approx(problem.criterion.condition(regressor), rel=1e-6)


def test_the_same_seed_gives_the_same_trajectory_and_realizations_differ(arm):
    options = replace(OPTIONS, evaluations=15)
    first, again = designed(arm, options, realizations=2), designed(arm, options, realizations=2)
    np.testing.assert_array_equal(first.reference, again.reference)
    assert np.abs(first.reference[0] - first.reference[1]).max() > 0.1 * np.abs(first.reference).max()
    other = designed(arm, replace(options, seed=2))
    assert np.abs(first.reference[0] - other.reference[0]).max() > 0.1 * np.abs(first.reference).max()
    assert first.reference.shape == (2, 1, 4000, 2)


def test_shapes_that_touch_keep_a_trajectory_small(arm, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(
        """<mujoco><worldbody><body name="upper"><joint name="lift" axis="0 -1 0"/><geom size="0.05" pos="0.3 0 0"/>
        <body name="fore" pos="0.6 0 0"><joint name="bend" axis="0 -1 0"/><geom size="0.05" pos="0.3 0 0"/>
        </body></body><body name="wall" pos="0.5 0 0.65"><geom type="box" size="0.5 0.5 0.05"/></body>
        </worldbody></mujoco>"""
    )
    reach = Reach(arm, shapes=Shapes(path, ["lift", "bend"], {}))
    assert any(reach.problems(REST + motion_of(designed(arm), arm)[0, 0, ::80]))
    bound = REST + motion_of(designed(arm, reach=reach), arm)[0, 0, ::80]
    assert not any(reach.problems(bound))
    assert np.ptp(bound, axis=0).max() > np.deg2rad(5)


@pytest.mark.parametrize("friction", ["none", "tanh"])
def test_a_simulated_arm_needs_the_torques_of_the_rigid_model(arm, friction):
    """Large motions in closed loop; with friction, reversals smoothed over the Stribeck speed are left out."""
    excitation = designed(arm)
    experiment = SimulatedExperiment(
        robot=arm,
        controller=Controller(),
        options=SimulateOptions(transient_periods=1, imperfections=Imperfections(friction=friction)),
        reference=excitation.reference,
        inject=excitation.kind,
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=1,
    )
    record = simulate(experiment, REST[0], 0)
    angle, torque = record.outputs[0, 0, 0, 0], record.inputs[0, 0, 0, 0]
    told = angle_reference(excitation.reference[0, 0], STEP_S)
    lag = np.abs(angle - (told - told[0])).max(axis=0) / np.ptp(told, axis=0)
    assert lag.max() < 0.03, "the arm follows"
    assert (np.abs(torque) < [[8.0, 8.0]]).all(), "the motors do not saturate"

    omega = 2j * np.pi * np.fft.rfftfreq(len(angle), STEP_S)[:, None]
    kept = np.abs(omega) < 2 * np.pi * 40

    def filtered(signal, factor=1.0):
        return np.fft.irfft(np.fft.rfft(signal, axis=0) * factor * kept, len(signal), axis=0)

    model = build_rigid_model(arm, RigidOptions(friction="viscous" if friction == "none" else "coulomb"))
    speed = filtered(angle, omega)
    wanted = model.torques(model.nominal, filtered(angle) + record.output_offset[0], speed, filtered(angle, omega**2))
    # A command acts one sample later, held for another.
    applied = filtered(torque, np.exp(-1.5 * omega * STEP_S))
    error = np.abs(applied - filtered(wanted)) / np.sqrt(np.mean(wanted**2, axis=0))
    moving = (np.abs(speed) > 20).all(axis=1)
    assert moving.mean() > 0.5
    if friction == "none":
        assert error.max() < 2e-3
    else:
        assert np.median(error[moving]) < 5e-3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_speed_rad_s": np.inf}, "joint `bend` has no max_speed_rad_s in the robot file"),
        ({"max_torque_nm": np.inf}, "joint `bend` has no max_torque_nm in the robot file"),
        ({"max_torque_nm": 0.5}, "motor `bend` needs 75.7 % of its torque limit to hold the arm"),
        ({"max_speed_rad_s": 5.0}, "joint `bend` reaches 2.9 %"),
        ({"upper": np.inf}, "joint `bend` has no joint limits in the robot file"),
        ({"upper": np.deg2rad(30.5)}, "joint `bend` is 0.5 deg from its upper limit"),
    ],
)
def test_what_keeps_a_robot_from_moving_is_told_at_once(arm, change, words):
    bend = arm.joints[1]
    bend = replace(bend, **change) if "upper" in change else replace(bend, motor=replace(bend.motor, **change))
    with pytest.raises(SettingsError) as error:
        designed(replace(arm, joints=(arm.joints[0], bend)), reach=Reach(arm))
    assert words in str(error.value)


def test_a_period_that_is_too_short_for_the_speed_says_how_long_it_must_be(arm):
    with pytest.raises(
        SettingsError, match=r"joint `lift` reaches .* in 0.2 s \(period_s: 0\.\d+ s or more\)"
    ) as error:
        designed(arm, replace(OPTIONS, period_s=0.2))
    assert "joint `bend`" in str(error.value), "all at once"
    with pytest.raises(SettingsError, match="20 harmonics leave fewer than 20 of 200 samples"):
        designed(arm, replace(OPTIONS, period_s=0.2, harmonics=20))


def test_a_linear_axis_moves_along_its_rail():
    robot = linear_axis()
    rest = np.array([[0.8]])
    excitation = designed(robot, replace(OPTIONS, max_acceleration_m_s2=1.5, friction="viscous"), rest)
    motion = motion_of(excitation, robot)
    assert np.abs(motion[2]).max() <= 1.5 * (1 + 1e-4)
    assert (rest + motion[0]).min() >= 0.08
    assert np.ptp(motion[0]) > 0.05
