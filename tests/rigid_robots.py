"""Random rigid chains, and the torques that MuJoCo gives them, for the tests of the regressor."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from exact_systems import NO_PAYLOAD
from robid.robot.description import Inertial, Joint, Motor, Robot, Spring
from robid.robot.friction import Friction
from robid.robot.model import build_model


def random_body(generator):
    """A body that could be: a few point masses and a small ball."""
    points, masses = generator.uniform(-0.4, 0.4, (5, 3)), generator.uniform(0.5, 3.0, 5)
    com = masses @ points / masses.sum()
    apart = points - com
    inertia = masses @ (apart**2).sum(axis=1) * np.eye(3) - (masses[:, None] * apart).T @ apart + 0.01 * np.eye(3)
    return Inertial(float(masses.sum()), com, inertia)


def random_chain(seed, n_joint=5, slides=0.4):
    """A chain of revolute and prismatic joints with tilted frames, any sign of gears, and a payload."""
    generator = np.random.default_rng(seed)
    joints = tuple(
        Joint(
            f"joint_{index}",
            generator.uniform(-0.5, 0.5, 3),
            Rotation.random(random_state=generator).as_matrix(),
            random_body(generator),
            -1.5,
            1.5,
            Motor(
                float(generator.uniform(1e-4, 1e-3)),
                float(generator.choice([-1, 1]) * generator.uniform(20, 200)),
                300.0,
                20.0,
                Friction(viscous_nms_rad=float(generator.uniform(0, 1e-2)), coulomb_nm=float(generator.uniform(0, 1))),
            ),
            type="prismatic" if generator.random() < slides else "revolute",
        )
        for index in range(n_joint)
    )
    payload = random_body(generator)
    return Robot(f"chain {seed}", generator.standard_normal(3) * 6, joints, (), payload)


def with_gears(robot, couplings=True):
    """The robot with transmissions, so that MuJoCo has its motors apart; each motor but the last moves the next arm."""
    gears = tuple(
        Spring(f"gear_{joint.name}", index, "transmission", np.array([0.0, 0.0, 1.0]), 1e5, 0.0)
        for index, joint in enumerate(robot.joints)
    )
    joints = list(robot.joints)
    for index in range(1, len(joints) if couplings else 0):
        joints[index] = replace(joints[index], couplings={joints[index - 1].name: 0.003 * index})
    return replace(robot, springs=gears, joints=tuple(joints))


def random_motion(robot, n_sample, seed=0):
    """Positions, speeds and accelerations (3, n_sample, n_joint) of the motors."""
    generator = np.random.default_rng(seed)
    return generator.uniform(-2, 2, (3, n_sample, len(robot.joints))) @ robot.motor_per_arm.T


def engine_torques(robot, motion):
    """Motor torques (n_sample, n_joint) of rigid bodies, rotors and viscous friction by MuJoCo."""
    model = build_model(robot)
    # Rotors that ride on links weigh a milligram there, so that MuJoCo compiles them.
    for body in range(model.mujoco.nbody):
        if model.mujoco.body(body).name.startswith("motor_"):
            model.mujoco.body_mass[body] = 0.0
    data, torque, found = mujoco.MjData(model.mujoco), np.empty(model.mujoco.nv), []
    viscous = np.array([joint.motor.friction.viscous_nms_rad for joint in robot.joints])
    for position, velocity, acceleration in motion.swapaxes(0, 1):
        for state, own in ((data.qpos, position), (data.qvel, velocity), (data.qacc, acceleration)):
            state[model.motor] = own / model.turns
            state[model.arm] = robot.arm_per_motor @ own
        mujoco.mj_kinematics(model.mujoco, data)
        mujoco.mj_comPos(model.mujoco, data)
        mujoco.mj_comVel(model.mujoco, data)
        mujoco.mj_rne(model.mujoco, data, 1, torque)
        rotor = np.where(robot.rigid, 0.0, torque[model.motor])
        if robot.rotor == "spong":
            rotor = robot.motor_inertia_kgm2 * acceleration
        found.append(robot.arm_per_motor.T @ torque[model.arm] + rotor + viscous * velocity)
    return np.array(found)


def planar_arm(n_joint, length_m=0.9, gravity=9.81):
    """Links in a vertical plane, one after the other along x, with gears of ratio 1 and no rotors worth naming."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    generator = np.random.default_rng(3)
    joints = tuple(
        Joint(
            f"joint{index + 1}",
            np.array([length_m if index else 0.0, 0.0, 0.0]),
            np.eye(3) if index else turn,
            random_body(generator),
            -3.0,
            3.0,
            Motor(1e-3, 1.0, 100.0, 100.0),
        )
        for index in range(n_joint)
    )
    return Robot("planar arm", np.array([0.0, 0.0, -gravity]), joints, (), NO_PAYLOAD)
