"""Sampled frequency response of the linearised elastic robot."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel, Shifts
from robid.robot.rest import MatrixSlopes, Springs, SpringValues, settle_springs
from robid.robot.sampling import Folding, hold_factor, make_folding


@dataclass(frozen=True)
class ElasticParameters:
    """Values of everything that a fit may estimate."""

    stiffness: FloatArray  # (n_spring,) Stiffnesses, arm side [N m/rad, or N/m]
    damping: FloatArray  # (n_spring,) Dampings, arm side [N m s/rad, or N s/m]
    viscous: FloatArray  # (n_joint,) Equivalent viscous friction, motor side [N m s/rad]
    arm_viscous: FloatArray  # (n_joint,) Viscous friction of the arms, arm side [N m s/rad, or N s/m]
    motor_inertia: FloatArray  # (n_joint,) Rotor inertias, motor side [kg m^2]
    link_inertia: FloatArray  # (n_joint,) Links' own inertia about the joint axis direction, or mass [kg m^2, or kg]
    delay: FloatArray  # (1,) Delay from recorded torque to applied torque, hold excluded [s]
    cubic: FloatArray  # (n_spring,) Cubic coefficients, arm side [N m/rad^3, or N/m^3]
    location: FloatArray  # (3 n_spring,) Where springs of links, payload and base sit, see `Spring.point_m` [m]
    # (n_nuisance,) Amounts of what the robot file may have wrong, zero where it is right, in their own units
    doubt: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def springs(self) -> SpringValues:
        """What decides where the springs rest."""
        return SpringValues(self.stiffness, self.cubic, self.damping, self.location)


@dataclass(frozen=True)
class Response:
    """A parametric response with what its derivatives need."""

    sampled: ComplexArray  # (n_conf, n_freq, n_out, n_in) Sampled response, acceleration per torque
    inputs: ComplexArray  # (n_conf, n_freq, n, n_in) `Z^-1 B`
    outputs: ComplexArray  # (n_conf, n_freq, n, n_out) `Z^-1 C'`
    hold: ComplexArray  # (n_freq,) Zero-order hold and delay
    omega: FloatArray | ComplexArray  # (n_freq,) Angular frequency [rad/s]
    model: LinearModel
    springs: Springs
    # What is measured per what is there, where that is a nuisance; in `sampled` only: (n_in,) of each motor's torque,
    # (n_freq, n_out, n_in) where a drive is late
    gain: FloatArray | ComplexArray
    folding: Folding | None = None  # What sampling folds down from above; None in continuous time
    by_delay: Folding | None = None  # Its derivative by the delay
    images: Response | None = None  # The continuous response at the folding's own frequencies; None where it needs none


def nominal_parameters(robot: Robot, model: LinearModel, delay_s: float) -> ElasticParameters:
    """Returns the robot file's own values."""
    return ElasticParameters(
        stiffness=np.array([spring.stiffness for spring in robot.springs]),
        damping=np.array([spring.damping for spring in robot.springs]),
        viscous=np.array([joint.motor.friction.viscous_nms_rad for joint in robot.joints]),
        arm_viscous=robot.arm_viscous,
        motor_inertia=robot.motor_inertia_kgm2,
        link_inertia=model.axial,
        delay=np.array([delay_s]),
        cubic=np.array([spring.cubic for spring in robot.springs]),
        location=robot.spring_points_m,
        doubt=np.zeros(0 if model.shifts is None else model.shifts.amounts.size),
    )


def response(
    model: LinearModel, parameters: ElasticParameters, frequency_hz: FloatArray, sampling_period_s: float | None
) -> Response:
    """Computes the response from motor torque to the outputs' acceleration.

    Args:
        model: Linearised robot.
        parameters: Parameter values.
        frequency_hz (n_freq,): Frequencies [Hz].
        sampling_period_s: Period of the held torque and the sampled position; None for continuous time.

    Returns:
        `-w^2 C Z^-1 B`, with hold, delay and what folds down onto outputs that are sampled as positions or as rates.

    Source:
        docs/methods, sec. 1 (Response, Sampling).
    """
    omega = 2 * np.pi * np.asarray(frequency_hz, float)
    model, springs = at_rest(model, parameters)
    shifts = model.shifts
    gain = np.ones(model.n_motor) if shifts is None else np.exp(gain_slopes(shifts, omega) @ parameters.doubt)
    whole = _continuous(model, parameters, springs, omega, gain)
    hold = hold_factor(omega, parameters.delay[0], sampling_period_s)
    sampled = hold[:, None, None] * whole.sampled
    if sampling_period_s is None:
        return replace(whole, sampled=sampled * gain, hold=hold)
    timing = float(parameters.delay[0]), sampling_period_s
    # A held torque has images of every line; what of them the outputs show folds down onto it.
    folding, by_delay = make_folding(omega, *timing, model.rates, model.output.shape[1])
    sampled = sampled + folding.fast[:, :, None] * fast_limit(model, parameters)[:, None]
    images = None
    if folding.omega.size:
        # What gears do beside springs and dampers is known at the lines alone, and small above them.
        plain = replace(model, effects=None, added=None)
        images = _continuous(plain, parameters, springs, folding.omega, gain)
        sampled = sampled + folding.images(images.sampled)
    return replace(whole, sampled=sampled * gain, hold=hold, folding=folding, by_delay=by_delay, images=images)


def _continuous(
    model: LinearModel,
    parameters: ElasticParameters,
    springs: Springs,
    omega: FloatArray | ComplexArray,
    gain: FloatArray | ComplexArray,
) -> Response:
    """The response at rest without hold, delay and gain, at angular frequencies that may be complex."""
    stiffness = _dynamic_stiffness(model, parameters, springs, omega)
    n_motor, n = model.n_motor, model.mass.shape[-1]
    collocated = model.output.shape[1] == n_motor and bool((model.output == np.eye(n_motor, n)).all())
    # C at each line: G = -w^2 C Z^-1 B.
    seen = _seen(model, omega)
    right = np.broadcast_to(np.eye(n, n_motor), (*stiffness.shape[:2], n, n_motor))
    if not collocated:
        right = np.concatenate([right, np.swapaxes(seen, -1, -2)], axis=-1)
    # One factorisation for Z^-1 B and Z^-1 C' (Z is symmetric); with C = B' they are the same.
    solved = np.linalg.solve(stiffness, right)
    inputs = solved[..., :n_motor]
    outputs = inputs if collocated else solved[..., n_motor:]
    continuous: ComplexArray = np.asarray(-(omega**2)[:, None, None] * (seen @ inputs), complex)
    return Response(continuous, inputs, outputs, np.ones(omega.size, complex), omega, model, springs, gain)


def gain_slopes(shifts: Shifts, omega: FloatArray) -> FloatArray | ComplexArray:
    """Derivatives of the logarithm of what is measured per what is there by the nuisance parameters.

    Args:
        shifts: How a linear model moves with these.
        omega (n_freq,): Angular frequencies [rad/s].

    Returns:
        Slopes (n_in, n_nuisance), or (n_freq, n_out, n_in, n_nuisance) where a drive may be late.
    """
    if shifts.late_torque is None or shifts.late_output is None:
        return shifts.torque.T
    # What is later by t than the others is turned by exp(-j w t): a column by its torque, a row by its output.
    late = shifts.late_torque.T + shifts.late_output.T[:, None]
    return np.asarray(shifts.torque.T - 1j * omega[:, None, None, None] * late)


def at_rest(model: LinearModel, parameters: ElasticParameters) -> tuple[LinearModel, Springs]:
    """Returns the linear model where the parameters let it rest, to first order, and its springs there."""
    model = _shifted(model, parameters)
    rest = model.rest
    if not parameters.cubic.any() and rest.moves is None:
        stiffness = rest.factor * parameters.stiffness
        return model, Springs(stiffness, rest.deflection, np.zeros((len(stiffness), 0)))
    springs = settle_springs(rest, parameters.springs)
    return (model if rest.moves is None else _along(model, rest.moves, springs.displacement)), springs


def _shifted(model: LinearModel, parameters: ElasticParameters) -> LinearModel:
    """The model with other amounts of its nuisance parameters."""
    shifts = model.shifts
    if shifts is None or np.array_equal(shifts.amounts, parameters.doubt):
        return model
    # First order about the amounts that the robot was linearised with.
    by = np.broadcast_to(parameters.doubt - shifts.amounts, (len(model.mass), shifts.amounts.size))
    return replace(_along(model, shifts, by), shifts=replace(shifts, amounts=parameters.doubt))


def _along(model: LinearModel, slopes: MatrixSlopes, by: FloatArray) -> LinearModel:
    """The model some way (n_conf, n_slope) along its slopes."""
    moved: dict[str, Any] = {
        each.name: getattr(model, each.name) + np.einsum("cm,cmij->cij", by, getattr(slopes, each.name))
        for each in fields(MatrixSlopes)
    }
    return replace(model, **moved)


def motion_matrices(
    model: LinearModel, parameters: ElasticParameters, configuration: int, omega: float | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns mass, damping and stiffness (n, n) of one configuration in the model's coordinates.

    Hysteresis is in damping and stiffness as it is at an angular frequency [rad/s], and left out without one.
    """
    model, springs = at_rest(model, parameters)
    stiffness = (model.gravity_stiffness + _springs(model, springs))[configuration]
    damping = np.broadcast_to(_dampers(model, parameters), model.mass.shape)[configuration]
    if model.effects is not None and omega is not None:
        added = model.effects.stiffness(parameters.doubt, np.array([omega]))[configuration, 0]
        own = np.diag(np.pad(added, (model.n_motor, 0)))
        # A complex stiffness k + j b acts at one frequency as the spring k with the damper b / w.
        stiffness, damping = stiffness + own.real, damping + own.imag / omega
    return mass_matrix(model, parameters)[configuration], damping, stiffness


def mass_matrix(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Returns the inertia matrices (n_conf, n, n) with rotors and links."""
    mass = model.mass + np.einsum("l,clij->cij", parameters.link_inertia, model.link_inertia)
    motors = np.arange(model.n_motor)
    mass[:, motors, motors] += parameters.motor_inertia
    return np.asarray(mass)


def arm_dampers(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Returns the damping matrix (n, n) of the arms' viscous friction, the same in every configuration."""
    return np.asarray(model.arm.T @ (parameters.arm_viscous[:, None] * model.arm))


def _dampers(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Damping matrix (n, n), or (n_conf, n, n) where dampers grow with the load."""
    if model.effects is None:
        diagonal = np.diag(np.concatenate([parameters.viscous, parameters.damping]))
        return np.asarray(diagonal + arm_dampers(model, parameters))
    # Dampers that grow with the load differ between configurations.
    grown = parameters.damping * model.effects.growth(parameters.doubt)
    viscous = np.broadcast_to(parameters.viscous, (len(grown), model.n_motor))
    own = np.concatenate([viscous, grown], axis=1)
    return np.asarray(own[:, :, None] * np.eye(own.shape[1]) + arm_dampers(model, parameters))


def _springs(model: LinearModel, springs: Springs) -> FloatArray:
    """Stiffness matrices (n_conf, n, n) of the springs alone."""
    full = np.pad(springs.stiffness, ((0, 0), (model.n_motor, 0)))
    return np.asarray(full[:, :, None] * np.eye(full.shape[1]))


def _dynamic_stiffness(
    model: LinearModel, parameters: ElasticParameters, springs: Springs, omega: FloatArray | ComplexArray
) -> ComplexArray:
    constant = (model.gravity_stiffness + _springs(model, springs))[:, None]
    # Z(w) = -w^2 M + j w D + K + dg/dq (docs/methods, sec. 1).
    inertial = constant - (omega**2)[:, None, None] * mass_matrix(model, parameters)[:, None]
    dynamic = inertial + _beside(model, springs)
    if model.shifts is not None:
        # Friction by configuration, on the motors' diagonal: j w d, and what does not depend on frequency.
        for own, rate in ((model.shifts.drift, 1j * omega), (model.shifts.clinging, np.ones_like(omega))):
            if own is not None:
                more = np.einsum("cmj,m->cj", own, parameters.doubt)
                full = np.pad(more, ((0, 0), (0, constant.shape[-1] - model.n_motor)))
                dynamic = dynamic + rate[:, None, None] * (full[:, None, :, None] * np.eye(full.shape[-1]))
    if model.effects is None:
        return np.asarray(dynamic + 1j * omega[:, None, None] * _dampers(model, parameters))
    dynamic = dynamic + _on_springs(model, model.effects.stiffness(parameters.doubt, np.real(omega)))
    return np.asarray(dynamic + 1j * omega[:, None, None] * _dampers(model, parameters)[:, None])


def _beside(model: LinearModel, springs: Springs) -> ComplexArray | float:
    """What springs and motors have beside springs and inertias, broadcast to (n_conf, n_freq, n, n)."""
    found: ComplexArray | float = 0.0
    if model.added is not None:
        found = _on_springs(model, springs.stiffness[:, None] * model.added)
    if model.clinging is not None:
        full = np.pad(model.clinging, ((0, 0), (0, model.mass.shape[-1] - model.n_motor)))
        found = found + full[:, None, :, None] * np.eye(full.shape[-1])
    return found


def _on_springs(model: LinearModel, values: ComplexArray) -> ComplexArray:
    """Matrices (n_conf, n_freq, n, n) of what springs (n_conf, n_freq, n_spring) have more."""
    full = np.pad(values, ((0, 0), (0, 0), (model.n_motor, 0)))
    return np.asarray(full[..., None] * np.eye(full.shape[-1]))


def _seen(model: LinearModel, omega: FloatArray | ComplexArray) -> FloatArray | ComplexArray:
    """Outputs (n_conf, n_freq, n_out, n) as positions; an accelerometer that tilts seems to move."""
    # Outputs are multiplied by -w^2 afterwards, which gravity's part is not: it is divided by w^2 here.
    return np.asarray(model.output[:, None] + model.tilt[:, None] / (omega**2)[:, None, None])


def fast_limit(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Returns the acceleration per torque (n_conf, n_out, n_in) at infinite frequency."""
    inverse = np.linalg.inv(mass_matrix(model, parameters))
    return np.asarray(model.output @ inverse[..., : model.n_motor])


def with_values(parameters: ElasticParameters, kind: str, values: FloatArray) -> ElasticParameters:
    """Returns the parameters with one kind replaced."""
    return replace(parameters, **{kind: values})
