"""The periodic steady state of a closed loop near its rest: where a simulation starts so that little has to settle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.simulate.closed_loop import ClosedLoop, Told
from robid.simulate.engine import rest_of, true_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.truth import with_imperfections

_STEP = 1e-6
_PASSES = 2  # Speeds decide how much friction damps, and the other way round
_SILENT = 1e-9  # of the largest amplitude: what is told at no line
_MOST_LINES = 500
_FAR = 0.1  # Arms' motion from rest, RMS, beyond which the linearised loop says little [rad, or m]
_KEPT = 1 - 1e-7  # What differences cannot tell from keeping all of it
_FORGOTTEN = 3e-3
"""What the loop keeps of where it began. Where friction makes the prediction wrong by a tenth, and bristles forget as
the loop does, 1e-4 of the motion is left in the first sample, and 1e-5 of it in a period."""


@dataclass(frozen=True)
class Start:
    """Where to start, and how long before the record."""

    state: FloatArray  # (n_sim, n_state) As `ClosedLoop.state`
    samples: int  # Samples before the first of a period


@dataclass(frozen=True)
class _Linear:
    """A sampled closed loop to first order: `x[k+1] = A x[k] + B r[k]`, x a deviation from rest."""

    step: FloatArray  # (n_state, n_state) A
    told: FloatArray  # (n_state, 3 n_motor) B
    angle: FloatArray  # (n_motor, n_state) Motor angles by states [rad]
    speed: FloatArray  # (n_motor, n_state) Motor speeds by states [rad/s]


def steady_start(
    told: Told, robot: Robot, controller: Controller, options: SimulateOptions, configuration: FloatArray, index: int
) -> Start | None:
    """Predicts the periodic steady state from the loop to first order, with friction as dampers that take its power.

    Args:
        told: What the loops are told.
        robot: The true robot.
        controller: Its controller.
        options: What is not linear or not exact; the steps per sample are settled.
        configuration (n_joint,): Where the robot rests [rad, or m].
        index: The configuration's index.

    Returns:
        None where the loop does not forget where it began, is told too many lines, or moves the arms far.
    """
    # Of real signals, lines above zero count twice, for what mirrors them.
    amplitude = rfft(np.concatenate([told.speed, told.angle, told.torque], axis=2), axis=0, norm="forward")
    size = np.abs(amplitude).max(axis=(1, 2))
    lines, n_sample = np.flatnonzero(size > _SILENT * size.max(initial=0.0)), len(told.speed)
    if len(lines) > _MOST_LINES:
        return None
    turn = np.exp(2j * np.pi * lines / n_sample)
    share = np.where(2 * lines % n_sample == 0, 1.0, 2.0)[:, None, None]
    coulomb = np.array([joint.motor.friction.coulomb_nm for joint in robot.joints])
    coulomb = coulomb * (options.imperfections.friction != "none")
    damping: FloatArray = np.zeros(coulomb.size)
    samples = 0
    for _ in range(_PASSES if coulomb.any() else 1):
        loop = _linear_loop(_damped(robot, damping), controller, options, configuration, index)
        needed = _settling_samples(loop.step)
        if needed is None:
            return None
        samples = needed
        # x[k+1] = A x[k] + B r[k] at z = exp(2 pi j m / N): X = (z - A)^-1 B R.
        driven = loop.told @ np.swapaxes(amplitude[lines], 1, 2)
        state = np.linalg.solve(turn[:, None, None] * np.eye(len(loop.step)) - loop.step, driven)
        speed_rms = np.sqrt((share * np.abs(loop.speed @ state) ** 2).sum(axis=0).mean(axis=-1))
        damping = sliding_friction(coulomb, speed_rms)
    arm_rms = np.sqrt((share * np.abs(robot.arm_per_motor @ loop.angle @ state) ** 2).sum(axis=0))
    return None if arm_rms.max() > _FAR else Start(_at(share * state, turn, -samples), samples)


def sliding_friction(coulomb_nm: FloatArray, speed_rms: FloatArray) -> FloatArray:
    """Viscous friction [N m s/rad] that takes from a Gaussian speed the power that Coulomb friction takes.

    Source:
        Gelb and Vander Velde (1968), Multiple-input describing functions, ch. 7: an ideal relay and random input.
    """
    moving = np.maximum(speed_rms, np.finfo(float).tiny)
    return np.where(speed_rms > 0, np.sqrt(2 / np.pi) * coulomb_nm / moving, 0.0)


def _settling_samples(step: FloatArray) -> int | None:
    """Samples after which a deviation is all but forgotten; None where one stays."""
    slowest = float(np.abs(np.linalg.eigvals(step)).max()) if np.isfinite(step).all() else np.inf
    return int(np.ceil(np.log(_FORGOTTEN) / np.log(slowest))) if 0 < slowest < _KEPT else None


def _at(state: ComplexArray, turn: ComplexArray, sample: int) -> FloatArray:
    """The periodic state (n_sim, n_state) at a sample, from its amplitudes (n_line, n_state, n_sim) above zero."""
    return np.asarray(np.tensordot(turn**sample, state, axes=1).real.T)


def _damped(robot: Robot, damping: FloatArray) -> Robot:
    """The robot with more viscous friction of its motors."""
    joints = []
    for joint, more in zip(robot.joints, damping.tolist(), strict=True):
        friction = joint.motor.friction
        friction = replace(friction, viscous_nms_rad=friction.viscous_nms_rad + more)
        joints.append(replace(joint, motor=replace(joint.motor, friction=friction)))
    return replace(robot, joints=tuple(joints))


def _linear_loop(
    robot: Robot, controller: Controller, options: SimulateOptions, configuration: FloatArray, index: int
) -> _Linear:
    """Central differences of one sample of the simulation itself, without noise and what is not smooth."""
    flaws = options.imperfections
    smooth = Imperfections(viscous_drift=flaws.viscous_drift, drift_configurations=flaws.drift_configurations)
    settled = replace(options, imperfections=smooth)
    model = true_model(with_imperfections(robot, flaws), controller, settled, index, sensors=False)
    rest, n_told = rest_of(model, configuration, smooth), 3 * len(robot.joints)

    def begun(moves: FloatArray) -> ClosedLoop:
        told = Told(*np.split(moves[None], 3, axis=2))
        return ClosedLoop(model, rest, controller, settled, told)

    n_state = begun(np.zeros((1, n_told))).state.shape[1]
    moves = np.vstack([side * _STEP * np.eye(n_state + n_told) for side in (1, -1)])
    loop = begun(moves[:, n_state:])
    loop.begin(moves[:, :n_state])
    torque, angle = np.empty((2, 1, len(moves), len(robot.joints)))
    loop.play(torque, angle, np.random.default_rng(0))
    ahead, behind = np.split(loop.state, 2)
    slope = (ahead - behind).T / (2 * _STEP)
    # Speeds of coordinates follow their positions.
    angle = np.pad(model.motor_rows, ((0, 0), (0, n_state - model.mujoco.nv)))
    return _Linear(slope[:, :n_state], slope[:, n_state:], angle, np.roll(angle, model.mujoco.nv, axis=1))
