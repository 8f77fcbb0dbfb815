"""Sampled frequency response of the linearised elastic robot and its analytic derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel

_ALIASES = (-2, -1, 1, 2)


@dataclass(frozen=True)
class ElasticParameters:
    """Values of everything that a fit may estimate.

    Attributes:
        stiffness (n_spring,): Stiffnesses, arm side [N m/rad].
        damping (n_spring,): Dampings, arm side [N m s/rad].
        viscous (n_joint,): Equivalent viscous friction, motor side [N m s/rad].
        motor_inertia (n_joint,): Rotor inertias, motor side [kg m^2].
        link_inertia (n_joint,): Links' own inertia about the joint axis direction [kg m^2].
        delay (1,): Delay from recorded torque to applied torque, hold excluded [s].
    """

    stiffness: FloatArray
    damping: FloatArray
    viscous: FloatArray
    motor_inertia: FloatArray
    link_inertia: FloatArray
    delay: FloatArray


@dataclass(frozen=True)
class Response:
    """A parametric response with what its derivatives need.

    Attributes:
        sampled (n_conf, n_freq, n_out, n_in): Sampled response, acceleration per torque.
        inputs (n_conf, n_freq, n, n_in): `Z^-1 B`.
        outputs (n_conf, n_freq, n, n_out): `Z^-1 C'`.
        hold (n_freq,): Zero-order hold and delay.
        omega (n_freq,): Angular frequency [rad/s].
    """

    sampled: ComplexArray
    inputs: ComplexArray
    outputs: ComplexArray
    hold: ComplexArray
    omega: FloatArray


def nominal_parameters(robot: Robot, model: LinearModel, delay_s: float) -> ElasticParameters:
    """Returns the robot file's own values."""
    return ElasticParameters(
        stiffness=np.array([spring.stiffness_nm_rad for spring in robot.springs]),
        damping=np.array([spring.damping_nms_rad for spring in robot.springs]),
        viscous=np.array([joint.motor.friction.viscous_nms_rad for joint in robot.joints]),
        motor_inertia=robot.motor_inertia_kgm2,
        link_inertia=model.axial,
        delay=np.array([delay_s]),
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
        `-w^2 C Z^-1 B`, with hold, delay and aliases of the held position response.

    Source:
        METHODS sec. 1 (FRF, Sampling).
    """
    omega = 2 * np.pi * np.asarray(frequency_hz, float)
    stiffness = _dynamic_stiffness(model, parameters, omega)
    n_motor, n = model.n_motor, model.mass.shape[-1]
    collocated = model.output.shape[1] == n_motor and bool((model.output == np.eye(n_motor, n)).all())
    seen = _seen(model, omega)
    right = np.broadcast_to(np.eye(n, n_motor), (*stiffness.shape[:2], n, n_motor))
    if not collocated:
        right = np.concatenate([right, np.swapaxes(seen, -1, -2)], axis=-1)
    solved = np.linalg.solve(stiffness, right)
    inputs = solved[..., :n_motor]
    outputs = inputs if collocated else solved[..., n_motor:]
    continuous = -(omega**2)[:, None, None] * (seen @ inputs)
    hold = hold_factor(omega, parameters.delay[0], sampling_period_s)
    sampled = hold[:, None, None] * continuous
    if sampling_period_s is not None:
        fast = fast_limit(model, parameters)
        sampled = sampled + alias_factor(omega, parameters.delay[0], sampling_period_s)[0][:, None, None] * fast[:, None]
    return Response(sampled, inputs, outputs, hold, omega)


def jacobian(
    model: LinearModel,
    parameters: ElasticParameters,
    result: Response,
    kinds: tuple[str, ...],
    sampling_period_s: float | None,
) -> ComplexArray:
    """Derivatives of the sampled response, springs and dampers as outer products.

    Args:
        model: Linearised robot.
        parameters: Where `result` was computed.
        result: The response.
        kinds: Field names of `ElasticParameters`, in the order wanted.
        sampling_period_s: As for `response`.

    Returns:
        (n_conf, n_freq, n_out, n_in, n_param), with respect to the plain (not logarithmic) values.

    Source:
        METHODS sec. 1: `dG = w^2 X_o' (dZ) X_i`.
    """
    columns = [_columns(model, parameters, result, kind, sampling_period_s) for kind in kinds]
    return np.concatenate(columns, axis=-1)


def _columns(
    model: LinearModel, parameters: ElasticParameters, result: Response, kind: str, sampling_period_s: float | None
) -> ComplexArray:
    n_motor = model.n_motor
    scale = (result.hold * result.omega**2)[:, None, None, None]
    rate = 1j * result.omega[:, None, None, None]
    if kind == "stiffness":
        return scale * _outer(result, slice(n_motor, None))
    if kind == "damping":
        return scale * rate * _outer(result, slice(n_motor, None))
    if kind == "viscous":
        return scale * rate * _outer(result, slice(0, n_motor))
    if kind == "motor_inertia":
        matrices = np.eye(n_motor, model.mass.shape[-1])
        directions = np.einsum("li,lj->lij", matrices, matrices)
        return _inertia_columns(model, parameters, result, directions[None], sampling_period_s)
    if kind == "link_inertia":
        return _inertia_columns(model, parameters, result, model.link_inertia, sampling_period_s)
    return _delay_column(model, parameters, result, sampling_period_s)


def _outer(result: Response, rows: slice) -> ComplexArray:
    left = np.swapaxes(result.outputs[..., rows, :], -1, -2)
    right = np.swapaxes(result.inputs[..., rows, :], -1, -2)
    return np.asarray(left[..., :, None, :] * right[..., None, :, :])


def _inertia_columns(
    model: LinearModel,
    parameters: ElasticParameters,
    result: Response,
    directions: FloatArray,
    sampling_period_s: float | None,
) -> ComplexArray:
    spread = np.broadcast_to(directions, (model.mass.shape[0], *directions.shape[1:]))
    change = np.einsum("cfao,clab,cfbi->cfoil", result.outputs, spread, result.inputs, optimize=True)
    columns = -(result.hold * result.omega**4)[:, None, None, None] * change
    if sampling_period_s is None:
        return np.asarray(columns)
    inverse = np.linalg.inv(mass_matrix(model, parameters))
    left, right = model.output @ inverse, inverse[..., : model.n_motor]
    fast = -np.einsum("coa,clab,cbi->coil", left, spread, right, optimize=True)
    aliases = alias_factor(result.omega, parameters.delay[0], sampling_period_s)[0]
    return np.asarray(columns + aliases[:, None, None, None] * fast[:, None])


def _delay_column(
    model: LinearModel, parameters: ElasticParameters, result: Response, sampling_period_s: float | None
) -> ComplexArray:
    rate = -1j * result.omega[:, None, None]
    if sampling_period_s is None:
        return np.asarray(rate * result.sampled)[..., None]
    fast = fast_limit(model, parameters)[:, None]
    aliases, slope = alias_factor(result.omega, parameters.delay[0], sampling_period_s)
    own = result.sampled - aliases[:, None, None] * fast
    return np.asarray(rate * own + slope[:, None, None] * fast)[..., None]


def motion_matrices(
    model: LinearModel, parameters: ElasticParameters, configuration: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns mass, damping and stiffness (n, n) of one configuration in the model's coordinates."""
    stiffness = model.gravity_stiffness[configuration] + _springs(model, parameters)
    return mass_matrix(model, parameters)[configuration], _dampers(parameters), stiffness


def mass_matrix(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Returns the inertia matrices (n_conf, n, n) with rotors and links."""
    mass = model.mass + np.einsum("l,clij->cij", parameters.link_inertia, model.link_inertia)
    motors = np.arange(model.n_motor)
    mass[:, motors, motors] += parameters.motor_inertia
    return np.asarray(mass)


def _dampers(parameters: ElasticParameters) -> FloatArray:
    return np.diag(np.concatenate([parameters.viscous, parameters.damping]))


def _springs(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    return np.diag(np.concatenate([np.zeros(model.n_motor), parameters.stiffness]))


def _dynamic_stiffness(model: LinearModel, parameters: ElasticParameters, omega: FloatArray) -> ComplexArray:
    constant = model.gravity_stiffness[:, None] + _springs(model, parameters)
    dynamic = constant - (omega**2)[:, None, None] * mass_matrix(model, parameters)[:, None]
    return np.asarray(dynamic + 1j * omega[:, None, None] * _dampers(parameters))


def _seen(model: LinearModel, omega: FloatArray) -> FloatArray:
    """Outputs (n_conf, n_freq, n_out, n) as positions; an accelerometer that tilts seems to move."""
    return np.asarray(model.output[:, None] + model.tilt[:, None] / (omega**2)[:, None, None])


def fast_limit(model: LinearModel, parameters: ElasticParameters) -> FloatArray:
    """Returns the acceleration per torque (n_conf, n_out, n_in) at infinite frequency."""
    inverse = np.linalg.inv(mass_matrix(model, parameters))
    return np.asarray(model.output @ inverse[..., : model.n_motor])


def hold_factor(omega: FloatArray, delay_s: float, sampling_period_s: float | None) -> ComplexArray:
    """Returns what hold and delay multiply the continuous response by (n_freq,)."""
    lag = np.exp(-1j * omega * delay_s)
    if sampling_period_s is None:
        return np.asarray(lag)
    half = 0.5 * omega * sampling_period_s
    return np.asarray(np.sinc(half / np.pi) * np.exp(-1j * half) * lag)


def alias_factor(omega: FloatArray, delay_s: float, sampling_period_s: float) -> tuple[ComplexArray, ComplexArray]:
    """Returns what the fast limit is multiplied by as it folds down (n_freq,), and its derivative by the delay."""
    total = np.zeros(omega.size, complex)
    slope = np.zeros(omega.size, complex)
    for shift in _ALIASES:
        alias = omega + shift * 2 * np.pi / sampling_period_s
        term = (omega / alias) ** 2 * hold_factor(alias, delay_s, sampling_period_s)
        total += term
        slope += -1j * alias * term
    return total, slope


def with_values(parameters: ElasticParameters, kind: str, values: FloatArray) -> ElasticParameters:
    """Returns the parameters with one kind replaced."""
    return replace(parameters, **{kind: values})
