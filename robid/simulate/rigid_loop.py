"""A rigid model in the loop of the robot's controller: motions without noise, as instruments need them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot
from robid.robot.regressor.forward import RigidDynamics, build_dynamics
from robid.robot.regressor.model import RigidModel
from robid.simulate.controller import Cascade
from robid.simulate.options import Controller

_LOST_RAD_S = 1e6
_SETTLED = 1.0  # steps in which friction may reverse a motor at most


def simulate_rigid_loop(
    model: RigidModel,
    parameters: FloatArray,
    robot: Robot,
    controller: Controller,
    command: FloatArray,
    feed_forward: FloatArray | None = None,
    *,
    loaded: bool = True,
    measure: Callable[[FloatArray], FloatArray] | None = None,
    substeps: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Simulates the closed loop of a rigid model with what its encoders do.

    Args:
        model: The model.
        parameters (n_param,) or (n_run, n_param): Values of its columns, the same for all runs or one row for each.
        robot: The robot, for limits and for the rotor inertias that the controller was tuned to.
        controller: Its controller.
        command (n_run, n_sample, n_joint): Motor angles that it is told [rad].
        feed_forward (n_run, n_sample, n_joint): Motor speeds that it is told besides; none by default [rad/s].
        loaded: Whether a payload with parameters of its own is there.
        measure: What the encoders say of motor angles (n_run, n_joint); the angles themselves by default.
        substeps: Integration steps per sampling period.

    Returns:
        True motor angles (n_run, n_sample, n_joint) [rad], and motor torques that are held from each sample on [N m].
        From where a run is lost, as with parameters that no body has, all are NaN.
    """
    period = controller.sampling_period_s
    still = build_dynamics(model, parameters, loaded=loaded)
    smoothing = _smoothing(still, command[:, 0], period / substeps)
    dynamics = build_dynamics(model, parameters, loaded=loaded, smoothing_rad_s=smoothing)
    angle: FloatArray = command[:, 0].copy()
    speed: FloatArray = (command[:, 1] - command[:, 0]) / period
    limit = np.array([joint.motor.max_torque_nm for joint in robot.joints])
    hold = dynamics.inertia_and_bias(angle, np.zeros_like(speed))[1]
    cascade = Cascade(controller, robot.motor_inertia_kgm2, limit, angle - period * speed, hold)
    pending = [hold.copy() for _ in range(controller.delay_samples)]
    angles, torques = np.full_like(command, np.nan), np.full_like(command, np.nan)
    ahead = np.zeros_like(command) if feed_forward is None else feed_forward
    for sample in range(command.shape[1]):
        seen = angle if measure is None else measure(angle)
        pending.append(cascade.command(seen, command[:, sample], ahead[:, sample]))
        angles[:, sample], torques[:, sample] = angle, pending.pop(0)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(substeps):
                angle, speed = _step(dynamics, angle, speed, torques[:, sample], period / substeps)
        if not np.all(np.abs(speed) < _LOST_RAD_S):
            break
    return angles, torques


def _step(
    dynamics: RigidDynamics, angle: FloatArray, speed: FloatArray, torque: FloatArray, period: float
) -> tuple[FloatArray, FloatArray]:
    """One step of Heun's method under a constant torque."""
    first = dynamics.acceleration(angle, speed, torque)
    ahead = speed + period * first
    second = dynamics.acceleration(angle + period * speed, ahead, torque)
    mean = 0.5 * (first + second)
    return angle + period * (speed + 0.5 * period * mean), speed + period * mean


def _smoothing(dynamics: RigidDynamics, angle: FloatArray, period: float) -> float:
    """Speed over which friction changes its sign, so that a step hardly reverses a motor [rad/s]."""
    inertia, _ = dynamics.inertia_and_bias(angle, np.zeros_like(angle))
    own = np.diagonal(inertia, axis1=1, axis2=2).min(axis=0)
    dry = sum(
        (np.abs(value).max() * np.abs(term.row) for term, value in dynamics.terms if term.kind.endswith("coulomb")),
        start=np.zeros_like(own),
    )
    return float((dry * period / np.maximum(own, 1e-300)).max() / _SETTLED) or 1e-9
