"""How many steps of the integrator a controller sample needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.friction import LAWS, stacked_coefficients
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.robot.statespace import StateSpace, discretise, state_space
from robid.simulate.controller import angle_reference
from robid.simulate.drives import changes_within
from robid.simulate.gear_error import refuse_fast_errors
from robid.simulate.options import STEP_LIMITS, Controller, SimulateOptions
from robid.simulate.truth import with_imperfections

_MOST = 64
_FAR = 0.3  # [rad, or m]: farther than any perturbation
_CONFIGURATIONS = 8
_GROWTH = 1e-6
_WITHIN_SAMPLE = 4.0  # steps: at a twelfth of the sampling rate the mean over one is off by 0.2 %
_TAYLOR = [1 / 24, 1 / 6, 1 / 2, 1.0, 1.0]


@dataclass(frozen=True)
class Steps:
    """How many RK4 steps per controller sample, and what asks for as many, in a phrase."""

    count: int
    reason: str


def choose_steps(
    robot: Robot,
    controller: Controller,
    options: SimulateOptions,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    peak_speed: FloatArray,
) -> Steps:
    """Chooses the number of steps per sample unless the options state it.

    The stiffest modes: RK4 turns each eigenvalue's `exp(lambda h)` into its Taylor polynomial of fourth order. The
    sampled response that it gives differs from the exact one by at most a thousandth of its norm at every line.
    Friction has needs of its own: `FrictionLaw.step_needs`.

    Args:
        robot: The true robot.
        controller: Its controller.
        options: Imperfections, and the number where it is stated.
        configurations (n_conf, n_joint): Arm-side angles; eight of them are looked at [rad].
        frequency_hz (n_freq,): Frequencies at which the response matters [Hz].
        peak_speed (n_joint,): Highest speed that each motor is told [rad/s].

    Raises:
        DataError: If transmission errors change too fast for the samples.
    """
    refuse_fast_errors(robot, options.imperfections, controller.sampling_period_s, peak_speed)
    if options.steps_per_sample is not None:
        return Steps(options.steps_per_sample, "as stated")
    period_s = controller.sampling_period_s
    needs = _friction_needs(robot, options, period_s, peak_speed)
    rows = np.unique(np.linspace(0, len(configurations) - 1, _CONFIGURATIONS).round().astype(int))
    count, highest_hz = _linear_need(
        with_imperfections(robot, options.imperfections), configurations[rows], frequency_hz, period_s
    )
    if changes_within(options, controller):
        needs["torques that change within a sample"] = _WITHIN_SAMPLE
    needs[f"the stiffest mode, {highest_hz:.0f} Hz"] = float(count)
    reason = max(needs, key=lambda name: np.ceil(needs[name]))
    return Steps(int(min(max(1, np.ceil(needs[reason])), _MOST)), reason)


def visited(
    robot: Robot, controller: Controller, reference: FloatArray, kind: str, configurations: FloatArray
) -> FloatArray:
    """Returns configurations (n, n_joint) that an excitation leads to, or those given where it moves a little only.

    Args:
        robot: The robot.
        controller: Its controller.
        reference (..., n_sample, n_motor): Periods of the excitation [unit of its kind].
        kind: What is injected; a torque is taken to move little.
        configurations (n_conf, n_joint): Where the motion begins [rad, or m].
    """
    if kind == "torque":
        return configurations
    way = angle_reference(reference, controller.sampling_period_s) if kind == "speed_reference" else reference
    way = way.reshape(-1, way.shape[-1]) @ robot.arm_per_motor.T
    if np.abs(way).max(initial=0.0) < _FAR:
        return configurations
    seen = way[:: max(len(way) // _CONFIGURATIONS, 1)][:_CONFIGURATIONS]
    return np.asarray((configurations[:, None] + seen).reshape(-1, way.shape[1]))


def peak_motor_speed(robot: Robot, controller: Controller, reference: FloatArray, kind: str) -> FloatArray:
    """Returns the highest speed (n_motor,) that an excitation tells each motor [rad/s].

    Args:
        robot: The robot.
        controller: Its controller.
        reference (..., n_sample, n_motor): Periods of the excitation [unit of its kind].
        kind: What is injected; a torque is taken to move the rotor alone, which is the most that it can.
    """
    period_s = controller.sampling_period_s
    rows = reference.reshape(-1, *reference.shape[-2:])
    if kind == "position_reference":
        rows = np.diff(rows, axis=1, append=rows[:, :1]) / period_s
    elif kind == "torque":
        rows = angle_reference(rows, period_s) / robot.motor_inertia_kgm2
    limit = np.array([joint.motor.max_speed_rad_s for joint in robot.joints])
    return np.asarray(np.minimum(np.abs(rows).max(axis=(0, 1), initial=0.0), limit))


def _friction_needs(
    robot: Robot, options: SimulateOptions, period_s: float, peak_speed: FloatArray
) -> dict[str, float]:
    """Steps per sample that the friction asks for, by reason."""
    law, frictions = LAWS.get(options.imperfections.friction), [joint.motor.friction for joint in robot.joints]
    if law is None or not any(friction.coulomb_nm for friction in frictions):
        return {}
    return law.step_needs(stacked_coefficients(law, frictions), robot.motor_inertia_kgm2, peak_speed, period_s)


def _linear_need(
    robot: Robot, configurations: FloatArray, frequency_hz: FloatArray, period_s: float
) -> tuple[int, float]:
    """Steps that the linearised robot asks for, and its highest eigenfrequency [Hz]."""
    model = build_model(robot, balanced=True)
    linear = linearize(model, solve_statics(model, configurations))
    parameters = nominal_parameters(robot, linear, 0.0)
    names = tuple(joint.name for joint in robot.joints), tuple(spring.name for spring in robot.springs)
    systems = [state_space(linear, parameters, row, names[0], *names[::-1]) for row in range(len(configurations))]
    highest = max(float(np.abs(np.linalg.eigvals(system.A)).max()) for system in systems)
    count = 1
    for system in systems:
        while (
            count < _MOST and _integration_error(system, frequency_hz, period_s, count) > STEP_LIMITS["response_error"]
        ):
            count += 1
    return count, highest / (2 * np.pi)


def _integration_error(system: StateSpace, frequency_hz: FloatArray, period_s: float, count: int) -> float:
    """Largest error of the sampled speed response by so many RK4 steps per period, over its norm; infinite if unstable.

    The torque is held over the period [s].
    """
    step_s = period_s / count
    scaled = np.linalg.eigvals(system.A) * step_s
    if (np.abs(np.polyval(_TAYLOR, scaled)) > np.maximum(1.0, np.exp(scaled.real)) + _GROWTH).any():
        return np.inf
    exact = discretise(system, period_s, 0.0)
    rows = [row for row, name in enumerate(exact.outputs) if name.endswith(".speed")]
    identity, M = np.eye(len(system.A)), system.A * step_s
    series = identity + M @ (identity / 2 + M @ (identity / 6 + M / 24))
    A, B = identity + M @ series, step_s * series @ system.B
    held = sum((np.linalg.matrix_power(A, power) @ B for power in range(count)), np.zeros_like(B))
    z = np.exp(2j * np.pi * frequency_hz * period_s)
    wanted = _response(exact.A, exact.B, exact.C[rows], z)
    error = _response(np.linalg.matrix_power(A, count), held, exact.C[rows], z) - wanted
    return float((np.linalg.norm(error, axis=(1, 2)) / np.linalg.norm(wanted, axis=(1, 2))).max())


def _response(A: FloatArray, B: FloatArray, C: FloatArray, z: ComplexArray) -> ComplexArray:
    return np.asarray(C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, B.astype(complex)))
