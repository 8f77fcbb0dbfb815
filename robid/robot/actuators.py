"""The drives of the elastic robot in MuJoCo.

Rotors and shafts, motor torques, and friction and ripple as passive actuators.
"""

from __future__ import annotations

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import HarmonicBalance, Joint, Robot, Spring
from robid.robot.friction import Bristles, FrictionLaw

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


def motor_drives(robot: Robot) -> list[tuple[str, float]]:
    """The MuJoCo joint that each motor drives, and the motor's angle per unit of it."""
    return [
        (f"q_a_{joint.name}", joint.motor.gear_ratio) if rigid else (f"q_m_{joint.name}", 1.0)
        for joint, rigid in zip(robot.joints, robot.rigid, strict=True)
    ]


def add_torque(
    spec: mujoco.MjSpec,
    joint: Joint,
    drive: tuple[str, float],
    *,
    friction: FrictionLaw | None,
    ripple: bool,
    second_ripple: tuple[float, int] = (0.0, 1),
) -> None:
    """Adds a motor's torque, and bristles and ripple inside the integrator, the second by amplitude and order."""
    actuator = _add_actuator(spec, f"torque_{joint.name}", drive)
    actuator.set_to_motor()
    motor = joint.motor
    form = friction.in_engine(motor.friction) if friction and motor.friction.coulomb_nm > 0 else None
    lugre = form.lugre if isinstance(form, Bristles) else None
    cogging = [motor.ripple_nm, motor.ripple_order, motor.ripple_phase_rad] if ripple and motor.ripple_nm > 0 else None
    if lugre or cogging:
        passive = _add_actuator(spec, f"friction_{joint.name}", drive)
        set_passive(passive, lugre=lugre, cogging=cogging)
    if second_ripple[0] > 0:
        set_passive(_add_actuator(spec, f"ripple_{joint.name}", drive), cogging=[*second_ripple, 0.0])


def add_balance(spec: mujoco.MjSpec, joint: Joint, balance: HarmonicBalance) -> None:
    """Adds the torque of a counterbalance on a joint's arm, one passive actuator for each harmonic."""
    for order, (sine, cosine) in enumerate(zip(balance.sine_nm, balance.cosine_nm, strict=True), start=1):
        actuator = _add_actuator(spec, f"balance_{joint.name}_{order}", (f"q_a_{joint.name}", 1.0))
        set_passive(actuator, cogging=[float(np.hypot(sine, cosine)), order, float(np.arctan2(cosine, sine))])


def _add_actuator(spec: mujoco.MjSpec, name: str, drive: tuple[str, float]) -> mujoco.MjsActuator:
    """Adds an actuator whose length is the motor's angle."""
    actuator = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=drive[0])
    actuator.gear = [drive[1], 0.0, 0.0, 0.0, 0.0, 0.0]
    return actuator


def add_ramps(spec: mujoco.MjSpec, joint: Joint, drive: tuple[str, float], law: FrictionLaw) -> None:
    """Adds friction to a motor that has no memory in the engine, as clipped ramps."""
    ramps = law.in_engine(joint.motor.friction)
    if isinstance(ramps, Bristles) or joint.motor.friction.coulomb_nm == 0:
        return
    for number, (slope, level) in enumerate(zip(ramps.slope.tolist(), ramps.level.tolist(), strict=True)):
        ramp = _add_actuator(spec, f"friction_{joint.name}_{number}", drive)
        # The gain of 1 on a control that stays zero keeps MuJoCo from reading the slope as a damping ratio.
        ramp.set_to_motor()
        ramp.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        ramp.biasprm = np.concatenate([[0.0, 0.0, -slope], np.zeros(7)])
        ramp.forcelimited, ramp.forcerange = 1, [-level, level]


def friction_rows(model: mujoco.MjModel, robot: Robot, law: FrictionLaw) -> list[tuple[int, int]]:
    """Returns the motor and the index of every actuator that rubs on it."""
    rows = []
    for motor, joint in enumerate(robot.joints):
        if joint.motor.friction.coulomb_nm > 0:
            form = law.in_engine(joint.motor.friction)
            parts = [""] if isinstance(form, Bristles) else [f"_{number}" for number in range(len(form.slope))]
            rows += [(motor, int(model.actuator(f"friction_{joint.name}{part}").id)) for part in parts]
    return rows


def set_passive(
    actuator: mujoco.MjsActuator, *, lugre: list[float] | None = None, cogging: list[float] | None = None
) -> None:
    """Makes an actuator passive: it has no control, only bristles and cogging."""
    actuator.set_to_dcmotor(
        motorconst=[0.0, 0.0],
        resistance=1.0,
        lugre=lugre or [0.0] * 5,
        cogging=cogging or [0.0] * 3,
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
    )
