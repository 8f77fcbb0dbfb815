"""What turns on the motors' side in MuJoCo: rotors, and shafts between them and their transmissions."""

from __future__ import annotations

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Joint, Robot, Spring

MASSLESS_KG = 1e-6
_ACROSS = 0.5 + 1e-9  # a thin disc's, and so much more that printing it leaves an inertia that a body can have


def add_motor(parent: mujoco.MjsBody, joint: Joint, offset: FloatArray, rotor: str) -> mujoco.MjsBody:
    """Adds a motor; `on_link` it rides on its parent."""
    body = _add_disc(parent, f"motor_{joint.name}", joint.motor.inertia_kgm2)
    if rotor == "on_link":
        body.pos = joint.position_m - offset
        body.quat = quaternion_of(joint.rotation)
    hinge = body.add_joint(name=f"q_m_{joint.name}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    hinge.damping = np.array([joint.motor.friction.viscous_nms_rad, 0.0, 0.0])
    return body


def _add_disc(parent: mujoco.MjsBody, name: str, inertia_kgm2: float) -> mujoco.MjsBody:
    """Adds a thin disc without weight that turns about z."""
    body = parent.add_body(name=name, mass=MASSLESS_KG, explicitinertial=True)
    body.inertia = np.array([_ACROSS, _ACROSS, 1.0]) * inertia_kgm2
    # Left open, MuJoCo takes the body's own pose in its parent for the pose of its inertia.
    body.ipos, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    return body


def add_shafts(rotor: mujoco.MjsBody, robot: Robot, index: int) -> None:
    """Adds what twists between a motor and its transmission, each carried by the one before."""
    for spring in shafts_of(robot, index):
        rotor = _add_disc(rotor, f"shaft_{spring.name}", spring.inertia_kgm2)
        add_elastic_hinge(rotor, spring)


def shafts_of(robot: Robot, index: int) -> list[Spring]:
    """Returns the shafts of a joint, from its motor on."""
    return [spring for spring in robot.springs if spring.place == "shaft" and spring.joint == index]


def add_elastic_hinge(body: mujoco.MjsBody, spring: Spring) -> None:
    """Adds a hinge with a spring-damper to a body."""
    hinge = body.add_joint(name=f"q_e_{spring.name}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=spring.axis)
    hinge.stiffness = np.array([spring.stiffness, 0.0, spring.cubic])
    hinge.damping = np.array([spring.damping, 0.0, 0.0])


def quaternion_of(rotation: FloatArray) -> FloatArray:
    """Returns the unit quaternion (4,) of a rotation (3, 3)."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.asarray(rotation, float).ravel())
    return quaternion
