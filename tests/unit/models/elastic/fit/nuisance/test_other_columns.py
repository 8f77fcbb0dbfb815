"""Columns of uncertain drives, gears and missing springs against responses of robots that are built anew."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import (
    arm_on_rail,
    ball_screw,
    exact_frf,
    springs_everywhere,
    two_joint_robot,
    two_mass_robot,
    with_arm_friction,
    without_spring,
)
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.columns import bristle_share, column
from robid.models.elastic.fit.nuisance.effects import Hysteresis
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.moves import missing_springs, stiffened
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.options import ElasticOptions

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 12)
PLACES = np.array([[0.3, -0.7], [-0.5, 0.9]])
DELAY_S = 1e-3
RIGID = 1e11


def measured(robot, places=PLACES, **known):
    return exact_frf(robot, places, FREQUENCY_HZ, delay_s=DELAY_S, declared_noise=0.01, **known)


def log_ratio(robot, other, places=PLACES):
    return np.log(measured(other, places).response / measured(robot, places).response)


def scene_of(robot, frf, options=None):
    problem, _ = set_up(robot, frf, options or ElasticOptions(), DELAY_S)
    return Scene(problem, np.zeros(len(problem.parameters.names)), robot, options or ElasticOptions())


def columns_of(robot, frf=None, options=None, places=PLACES):
    options = options or ElasticOptions()
    scene = scene_of(robot, measured(robot, places) if frf is None else frf, options)
    nuisances = list_nuisances(robot, options)
    found = nuisance_columns(scene.problem, scene.internal, robot, options, nuisances)
    return {nuisance.name: found[..., index] for index, nuisance in enumerate(nuisances)}


def close(found, wanted, share=1e-5):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=share * np.abs(wanted).max())


@pytest.mark.parametrize("robot", [two_joint_robot(), arm_on_rail()], ids=["arm", "rail"])
def test_a_missing_spring_s_column_is_what_a_little_compliance_does(robot):
    places = PLACES if len(robot.joints) == 2 else np.array([[0.5, 0.3, -0.7]])
    found = columns_of(robot, places=places)
    missing = list(missing_springs(robot))
    assert missing
    for spring in missing:

        def slope(percent, spring=spring):
            soft, hard = (stiffened(spring, factor) for factor in (100 / percent, RIGID))
            pair = (replace(robot, springs=(*robot.springs, each)) for each in (hard, soft))
            return log_ratio(*pair, places) / percent

        wanted = (8 * slope(0.002) - 6 * slope(0.004) + slope(0.008)) / 3
        assert np.abs(wanted).max() > 1e-5
        close(found[f"{spring.name}.compliance"], wanted, 1e-4)


def test_what_is_there_or_the_same_as_another_is_not_missing():
    robot = two_joint_robot()
    # The shoulder lies 0.4 m above the world's origin.
    names = {"base_x", "base_y", "bearing_shoulder_y", "bearing_elbow_x", "bearing_elbow_y"}
    assert {spring.name for spring in missing_springs(robot)} == names
    bare = without_spring(robot, "bearing_1")
    assert {spring.name for spring in missing_springs(bare)} - names == {"bearing_shoulder_x"}
    assert {s.name: s.stiffness for s in missing_springs(robot)}["bearing_elbow_x"] == 6e3
    rail = {spring.name for spring in missing_springs(arm_on_rail())}
    assert rail - names == {"base_z", "bearing_rail_y"}
    low = replace(robot, joints=(replace(robot.joints[0], position_m=np.zeros(3)), robot.joints[1]))
    assert {spring.name for spring in missing_springs(low)} == names - {"base_x", "base_y"}


def test_a_coupling_s_column_is_what_another_coupling_does():
    robot = springs_everywhere()
    found = columns_of(robot)["elbow.coupling_shoulder"]

    def coupled(percent):
        turn = robot.joints[1].couplings["shoulder"] + percent / 100 / robot.joints[0].motor.gear_ratio
        return replace(robot, joints=(robot.joints[0], replace(robot.joints[1], couplings={"shoulder": turn})))

    close(found, log_ratio(coupled(-0.02), coupled(0.02)) / 0.04)


def test_arms_with_a_wrist_have_its_couplings_as_nuisances_and_others_only_those_they_state():
    def couplings(robot):
        return {
            nuisance.name for nuisance in list_nuisances(robot, ElasticOptions()) if nuisance.cause == "gear_coupling"
        }

    robot = two_joint_robot()
    assert couplings(robot) == set()
    joints = tuple(replace(robot.joints[index % 2], name=f"j{index}") for index in range(6))
    springs = tuple(replace(robot.springs[index % 2], name=f"g{index}", joint=index) for index in range(6))
    arm = replace(robot, joints=joints, springs=springs)
    assert couplings(arm) == {"j4.coupling_j3", "j5.coupling_j3", "j5.coupling_j4"}
    assert couplings(replace(arm, springs=springs[:4])) == set()  # rigid joints have none


def test_viscous_friction_of_arms_is_a_nuisance_where_it_is_not_estimated():
    robot = two_joint_robot()
    found = columns_of(robot)["elbow.arm_viscous"]
    scene = scene_of(robot, measured(robot))
    percent = 2 * np.pi * 10 * scene.values.link_inertia[1] / 100
    wanted = log_ratio(robot, with_arm_friction(robot, 0.0, 1e-4 * percent)) / 1e-4
    close(found, wanted)
    free = ElasticOptions(free=("stiffness", "arm_viscous"), fixed=("shoulder.arm_viscous",))
    names = {nuisance.name for nuisance in list_nuisances(robot, free)}
    assert "elbow.arm_viscous" not in names
    assert {"shoulder.arm_viscous", "elbow.motor_inertia"} <= names


def test_rotors_are_nuisances_where_they_are_not_estimated():
    robot = two_joint_robot()
    found = columns_of(robot, options=ElasticOptions(free=("stiffness", "damping")))["elbow.motor_inertia"]

    def heavier(share):
        motor = replace(robot.joints[1].motor, inertia_kgm2=(1 + share) * robot.joints[1].motor.inertia_kgm2)
        return replace(robot, joints=(robot.joints[0], replace(robot.joints[1], motor=motor)))

    close(found, log_ratio(heavier(-1e-4), heavier(1e-4)) / 0.02)
    assert not [nuisance for nuisance in list_nuisances(robot, ElasticOptions()) if nuisance.cause == "rotor_inertia"]


def rubbing(robot, joint, viscous):
    """The robot with more viscous friction of a motor [N m s/rad]."""
    motor = robot.joints[joint].motor
    friction = replace(motor.friction, viscous_nms_rad=motor.friction.viscous_nms_rad + viscous)
    joints = list(robot.joints)
    joints[joint] = replace(joints[joint], motor=replace(motor, friction=friction))
    return replace(robot, joints=tuple(joints))


def test_viscous_friction_of_motors_is_a_nuisance_where_it_is_not_estimated():
    robot, without = two_joint_robot(), ElasticOptions(free=("stiffness", "damping"))
    found = columns_of(robot, options=without)["elbow.viscous"]
    percent = 2 * np.pi * 10 * robot.joints[1].motor.inertia_kgm2 / 100
    close(found, log_ratio(rubbing(robot, 1, -1e-2 * percent), rubbing(robot, 1, 1e-2 * percent)) / 2e-2)
    fixed = ElasticOptions(fixed=("shoulder.viscous",))
    names = {nuisance.name for nuisance in list_nuisances(robot, fixed)}
    assert "shoulder.viscous" in names
    assert "elbow.viscous" not in names


def test_springs_and_dampers_are_nuisances_where_they_are_not_estimated():
    robot, options = two_joint_robot(), ElasticOptions(free=("damping",), fixed=("gear_2.damping",))
    found = columns_of(robot, options=replace(options, statics="every_iterate"))

    def off(index, kind, percent):
        spring = robot.springs[index]
        other = replace(spring, **{kind: getattr(spring, kind) * (1 + percent / 100)})
        return replace(robot, springs=(*robot.springs[:index], other, *robot.springs[index + 1 :]))

    for index, kind in ((0, "stiffness"), (2, "stiffness"), (1, "damping")):
        wanted = log_ratio(off(index, kind, -1e-2), off(index, kind, 1e-2)) / 2e-2
        close(found[f"{robot.springs[index].name}.{kind}"], wanted)
    assert "gear_1.damping" not in found


@pytest.mark.parametrize(
    "free", [("viscous",), ("stiffness", "damping"), ("stiffness", "damping", "viscous", "motor_inertia")]
)
@pytest.mark.parametrize("robot", [springs_everywhere(), ball_screw()], ids=["arm", "ball screw"])
def test_nothing_tells_a_factor_of_all_torques(robot, free):
    """Springs, dampers, masses, friction and torques by one factor are the same response, whatever a fit estimates."""
    for index in range(len(robot.joints)):
        robot = rubbing(robot, index, 2e-3)
    robot = with_arm_friction(robot, *(3.0 for _ in robot.joints))
    options = ElasticOptions(free=free, statics="every_iterate")
    places = PLACES[:, : len(robot.joints)]
    scene, nuisances = scene_of(robot, measured(robot, places), options), list_nuisances(robot, options)
    parameters, values = scene.problem.parameters, scene.values
    grown = {"payload.mass": robot.payload.mass_kg, "base.mass": 100.0}
    grown |= {f"{spring.name}.inertia": 100.0 for spring in robot.springs if spring.place == "shaft"}
    for index, name in enumerate(joint.name for joint in robot.joints):
        turn = 2 * np.pi * 10 / 100 * np.array([values.motor_inertia[index], values.link_inertia[index]])
        grown |= {f"{name}.mass": 100.0, f"{name}.motor_inertia": 100.0, f"{name}.torque_constant": -100.0}
        grown |= {f"{name}.viscous": values.viscous[index] / turn[0]}
        grown |= {f"{name}.arm_viscous": values.arm_viscous[index] / turn[1]}
    grown |= {f"{spring.name}.{kind}": 100.0 for spring in robot.springs for kind in ("stiffness", "damping")}
    along = np.array([grown.get(nuisance.name, 0.0) for nuisance in nuisances])
    own = np.where(parameters.logarithmic, 1.0, parameters.nominal_values() / parameters.scale)
    own = scene.problem.linear(scene.internal)[1] @ own
    columns = nuisance_columns(scene.problem, scene.internal, robot, options, nuisances)
    assert np.abs(own + columns @ along).max() < 1e-4 * np.abs(own).max()


@pytest.mark.parametrize(("kind", "phase"), [("friction_spring", 1.0), ("friction_loss", 1j)])
def test_friction_of_motors_acts_as_a_spring_to_the_housing(kind, phase):
    robot = two_joint_robot()
    frf = measured(robot, torque_hold="band_limited")
    found = columns_of(robot, frf)[f"elbow.{kind}"]
    size = 1e-6 * phase * robot.joints[1].motor.inertia_kgm2 * (2 * np.pi * 10) ** 2
    spring = np.diag([0.0, size])
    omega = (2 * np.pi * FREQUENCY_HZ)[:, None, None]
    at_once = frf.response * np.exp(1j * omega * DELAY_S)
    other = np.linalg.inv(np.linalg.inv(at_once) - spring / omega**2)
    close(found, np.log(other / at_once) / 1e-4, 1e-4)


def swinging(robot, places=PLACES, levels=(20.0, 5.0)):
    """A response measured with torques of another size in each place."""
    frf = measured(robot, places)
    blocks = np.eye(len(robot.joints)) * np.exp(1j * FREQUENCY_HZ)[:, None, None]
    return replace(frf, input_amplitude=np.array(levels)[:, None, None, None] * blocks)


def test_hysteresis_is_a_spring_and_a_damper_in_series_at_each_line():
    robot = two_joint_robot()
    scene = scene_of(robot, swinging(robot))
    gear, omega = robot.springs[1], 2 * np.pi * FREQUENCY_HZ
    found, shares = column(Hysteresis(1, 2.0), scene), bristle_share(omega, scene.swing[:, :, 1], 2.0)
    assert np.argmax(shares[0].imag) > np.argmax(shares[1].imag) + 2
    for line, rate in enumerate(omega):
        for place in range(2):
            share = 2e-5 * shares[place, line]
            stiffness = gear.stiffness * (1 + share.real)
            damping = gear.damping + gear.stiffness * share.imag / rate
            springs = (robot.springs[0], replace(gear, stiffness=stiffness, damping=damping), *robot.springs[2:])
            wanted = log_ratio(robot, replace(robot, springs=springs))[place, line] / 1e-3
            # Gravity's rest moves with the stiffness here, which hysteresis does not do.
            np.testing.assert_allclose(found[place, line], wanted, rtol=0, atol=2e-2 * np.abs(found[place]).max())


@pytest.mark.parametrize("relative_slip", [0.5, 1.0, 2.0])
def test_a_bristle_under_a_random_motion_has_the_corner_and_the_phase_that_the_column_says(relative_slip):
    """A bristle that obeys Dahl's law, integrated in time, against spring and damper in series."""
    generator = np.random.default_rng(1)
    count, lines, sizes = 2**13, np.arange(1, 60, 2), np.array([0.4, 1.3])
    phase = generator.uniform(0, 2 * np.pi, (64, lines.size))
    spectrum = np.zeros((64, count // 2 + 1), complex)
    spectrum[:, lines] = np.exp(1j * phase) * count / np.sqrt(2 * lines.size)
    x = sizes[:, None, None] * np.fft.irfft(spectrum)  # (2, 64, count), of these deviations
    slip = relative_slip * np.sqrt((sizes**2).mean())
    bristle, kept = np.zeros((2, 64)), np.zeros_like(x)
    for step in range(2 * count):  # the first period settles
        move = x[..., step % count] - x[..., (step - 1) % count]
        bristle = (bristle + move) / (1 + np.abs(move) / slip)
        kept[..., step % count] = bristle
    found = (np.fft.rfft(kept)[..., lines] / np.fft.rfft(x)[..., lines]).mean(axis=1)
    swing = np.broadcast_to(sizes[:, None] ** 2 / lines.size, (2, lines.size))
    wanted = bristle_share(2 * np.pi * lines, swing, relative_slip)
    scale = np.vdot(wanted, found).real / np.vdot(wanted, wanted).real
    assert 0.6 < scale < 0.95
    assert np.abs(found / scale - wanted).max() < 0.15


def test_stiffness_by_load_leaves_the_mean_load_alone_and_is_nothing_where_loads_are_alike():
    robot = two_joint_robot()
    frf = measured(robot)
    scene = scene_of(robot, frf)
    found = columns_of(robot, frf)
    load = np.abs(scene.problem.model.rest.deflection[:, 1])
    gear = np.array([spring.name for spring in robot.springs]) == "gear_2"
    softer, stiffer = (
        replace(robot, springs=tuple(
            replace(s, stiffness=s.stiffness * (1 + by * own)) for s, own in zip(robot.springs, gear, strict=True)
        ))
        for by in (-1e-4, 1e-4)
    )  # fmt: skip
    one = log_ratio(softer, stiffer) / 2e-2
    sign = np.where(load > load.mean(), 1.0, -1.0)[:, None, None, None]
    close(found["gear_2.load_stiffness"], sign * one, 2e-2)
    level = columns_of(replace(robot, gravity_m_s2=np.zeros(3)))
    assert not level["gear_2.load_stiffness"].any()
    cubic = [d.name for d in list_nuisances(robot, ElasticOptions(free=("stiffness", "cubic")))]
    assert "gear_2.load_stiffness" not in cubic


@pytest.mark.parametrize("robot", [two_mass_robot(), ball_screw()], ids=["two masses", "ball screw"])
def test_simple_drives_have_nuisances_too(robot):
    frf = measured(robot, np.zeros((2, 1)) + 0.1)
    found = columns_of(robot, frf)
    assert all(np.isfinite(column).all() for column in found.values())
    assert "drive.mass" in found or "rail.mass" in found
