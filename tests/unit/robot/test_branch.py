"""A branch with a parallelogram against its tree in MuJoCo, opened at the pin and projected by the loop's Jacobian."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from ruamel.yaml import YAML

from arm_regressor import arm_columns
from rigid_robots import random_motion
from robid.errors import SettingsError
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.forward import build_dynamics
from robid.robot.regressor.links import pin_gaps
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from tolerances import FINITE_DIFFERENCE, IDENTITY

FILE = Path(__file__).parents[3] / "configs" / "robots" / "branch.yaml"
BARE = RigidOptions(friction="none", offsets=False, motor_inertias=False, couplings=False)


def branch():
    return load_robot(FILE).to_robot()


def add_body(parent, name, position, rotation, link):
    body = parent.add_body(name=name, pos=position)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.asarray(rotation, float).ravel())
    body.quat = quaternion
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    tensor = link.inertia_kgm2
    body.explicitinertial, body.mass, body.ipos = True, link.mass_kg, link.com_m
    body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    return body


def tree_of(robot):
    """MuJoCo's model of all bodies, every joint free, with the pin as a constraint that only tells its Jacobian."""
    spec = mujoco.MjSpec()
    spec.option.gravity = robot.gravity_m_s2
    bodies, parent = {}, spec.worldbody
    for joint in robot.joints:
        parent = add_body(parent, joint.name, joint.position_m, joint.rotation, joint.link)
        bodies[joint.name] = parent
    for link in robot.loop_links:
        bodies[link.name] = add_body(bodies[link.parent], link.name, link.position_m, link.rotation, link.link)
        if link.pin is not None:
            bodies[link.name].add_site(name="pin", pos=link.pin.point_m)
            bodies[robot.joints[link.pin.joint].name].add_site(name="hole", pos=link.pin.held_point_m)
    return spec.compile()


def loop_jacobian(model, data, robot):
    """Speeds of all joints (n_body, 3) per speed of the chain's: the pin must not part, the support must not turn."""
    chain = chain_of(model, robot)
    others = np.setdiff1d(np.arange(model.nv), chain)
    jacobians = []
    for name in ("pin", "hole"):
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, jacobian, None, model.site(name).id)
        jacobians.append(jacobian)
    turning = [np.zeros((3, model.nv)) for _ in range(2)]
    for name, jacobian in zip(("support", "shoulder"), turning, strict=True):
        mujoco.mj_jacBody(model, data, None, jacobian, model.body(name).id)
    parting = np.vstack([jacobians[0] - jacobians[1], turning[0] - turning[1]])
    whole = np.zeros((model.nv, chain.size))
    whole[chain] = np.eye(chain.size)
    whole[others] = -np.linalg.pinv(parting[:, others]) @ parting[:, chain]
    np.testing.assert_allclose(parting @ whole, 0.0, atol=1e-12)
    return whole


def chain_of(model, robot):
    return np.array([model.joint(joint.name).dofadr[0] for joint in robot.joints])


def test_torques_are_those_of_the_tree_projected_by_the_jacobian_of_its_loops():
    robot = branch()
    model = tree_of(robot)
    data = mujoco.MjData(model)
    motion = random_motion(robot, 10) @ robot.arm_per_motor.T
    found = arm_columns(robot, *motion) @ build_rigid_model(robot, BARE).nominal
    step = 1e-6
    for position, velocity, acceleration, torque in zip(*motion, found, strict=True):
        shoulder, arm, forearm = position
        # Angles that close the loop by its drawing: the crank stays parallel to the forearm, the rod to the arm.
        angles = {"shoulder": shoulder, "arm": arm, "forearm": forearm}
        angles |= {"crank": arm + forearm, "rod": -forearm, "support": -arm - forearm}
        for name, angle in angles.items():
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        np.testing.assert_allclose(data.site("pin").xpos, data.site("hole").xpos, atol=1e-12)
        jacobian = loop_jacobian(model, data, robot)
        here = data.qpos.copy()
        data.qpos[:] = here + step * jacobian @ velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        np.testing.assert_allclose(loop_jacobian(model, data, robot), jacobian, atol=1e-10)  # so its rate is zero
        data.qpos[:], data.qvel[:], data.qacc[:] = here, jacobian @ velocity, jacobian @ acceleration
        mujoco.mj_inverse(model, data)
        wanted = jacobian.T @ data.qfrc_inverse
        np.testing.assert_allclose(torque, wanted, rtol=0, atol=IDENTITY * np.abs(wanted).max())


def test_the_motor_of_the_forearm_turns_the_crank():
    robot = branch()
    turns = robot.arm_per_motor
    np.testing.assert_allclose(turns[1] + turns[2], [0.0, 0.0, 1 / 20], atol=1e-15)  # the crank follows motor 3 alone
    model, motion = build_rigid_model(robot), random_motion(robot, 4)
    dynamics = build_dynamics(model)
    torque = model.torques(model.nominal, *motion)
    np.testing.assert_allclose(dynamics.acceleration(motion[0], motion[1], torque), motion[2], rtol=1e-8)
    # With the crank held and no gravity on it, the rod's weight does not reach motor 3.
    still = np.zeros((1, 3))
    columns = model.columns(motion[0][:1], still, still)[0]
    np.testing.assert_allclose(columns[2, model.names.index("rod.MX")], 0.0, atol=1e-12)


def test_the_loop_closes_everywhere_and_an_open_one_is_refused(tmp_path):
    robot = branch()
    positions = np.random.default_rng(0).uniform(robot.lower, robot.upper, (50, 3))
    gaps = pin_gaps(robot, positions)
    assert gaps.shape == (50, 1)
    assert gaps.max() < 1e-12
    for change, told in (
        (lambda d: d["loop_links"][0].update(turns={"arm": 1}), "S252"),
        (lambda d: d["loop_links"][1]["frame"].update(position_m=[-0.13, 0, 0]), "up to 10 mm from where it is fixed"),
        (lambda d: d["loop_links"][1].update(parent="crnk"), "did you mean `crank`"),
        (lambda d: d["loop_links"][1].update(turns={"elbow": 1}), "there is no joint `elbow`"),
        (lambda d: d["loop_links"][1]["pin"].update(joint="crank"), "there is no joint `crank`"),
        (lambda d: d["loop_links"][1].update(name="arm"), "S254"),
        (lambda d: d["loop_links"][1]["frame"].update(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), "not a rotation"),
        (lambda d: d["loop_links"][1]["link"]["inertia_kgm2"].update(zz=1.0), "S266"),
    ):
        changed = YAML(typ="safe").load(FILE)
        change(changed)
        YAML().dump(changed, tmp_path / "robot.yaml")
        with pytest.raises(SettingsError, match=told):
            load_robot(tmp_path / "robot.yaml")


def rewritten(folder, change):
    data = YAML(typ="safe").load(FILE)
    change(data)
    YAML().dump(data, folder / "robot.yaml")
    return load_robot(folder / "robot.yaml").to_robot()


def same_torques(robot, other, tolerance=IDENTITY):
    models = build_rigid_model(robot), build_rigid_model(other)
    motion = random_motion(robot, 6)
    first, second = (model.torques(model.nominal, *motion) for model in models)
    np.testing.assert_allclose(first, second, rtol=0, atol=tolerance * np.abs(first).max())


def test_where_angles_are_counted_from_is_free(tmp_path):
    def turned(data):
        half, root = 0.5, np.sqrt(0.75)
        rotation = [[root, half, 0], [-half, root, 0], [0, 0, 1]]  # -30 deg about z
        data["loop_links"][1]["frame"]["rotation"] = [[float(value) for value in row] for row in rotation]
        data["loop_links"][1]["offset_deg"] = 30

    same_torques(branch(), rewritten(tmp_path, turned))


BALANCE = {"carrier_point_m": [0.02, 0.1, 0.05], "link_point_m": [0.1, -0.02, 0.04], "free_length_m": 0.05}


def test_a_branch_from_a_foreign_file_is_given_in_the_frames_of_that_file(tmp_path):
    balance = {**BALANCE, "stiffness_n_m": 800, "preload_n": 4}
    wanted = rewritten(tmp_path, lambda data: data["joints"][1].update(counterbalance=balance))
    # In the file all bodies stand upright; the robot file turns arm and forearm so that z is their axis.
    upright = wanted.joints[1].rotation
    spec = mujoco.MjSpec()
    parent = spec.worldbody
    for joint, turn in zip(wanted.joints, (np.eye(3), upright, upright), strict=True):
        link = joint.link
        tensor = turn @ link.inertia_kgm2 @ turn.T
        parent = parent.add_body(name=joint.name, pos=turn @ joint.position_m, mass=link.mass_kg, explicitinertial=True)
        parent.ipos = turn @ link.com_m
        parent.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
        parent.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=turn[:, 2])
    spec.compile()
    (tmp_path / "branch.xml").write_text(spec.to_xml())

    def foreign(data):
        data["model"] = "branch.xml"
        for section in data["joints"]:
            del section["frame"], section["link"]
        ends = {key: (upright @ balance[key]).tolist() for key in ("carrier_point_m", "link_point_m")}
        data["joints"][1]["counterbalance"] = {**balance, **ends}
        data["loop_links"][1]["pin"]["held_point_m"] = (upright @ [-0.12, 0, 0.06]).tolist()
        data["loop_links"][2]["frame"] = {"position_m": [0.4, 0, 0], "rotation": upright.tolist()}

    found = rewritten(tmp_path, foreign)
    assert pin_gaps(found, random_motion(found, 5)[0]).max() < 1e-12
    # MuJoCo writes six digits.
    same_torques(wanted, found, FINITE_DIFFERENCE)
