"""Inverse dynamics of the elastic robot: the motor motion and torque that move the arm along a given path."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import make_interp_spline

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.linearize import Equilibrium
from robid.robot.model import ElasticModel

_STEPS = 30
_TOLERANCE_RAD = 1e-11
_SMOOTH = 5  # degree of the splines that are differentiated twice


@dataclass(frozen=True)
class MotorMotion:
    """What the motors must do.

    Attributes:
        angle (n_time, n_joint): Motor angles [rad].
        torque (n_time, n_joint): Motor torques, viscous friction included [N m].
    """

    angle: FloatArray
    torque: FloatArray


def inverse_motion(
    model: ElasticModel, rest: Equilibrium, motion: FloatArray, period_s: float, stride: int = 1
) -> MotorMotion:
    """Finds the motor motion and torque of a given arm motion.

    The torque that the arm needs deflects the transmissions, with their dampers; the motors turn by arm angle
    and deflection, so that the arm's acceleration enters with two further derivatives. All other springs deflect
    quasi-statically: their rates are neglected, which keeps the inverse stable where the arm is non-minimum phase.

    Args:
        model: The elastic model.
        rest: Where it rests before the motion; one configuration.
        motion (3, n_time, n_joint): Arm angles from rest, speeds and accelerations [rad, rad/s, rad/s^2].
        period_s: Time between samples [s].
        stride: Samples from one evaluation of the rigid dynamics to the next; splines fill in.

    Returns:
        Motor angles and torques at all samples.

    Raises:
        DataError: If the springs give way.

    Source:
        METHODS sec. 10; Zimmermann et al. (2023), eq. 1 and sec. V-E.
    """
    n_time = motion.shape[1]
    to_motor, to_arm = model.robot.motor_per_arm, model.robot.arm_per_motor
    inertia = model.robot.motor_inertia_kgm2
    time, coarse = period_s * np.arange(n_time), np.arange(0, n_time, stride)
    if coarse[-1] != n_time - 1:
        coarse = np.append(coarse, n_time - 1)
    whole = rest.position[0, model.motor] + motion[0] @ to_motor.T, *(motion[1:] @ to_motor.T)
    # Rotors that ride on the links feel their motion and the links theirs; one more round settles that.
    for _ in range(2 if model.robot.rotor == "on_link" else 1):
        needed = _rigid_torques(model, rest, motion[:, coarse], np.array(whole)[:, coarse])
        spline = make_interp_spline(time[coarse], needed, k=_SMOOTH)
        torque = np.asarray(spline(time))
        n_joint = len(model.arm)
        gear = _gear_deflection(model, torque[:, n_joint:], period_s)
        bend = make_interp_spline(time, gear - gear[0], k=_SMOOTH)
        before = whole
        angle = rest.position[0, model.motor] + (motion[0] + bend(time)) @ to_motor.T
        rates = [(motion[order] + bend(time, nu=order)) @ to_motor.T for order in (1, 2)]
        whole = angle, *rates
    viscous = np.array([joint.motor.friction.viscous_nms_rad for joint in model.robot.joints])
    drive = torque[:, :n_joint] + inertia * (whole[2] - before[2]) + viscous * whole[1]
    return MotorMotion(np.asarray(whole[0]), np.asarray(drive + torque[:, n_joint:] @ to_arm))


def _rigid_torques(model: ElasticModel, rest: Equilibrium, arm: FloatArray, motor: FloatArray) -> FloatArray:
    """Torques (n_time, 2 n_joint) on motors and arm angles besides springs, further springs quasi-static [N m]."""
    data = mujoco.MjData(model.mujoco)
    elastic = np.setdiff1d(model.passive, model.arm)
    rows = [int(np.flatnonzero(model.deflection[:, index])[0]) for index in elastic]
    springs = [model.robot.springs[row] for row in rows]
    linear = np.array([spring.stiffness_nm_rad for spring in springs])
    cubic = np.array([spring.cubic_nm_rad3 for spring in springs])
    deflection = rest.position[0, elastic].copy()
    torque, found = np.zeros(model.mujoco.nv), np.empty((arm.shape[1], 2 * len(model.arm)))
    for sample in range(arm.shape[1]):
        for values, which in ((data.qpos, 0), (data.qvel, 1), (data.qacc, 2)):
            values[model.motor], values[model.arm] = motor[which, sample], arm[which, sample]
        data.qpos[model.arm] += rest.position[0, model.arm]
        for _ in range(_STEPS):
            data.qpos[elastic] = deflection
            mujoco.mj_kinematics(model.mujoco, data)
            mujoco.mj_comPos(model.mujoco, data)
            mujoco.mj_comVel(model.mujoco, data)
            mujoco.mj_rne(model.mujoco, data, 1, torque)
            step = torque[elastic] + linear * deflection + cubic * deflection**3
            step /= linear + 3 * cubic * deflection**2
            deflection -= step
            if not step.size or np.abs(step).max() < _TOLERANCE_RAD:
                break
        else:
            message = "the inverse dynamics find no deflections; the springs give way"
            raise DataError(message, where=model.robot.name, remedy="check stiffness values and payload of the robot")
        found[sample] = np.concatenate([torque[model.motor], torque[model.arm]])
    return found


def _gear_deflection(model: ElasticModel, torque: FloatArray, period_s: float) -> FloatArray:
    """Deflections (n_time, n_joint) of the transmissions under a torque that begins at rest, dampers included."""
    gears = {spring.joint: spring for spring in model.robot.springs if spring.place == "transmission"}
    ordered = [gears[joint] for joint in range(len(model.arm))]
    linear = np.array([spring.stiffness_nm_rad for spring in ordered])
    cubic = np.array([spring.cubic_nm_rad3 for spring in ordered])
    rate = np.array([spring.damping_nms_rad for spring in ordered]) / (2 * period_s)
    found = np.empty_like(torque)
    before = last = _bend(torque[0], linear, cubic, torque[0] / linear)
    for sample, wanted in enumerate(torque):
        # Second-order backward differences: stable for any damper, exact statics without one.
        load = wanted + rate * (4 * last - before)
        before, last = last, _bend(load, linear + 3 * rate, cubic, last)
        found[sample] = last
    return found


def _bend(torque: FloatArray, linear: FloatArray, cubic: FloatArray, start: FloatArray) -> FloatArray:
    """Solves `linear d + cubic d^3 = torque` by Newton steps."""
    deflection = start
    for _ in range(_STEPS):
        step = (linear * deflection + cubic * deflection**3 - torque) / (linear + 3 * cubic * deflection**2)
        deflection = deflection - step
        if np.abs(step).max() <= 1e-15 + 1e-13 * np.abs(deflection).max():
            break
    return np.asarray(deflection)
