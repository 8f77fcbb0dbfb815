"""A linear arm in closed loop with friction of laws that the identified family does not hold, in plain NumPy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.options import MultisineOptions
from robid.models.files import load_experiment
from robid.pipeline.estimate_frf import stated_law
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import motion_matrices, nominal_parameters
from robid.signals.quantities import INJECTED, motor_channels
from robid.signals.record import Record
from robid.simulate.controller import Cascade, angle_reference

LOADED = load_experiment(Path(__file__).parent / "stages/small.yaml")
NOMINAL = LOADED.robot.to_robot()
CONTROLLER = LOADED.robot.controller
STEP = CONTROLLER.sampling_period_s
STATED = tuple(stated_law(joint.motor) for joint in NOMINAL.joints)
NAMES = tuple(joint.name for joint in NOMINAL.joints)
EXCITATION = MultisineOptions(period_s=2, low_hz=3, high_hz=60, count=30, rms=6.0, phase_iterations=5)
SUBSTEPS = 4
ENCODER_NOISE_RAD, TORQUE_NOISE_NM = 1e-5, 0.02

Friction = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Speed and state (n_row, n_motor, n_state) in; friction torque and the rate of the state out."""


def tanh(level: float = 0.2, width: float = 1.0) -> Friction:
    """`F tanh(v / w)`."""
    return lambda speed, state: (level * np.tanh(speed / width), np.zeros_like(state))


def stribeck(level: float = 0.2, excess: float = 0.5, speed_scale: float = 3.0, width: float = 0.5) -> Friction:
    """`(F + E exp(-|v| / v_s)) 2/pi atan(v / w)`: other exponent and other smoothing than the family's."""

    def torque(speed, state):
        curve = level * (1 + excess * np.exp(-np.abs(speed) / speed_scale))
        return curve * 2 / np.pi * np.arctan(speed / width), np.zeros_like(state)

    return torque


def maxwell(level: float = 0.2, widths: tuple[float, ...] = (0.01, 0.05, 0.25)) -> Friction:
    """Equal bristles of several widths side by side: presliding that no single bristle follows."""
    width = np.array(widths)

    def torque(speed, state):
        rate = speed[..., None] - np.abs(speed[..., None]) * state / width
        return level * (state / width).mean(axis=-1), rate

    return torque


LAWS = {"tanh": tanh(), "stribeck": stribeck(), "maxwell": maxwell()}


def simulate_arm(robot, configurations, friction: Friction, realizations: int, seed: int, periods: int = 2) -> Record:
    """The arm, linear but for its friction, under the real controller in the periodic steady state."""
    design = design_excitation(MultisineOptions(**{**vars(EXCITATION), "seed": seed}), len(NAMES), realizations, STEP)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    values = nominal_parameters(robot, linear, 0.0)
    matrices = [motion_matrices(linear, values, index) for index in range(len(configurations))]
    generator = np.random.default_rng([seed, 1])
    played = [_play(design.reference, *each, robot, friction, periods) for each in matrices]
    torque, position = (np.stack(part) for part in zip(*played, strict=True))
    return Record(
        sampling_period_s=STEP,
        configurations=np.asarray(configurations),
        inputs=torque + TORQUE_NOISE_NM * generator.standard_normal(torque.shape),
        outputs=position + ENCODER_NOISE_RAD * generator.standard_normal(position.shape),
        reference=np.repeat(design.reference[None], len(configurations), axis=0),
        reference_channels=motor_channels(NAMES, INJECTED[design.kind]),
        excited_lines=design.excited_lines,
        detection_lines=design.detection_lines,
        input_channels=motor_channels(NAMES, "torque"),
        output_channels=motor_channels(NAMES, "angle"),
        output_offset=np.zeros((len(configurations), len(NAMES))),
    )


def _play(reference, mass, damping, stiffness, robot, friction, periods):
    """Torque and angle (n_real, n_exp, n_period, n_sample, n_motor) of one configuration."""
    n_real, n_exp, n_sample, n_motor = reference.shape
    rows = reference.reshape(-1, n_sample, n_motor)
    advance, push = _discrete(mass, damping, stiffness, n_motor, STEP / SUBSTEPS)
    target, n = angle_reference(rows, STEP), len(mass)
    limit = np.full(n_motor, np.inf)
    zero = np.zeros((len(rows), n_motor))
    cascade = Cascade(CONTROLLER, robot.motor_inertia_kgm2, limit, zero, zero)
    state, bristle, command = np.zeros((len(rows), 2 * n)), np.zeros((*zero.shape, 3)), zero
    torque, angle = np.empty((periods, n_sample, *zero.shape)), np.empty((periods, n_sample, *zero.shape))
    for index in range((periods + 2) * n_sample):
        period, sample = divmod(index, n_sample)
        applied, command = command, cascade.command(state[:, :n_motor], target[:, sample], rows[:, sample])
        if period >= 2:
            torque[period - 2, sample], angle[period - 2, sample] = command, state[:, :n_motor]
        for _ in range(SUBSTEPS):
            resisting, rate = friction(state[:, n : n + n_motor], bristle)
            bristle = bristle + STEP / SUBSTEPS * rate
            state = state @ advance + (applied - resisting) @ push
    shape = (periods, n_sample, n_real, n_exp, n_motor)
    return tuple(np.moveaxis(one.reshape(shape), (2, 3), (0, 1)) for one in (torque, angle))


def _discrete(mass, damping, stiffness, n_motor, step_s):
    """Transposed transition (2 n, 2 n) and input (n_motor, 2 n) matrices of `M z'' + D z' + K z = B u`, u held."""
    n = len(mass)
    inverse = np.linalg.inv(mass)
    system = np.zeros((2 * n + n_motor, 2 * n + n_motor))
    system[:n, n : 2 * n] = np.eye(n)
    system[n : 2 * n] = np.hstack([-inverse @ stiffness, -inverse @ damping, inverse[:, :n_motor]])
    whole = expm(system * step_s)
    return whole[: 2 * n, : 2 * n].T, whole[: 2 * n, 2 * n :].T
