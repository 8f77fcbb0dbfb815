"""The regressor against MuJoCo's inverse dynamics, and closed forms of its columns."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from arm_regressor import arm_columns
from exact_systems import NO_PAYLOAD, springs_everywhere, two_joint_robot
from rigid_robots import engine_torques, planar_arm, random_body, random_chain, random_motion, with_gears
from robid.robot.model import build_model
from robid.robot.parameters import PARAMETER_KINDS
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.links import COMPONENTS
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from tolerances import IDENTITY

ROBOTS = Path(__file__).parents[3] / "configs" / "robots"
BARE = RigidOptions(friction="none", offsets=False, motor_inertias=False, couplings=False)
VISCOUS = RigidOptions(friction="viscous")


def close(found, wanted, tolerance=IDENTITY):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


def column(model, name):
    return model.names.index(name)


@pytest.mark.parametrize("seed", range(4))
def test_torques_are_those_of_the_engine_for_random_rigid_chains(seed):
    robot = random_chain(seed)
    compiled = build_model(robot)
    data = mujoco.MjData(compiled.mujoco)
    motion, wanted = random_motion(robot, 6), []
    for position, velocity, acceleration in motion.swapaxes(0, 1):
        data.qpos[compiled.arm] = robot.arm_per_motor @ position
        data.qvel[compiled.arm] = robot.arm_per_motor @ velocity
        data.qacc[compiled.arm] = robot.arm_per_motor @ acceleration
        mujoco.mj_inverse(compiled.mujoco, data)
        wanted.append(data.qfrc_inverse[compiled.arm] @ robot.arm_per_motor)
    model = build_rigid_model(robot, VISCOUS)
    close(model.columns(*motion) @ model.nominal, np.array(wanted))
    close(model.torques(model.nominal, *motion), np.array(wanted))


@pytest.mark.parametrize("rotor", ["spong", "on_link"])
@pytest.mark.parametrize("build", [lambda: with_gears(random_chain(5)), springs_everywhere, two_joint_robot])
def test_coupled_motors_and_riding_rotors_are_those_of_the_engine(build, rotor):
    robot = replace(build(), rotor=rotor)
    robot = replace(robot, springs=tuple(spring for spring in robot.springs if spring.place == "transmission"))
    model = build_rigid_model(robot, VISCOUS)
    motion = random_motion(robot, 6)
    close(model.columns(*motion) @ model.nominal, engine_torques(robot, motion))


@pytest.mark.parametrize("name", ["kr300.yaml", "gantry.yaml", "puma560.yaml"])
def test_torques_of_our_robots_are_those_of_the_engine(name):
    robot = load_robot(ROBOTS / name).to_robot()
    robot = replace(robot, springs=tuple(spring for spring in robot.springs if spring.place == "transmission"))
    model = build_rigid_model(robot, VISCOUS)
    motion = random_motion(robot, 6)
    close(model.columns(*motion) @ model.nominal, engine_torques(robot, motion))


@pytest.mark.parametrize("name", ["ur5e.yaml", "iiwa14.yaml", "kr210.yaml"])
def test_torques_of_foreign_robots_are_those_of_their_own_files(name, data_folder, monkeypatch):
    folder = data_folder("robot_models")
    monkeypatch.setenv("ROBID_DATA", str(folder.parent))
    file = load_robot(ROBOTS / name)
    robot = replace(file.to_robot(), payload=NO_PAYLOAD)
    own = mujoco.MjModel.from_xml_path(str(file.model_path(ROBOTS)))
    own.dof_armature[:], own.dof_damping[:], own.dof_frictionloss[:] = 0.0, 0.0, 0.0
    own.jnt_stiffness[:] = 0.0
    own.opt.gravity[:] = robot.gravity_m_s2
    own.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(own)
    at = [own.joint(joint.name).dofadr[0] for joint in robot.joints]
    motion = random_motion(robot, 5) @ robot.arm_per_motor.T
    wanted = []
    for position, velocity, acceleration in motion.swapaxes(0, 1):
        data.qpos[at], data.qvel[at], data.qacc[at] = position, velocity, acceleration
        mujoco.mj_inverse(own, data)
        wanted.append(data.qfrc_inverse[at].copy())
    nominal = build_rigid_model(robot, BARE).nominal
    close(arm_columns(robot, *motion) @ nominal, np.array(wanted))


def test_motors_feel_the_arm_through_gears_and_couplings():
    robot = with_gears(random_chain(7))
    model = build_rigid_model(robot, BARE)
    motion = random_motion(robot, 5)
    arm = arm_columns(robot, *(motion @ robot.arm_per_motor.T))
    close(model.columns(*motion), np.einsum("ij,nif->njf", robot.arm_per_motor, arm))


def test_a_payload_of_its_own_adds_up_and_comes_off():
    robot = random_chain(8)
    whole, apart = build_rigid_model(robot), build_rigid_model(robot, RigidOptions(payload="body"))
    bare = build_rigid_model(replace(robot, payload=NO_PAYLOAD))
    motion = random_motion(robot, 5)
    close(apart.torques(apart.nominal, *motion), whole.torques(whole.nominal, *motion))
    close(apart.torques(apart.nominal, *motion, loaded=False), bare.torques(bare.nominal, *motion))
    assert apart.names[50:60] == tuple(f"payload.{name}" for name in COMPONENTS)


def test_a_part_of_the_columns_is_that_part():
    robot = replace(with_gears(random_chain(9)), rotor="on_link")
    model = build_rigid_model(robot, RigidOptions(friction="asymmetric", payload="body"))
    motion = random_motion(robot, 5)
    chosen = np.flatnonzero(np.random.default_rng(2).random(len(model.names)) < 0.4).tolist()
    part = model.only(chosen)
    np.testing.assert_array_equal(part.columns(*motion), model.columns(*motion)[:, :, chosen])
    assert part.names == tuple(model.names[index] for index in chosen)
    np.testing.assert_array_equal(part.nominal, model.nominal[chosen])
    for wrong in ([3, 1], [2, 2]):
        with pytest.raises(ValueError, match="ascending"):
            model.only(wrong)


def test_columns_are_the_same_however_many_samples_come_at_once():
    robot = random_chain(10)
    model, motion = build_rigid_model(robot), random_motion(robot, 2500)
    whole = model.columns(*motion)
    assert whole.shape == (2500, 5, len(model.names))
    assert whole[:, 2, 7].flags.c_contiguous
    for rows in (slice(1), slice(2300, 2500)):
        close(model.columns(*motion[:, rows]), whole[rows])
    close(model.torques(model.nominal, *np.tile(motion, (1, 2, 1))), np.tile(whole @ model.nominal, (2, 1)))


@pytest.mark.parametrize(
    ("form", "wanted"),
    [
        ("none", lambda _torque, _sense, _speed: {}),
        ("viscous", lambda _torque, _sense, speed: {"viscous": speed}),
        ("coulomb", lambda _torque, sense, speed: {"viscous": speed, "coulomb": sense}),
        (
            "asymmetric",
            lambda _torque, sense, speed: {
                "viscous_forward": speed * (sense > 0),
                "viscous_backward": speed * (sense < 0),
                "coulomb_forward": 1.0 * (sense > 0),
                "coulomb_backward": -1.0 * (sense < 0),
            },
        ),
        (
            "load",
            lambda torque, sense, speed: {
                "viscous": speed,
                "coulomb": sense,
                "load_friction": np.abs(torque) * sense,
            },
        ),
        (
            "quadratic",
            lambda _torque, sense, speed: {
                "viscous": speed,
                "coulomb": sense,
                "quadratic_viscous": speed**2 * np.sign(speed),
            },
        ),
    ],
)
@pytest.mark.parametrize("by_instrument", [False, True])
def test_friction_has_the_form_that_is_asked_for(form, wanted, by_instrument):
    robot = two_joint_robot()
    model = build_rigid_model(robot, replace(BARE, friction=form))
    position, speed, acceleration = random_motion(robot, 8)
    speed[3] = 0.0
    torque = np.random.default_rng(1).standard_normal((8, 2))
    felt = np.roll(speed, 1, axis=0) if by_instrument else None
    found = model.columns(position, speed, acceleration, torque=torque, friction_speed=felt)
    terms = wanted(torque, np.sign(speed if felt is None else felt), speed)
    assert len(model.names) == 20 + 2 * len(terms)
    for index, joint in enumerate(("shoulder", "elbow")):
        for name, values in terms.items():
            own = found[:, :, column(model, f"{joint}.{name}")]
            np.testing.assert_allclose(own[:, index], values[:, index])
            np.testing.assert_array_equal(own[:, 1 - index], 0.0)
    if form == "load":
        with pytest.raises(ValueError, match="needs the motors' torques"):
            model.columns(position, speed, acceleration)


def test_nominal_values_are_those_of_the_description():
    robot = replace(random_chain(11, 2), payload=NO_PAYLOAD)
    first = robot.joints[0]
    model = build_rigid_model(robot, RigidOptions(friction="asymmetric"))
    values = dict(zip(model.names, model.nominal, strict=True))
    law, link = first.motor.friction, first.link
    assert values["joint_0.viscous_backward"] == law.viscous_nms_rad
    assert values["joint_0.coulomb_forward"] == law.coulomb_nm
    assert values["joint_0.motor_inertia"] == first.motor.inertia_kgm2
    assert values["joint_0.torque_offset"] == 0
    assert values["joint_0.M"] == link.mass_kg
    np.testing.assert_allclose(values["joint_0.MY"], link.mass_kg * link.com_m[1])
    # About the frame's origin by Steiner's theorem, products of inertia as entries of the matrix.
    x, y, _ = link.com_m
    np.testing.assert_allclose(values["joint_0.ZZ"], link.inertia_kgm2[2, 2] + link.mass_kg * (x**2 + y**2))
    np.testing.assert_allclose(values["joint_0.XY"], link.inertia_kgm2[0, 1] - link.mass_kg * x * y)
    for unit, kind in zip(model.units, model.kinds, strict=True):
        assert unit in (PARAMETER_KINDS[kind].unit, PARAMETER_KINDS[kind].linear_unit)


def test_coupled_gears_have_terms_that_move_with_the_arm():
    robot = with_gears(two_joint_robot())
    model = build_rigid_model(robot)
    position, speed, acceleration = random_motion(robot, 5)
    found = model.columns(position, speed, acceleration)
    row = np.array([0.003, 1 / 100.0])
    for name, effect in (
        ("coupling_inertia", acceleration @ row),
        ("coupling_viscous", speed @ row),
        ("coupling_coulomb", np.sign(speed @ row)),
    ):
        np.testing.assert_allclose(found[:, :, column(model, f"elbow.{name}")], np.outer(effect, row))
        assert f"shoulder.{name}" not in model.names


def test_wrong_shapes_are_refused():
    robot = two_joint_robot()
    position, speed, acceleration = random_motion(robot, 5)
    with pytest.raises(ValueError, match=r"`velocity` must have shape \(n_sample, n_joint\)"):
        build_rigid_model(robot).columns(position, speed[:4], acceleration)


def test_a_body_of_points_has_their_standard_parameters():
    body = random_body(np.random.default_rng(0))
    robot = planar_arm(1)
    robot = replace(robot, joints=(replace(robot.joints[0], link=body),))
    # About the axis with unit acceleration: the inertia; at rest: the first moments, less gravity.
    model = build_rigid_model(robot, BARE)
    zero = np.zeros((1, 1))
    columns = model.columns(zero, zero, zero + 1.0)[0, 0]
    np.testing.assert_allclose(columns[[5, 6, 7, 9]], [1.0, 9.81, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(columns[[0, 1, 2, 3, 4, 8]], 0.0, atol=1e-12)
