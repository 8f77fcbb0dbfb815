"""Inverse dynamics of the elastic robot: the motor motion and torque that move the arm along a given path."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.interpolate import make_interp_spline

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.linearize import Equilibrium, unload
from robid.robot.model import ElasticModel, site_name

_STEPS = 30
_TOLERANCE_RAD = 1e-11
_SINGULAR = 0.05  # no arm turns from directions that move the tool less than this share of the best one
_LEVER_M = 0.5  # turns of the tool count by what they do at this distance
_SETTLED = 30  # time constants
_SMOOTH = 5  # degree of the splines that are differentiated twice


@dataclass(frozen=True)
class MotorMotion:
    """What the motors must do."""

    angle: FloatArray  # (n_time, n_joint) Motor angles [rad]
    torque: FloatArray  # (n_time, n_joint) Motor torques, viscous friction of motors and arms included [N m]


def inverse_motion(
    model: ElasticModel, rest: Equilibrium, motion: FloatArray, period_s: float, stride: int = 1
) -> MotorMotion:
    """Finds the motor motion and torque at all samples that move the tool as a rigid robot would.

    Stiffness that depends on a joint's position stays as it is at rest. The springs beyond the transmissions deflect
    quasi-statically under the torques of the rigid motion, and the arm angles make good what they do to the tool. The
    torque that the arm then needs deflects the transmissions, with their dampers; the motors turn by arm angle and
    deflection.

    Args:
        model: The elastic model of a robot with its tool point as its first sensor.
        rest: Where it rests before the motion; one configuration.
        motion (3, n_time, n_joint): Angles of the rigid robot from rest, speeds, accelerations, not all of them zero
            [rad, rad/s, rad/s^2].
        period_s: Time between samples [s].
        stride: Samples from one evaluation of the rigid dynamics to the next; splines fill in.

    Raises:
        DataError: If the springs give way, or a shaft lies between a motor and its transmission.

    Source:
        docs/methods, sec. 10; Zimmermann et al. (2023), eq. 1 and sec. V-E.
    """
    if any(spring.place == "shaft" for spring in model.robot.springs):
        message, remedy = (
            "D203 the inverse dynamics know no shafts",
            "step robots whose transmissions follow their motors",
        )
        raise DataError(message, where=model.robot.name, remedy=remedy)
    n_time, n_joint = motion.shape[1:]
    to_motor = model.robot.motor_per_arm
    time = period_s * np.arange(n_time)
    # Rigid-body torques are smooth: evaluated at every `stride`-th sample, splines between.
    coarse = np.unique(np.append(np.arange(0, n_time, stride), n_time - 1))
    busy = np.flatnonzero(motion[1:, coarse].any(axis=(0, 2)))
    # Nothing changes before the move, nor after it once the dampers have let go.
    lag = max((spring.damping / spring.stiffness for spring in model.robot.springs), default=0.0)
    # After the move dampers let go with the time constant d / k; thirty of these are enough.
    late = busy[-1] + 2 + round(_SETTLED * lag / (stride * period_s))
    held = np.clip(np.arange(coarse.size), max(busy[0] - 1, 0), min(late, coarse.size - 1))
    moving, held = coarse[held[0] : held[-1] + 1], held - held[0]
    dynamics = _Dynamics(model, rest)
    elastic = dynamics.settle(dynamics.whole(motion[:, moving], motion[:, moving] @ to_motor.T))
    bent = make_interp_spline(time[coarse], (elastic - elastic[0])[held], k=_SMOOTH)
    # Deflections of the further springs with their rates and accelerations, from splines of degree 5.
    bend = np.array([bent(time, nu=order) for order in range(3)])
    # Arm angles make good what the deflections do to the tool.
    arm = motion - bend @ _tool_effect(model, rest).T
    motor = arm @ to_motor.T
    # Rotors that ride on the links feel their motion and the links theirs; one more round settles that.
    for _ in range(2 if model.robot.rotor == "on_link" else 1):
        needed = dynamics.torques(dynamics.whole(arm[:, moving], motor[:, moving], bend[:, moving]))[held]
        torque = np.asarray(make_interp_spline(time[coarse], needed, k=_SMOOTH)(time))
        # The motor leads its arm by the gear's deflection under the torque that the arm needs.
        gear = _gear_deflection(model, rest, torque[:, n_joint:], period_s)
        turned = make_interp_spline(time, gear - gear[0], k=_SMOOTH)
        before, motor = motor, (arm + np.array([turned(time, nu=order) for order in range(3)])) @ to_motor.T
    viscous = np.array([joint.motor.friction.viscous_nms_rad for joint in model.robot.joints])
    # What the rigid-body torques lack: the rotors' later motion, and all of rotors that are part of their arms.
    further = np.where(model.robot.rigid, motor[2], motor[2] - before[2])
    drive = np.where(model.robot.rigid, 0.0, torque[:, :n_joint])
    drive = drive + model.robot.motor_inertia_kgm2 * further + viscous * motor[1]
    angle = model.motor_angles(rest.position[0]) + motor[0]
    return MotorMotion(angle, np.asarray(drive + torque[:, n_joint:] @ model.robot.arm_per_motor))


class _Dynamics:
    """Rigid-body torques around one rest position."""

    def __init__(self, model: ElasticModel, rest: Equilibrium) -> None:
        self._model, self._data, self._rest = model.mujoco, mujoco.MjData(model.mujoco), rest.position[0]
        self._whole = model
        self._motor, self._arm, self._arm_viscous = model.motor, model.arm, model.robot.arm_viscous
        self._elastic = np.setdiff1d(model.passive, model.arm)
        rows = [int(np.flatnonzero(model.deflection[:, index])[0]) for index in self._elastic]
        springs = [model.robot.springs[row] for row in rows]
        factor = model.varying.factors(self._rest)[rows]
        self._linear = factor * np.array([spring.stiffness for spring in springs])
        self._cubic = factor * np.array([spring.cubic for spring in springs])
        self._name = model.robot.name

    def whole(self, arm: FloatArray, motor: FloatArray, elastic: FloatArray | None = None) -> FloatArray:
        """Puts coordinates, rates and accelerations (3, n_time, n_dof) together; positions count from rest."""
        result = np.zeros((*arm.shape[:2], self._rest.size))
        result[..., self._motor] = motor
        result[..., self._arm] = arm
        if elastic is not None:
            result[..., self._elastic] = elastic
        result[0] += self._rest
        return result

    def torques(self, states: FloatArray) -> FloatArray:
        """Torques (n_time, 2 n_joint) that motors and arm angles need besides those of the springs [N m]."""
        wanted = np.concatenate([self._motor, self._arm])
        needed = np.array([self._torque(*state)[wanted] for state in states.swapaxes(0, 1)])
        needed[:, self._arm.size :] += self._arm_viscous * states[1][:, self._arm]
        return needed

    def settle(self, states: FloatArray) -> FloatArray:
        """Deflections (n_time, n_elastic) at which the further springs carry what the rigid motion asks [rad]."""
        found = np.empty((states.shape[1], self._elastic.size))
        deflection = self._rest[self._elastic].copy()
        for sample, (position, rate, acceleration) in enumerate(states.swapaxes(0, 1)):
            for _ in range(_STEPS):
                position[self._elastic] = deflection
                step = self._torque(position, rate, acceleration)[self._elastic]
                # Residual: rigid-body torque on the elastic coordinate plus the spring's own; the Jacobian neglects
                # gravity's gradient.
                step += self._linear * deflection + self._cubic * deflection**3
                step /= self._linear + 3 * self._cubic * deflection**2
                deflection -= step
                if not step.size or np.abs(step).max() < _TOLERANCE_RAD:
                    break
            else:
                remedy = "check stiffness values and payload of the robot"
                raise DataError("D204 its springs give way in the inverse dynamics", where=self._name, remedy=remedy)
            found[sample] = deflection
        return found

    def _torque(self, position: FloatArray, rate: FloatArray, acceleration: FloatArray) -> FloatArray:
        data, torque = self._data, np.empty(self._rest.size)
        data.qpos[:], data.qvel[:], data.qacc[:] = position, rate, acceleration
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_comVel(self._model, data)
        mujoco.mj_rne(self._model, data, 1, torque)
        unload(self._whole, position, torque)
        return torque


def _tool_effect(model: ElasticModel, rest: Equilibrium) -> FloatArray:
    """Smallest arm turns (n_joint, n_elastic) that move the tool as deflections of the further springs do."""
    data, moving = mujoco.MjData(model.mujoco), np.zeros((6, model.mujoco.nv))
    data.qpos[:] = rest.position[0]
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    site = model.mujoco.site(site_name(model.robot.sensors[0])).id
    mujoco.mj_jacSite(model.mujoco, data, moving[:3], moving[3:], site)
    # Turns in metres at a lever, so that one pseudo-inverse weighs both alike.
    moving[3:] *= _LEVER_M
    elastic = np.setdiff1d(model.passive, model.arm)
    return np.asarray(np.linalg.pinv(moving[:, model.arm], rcond=_SINGULAR) @ moving[:, elastic])


def _gear_deflection(model: ElasticModel, rest: Equilibrium, torque: FloatArray, period_s: float) -> FloatArray:
    """Deflections (n_time, n_joint) of the transmissions under a torque that begins at rest, dampers included."""
    rows = [row for row, spring in enumerate(model.robot.springs) if spring.place == "transmission"]
    gears, factor = [model.robot.springs[row] for row in rows], model.varying.factors(rest.position[0])[rows]
    linear = factor * np.array([spring.stiffness for spring in gears])
    cubic = factor * np.array([spring.cubic for spring in gears])
    rate = np.array([spring.damping for spring in gears]) / (2 * period_s)
    whole, joints = np.zeros_like(torque), [spring.joint for spring in gears]
    torque = torque[:, joints]
    found = np.empty_like(torque)
    before = last = _bend(torque[0], linear, cubic, torque[0] / linear)
    for sample, wanted in enumerate(torque):
        # Second-order backward differences: stable for any damper, exact statics without one.
        # BDF2: d x' ~ d (3 x - 4 x_1 + x_2) / (2 T), of which the known part goes to the right-hand side.
        load = wanted + rate * (4 * last - before)
        before, last = last, _bend(load, linear + 3 * rate, cubic, last)
        found[sample] = last
    whole[:, joints] = found
    return whole


def _bend(torque: FloatArray, linear: FloatArray, cubic: FloatArray, start: FloatArray) -> FloatArray:
    """Solves `linear d + cubic d^3 = torque` by Newton steps."""
    if not cubic.any():
        return np.asarray(torque / linear)
    deflection = start
    for _ in range(_STEPS):
        step = (linear * deflection + cubic * deflection**3 - torque) / (linear + 3 * cubic * deflection**2)
        deflection = deflection - step
        if np.abs(step).max() <= 1e-15 + 1e-13 * np.abs(deflection).max():
            break
    return np.asarray(deflection)
