"""What each effect does to a response, to first order.

`column` has a function for each effect: the derivative of the log response by its amount.
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.nuisance.effects import (
    MICRO,
    Compliance,
    Drift,
    Effect,
    Hysteresis,
    LateDrive,
    LoadFriction,
    LoadStiffness,
    MotorFriction,
    OneSided,
    RigidError,
    RobotMove,
    TorqueScale,
    ValueOff,
)
from robid.models.elastic.fit.nuisance.moves import PERCENT, stiffened
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import (
    NO_LOAD_RAD,
    bent_ways,
    campaign_course,
    clinging_of_one,
    friction_of_one,
    load_course,
)
from robid.robot.response import ElasticParameters

_MEAN_SIZE = np.sqrt(2 / np.pi)  # of a normal variable, over its deviation
_STEP, _RIGID = 1e-3, 1e11  # percent of a gear's compliance; times its stiffness


@singledispatch
def column(effect: Effect, scene: Scene) -> ComplexArray:  # noqa: ARG001
    """Derivative (n_conf, n_freq, n_out, n_in) of the model's log response by an effect's amount.

    Args:
        effect: The effect; of one that acts only where a fit frees it, nothing.
        scene: Where to differentiate.
    """
    return np.zeros(scene.problem.frf.response.shape, complex)


@column.register
def _(effect: RobotMove, scene: Scene) -> ComplexArray:
    # A central difference of log G, the robot at rest anew on each side.
    ahead, behind = (scene.sampled(effect.moved(scene.robot, step)) for step in (effect.step, -effect.step))
    return np.asarray(np.log(ahead / behind) / (2 * effect.step))


@column.register
def _(effect: TorqueScale, scene: Scene) -> ComplexArray:
    found = np.zeros(scene.problem.frf.response.shape, complex)
    found[..., effect.joint] = effect.slope
    return np.asarray(found - column(effect.heavier, scene)) if effect.shared else found


@column.register
def _(effect: LateDrive, scene: Scene) -> ComplexArray:
    frf = scene.problem.frf
    found = np.zeros(frf.response.shape, complex)
    # Later by t: the response is turned by exp(-j w t), a column by its torque, a row by its output.
    turned = -2j * np.pi * frf.frequency_hz[:, None] * effect.amount_s
    name = frf.input_names[effect.joint]
    if effect.of == "torque":
        found[..., effect.joint] = turned
    elif name in frf.output_names:
        found[..., frf.output_names.index(name), :] = turned
    return found


@column.register
def _(effect: ValueOff, scene: Scene) -> ComplexArray:
    own = value_of_one(effect, scene.stated)
    if effect.kind in FRICTION:
        own *= float(rotor_ratios(scene.problem, scene.values)[effect.element])
    return np.asarray(scene.slopes(effect.kind)[..., effect.element] * own)


FRICTION = ("viscous", "arm_viscous")
"""Kinds of viscous friction, which is as much more as an estimated rotor's inertia is more than the file's."""


def rotor_ratios(problem: Problem, values: ElasticParameters) -> FloatArray:
    """Inertias of rotors (n_joint,) that a fit estimates over those it began with; 1 where there are none."""
    nominal = problem.parameters.nominal.motor_inertia
    return np.asarray(np.where(nominal > 0, values.motor_inertia / np.where(nominal > 0, nominal, 1.0), 1.0))


def value_of_one(effect: ValueOff, values: ElasticParameters) -> float:
    """By how much an amount of one takes a parameter off, in its own unit."""
    if effect.kind == "delay":
        return MICRO
    if effect.kind in ("viscous", "arm_viscous"):
        inertia = values.motor_inertia if effect.kind == "viscous" else values.link_inertia
        return friction_of_one(float(inertia[effect.element]))
    return float(getattr(values, effect.kind)[effect.element]) / PERCENT


@column.register
def _(effect: Drift, scene: Scene) -> ComplexArray:
    own = friction_of_one(float(scene.robot.joints[effect.joint].motor.inertia_kgm2))
    share = own * campaign_course(len(scene.problem.frf.configurations))
    return np.asarray(share[:, None, None, None] * scene.slopes("viscous")[..., effect.joint])


@column.register
def _(effect: LoadFriction, scene: Scene) -> ComplexArray:
    inertia = float(scene.robot.joints[effect.joint].motor.inertia_kgm2)
    course = load_course(scene.problem.model, effect.spring)
    # Only what differs from configuration to configuration speaks for the load: the rest is of a law that is off.
    course = course - course.mean()
    if effect.phase is not None:
        return _clung(effect.joint, clinging_of_one(inertia, effect.phase) * course, scene)
    own = friction_of_one(inertia) * course
    return np.asarray(own[:, None, None, None] * scene.slopes("viscous")[..., effect.joint])


@column.register
def _(effect: MotorFriction, scene: Scene) -> ComplexArray:
    return _clung(effect.joint, np.array([clinging_stiffness(effect, scene)]), scene)


def _clung(joint: int, stiffness: ComplexArray, scene: Scene) -> ComplexArray:
    """What a motor's torque per angle (n_conf,) does to the log response [N m/rad]."""
    frf, whole, hold = scene.problem.frf, scene.response.sampled, scene.response.hold
    name = frf.input_names[joint]
    if name not in frf.output_names:
        return np.zeros_like(whole)  # nothing shows its angle
    row = frf.output_names.index(name)
    square = (2 * np.pi * frf.frequency_hz) ** 2
    # Its torque -c x is F = c / w^2 times the acceleration: fed back, G becomes (1 - G F)^-1 G, nearly G + G F G.
    moved = whole[..., :, joint, None] * whole[..., row, None, :] / whole
    # The motor feels its friction at once, a torque only after hold and delay.
    return np.asarray(stiffness[:, None, None, None] * moved / (square * hold)[:, None, None])


def clinging_stiffness(effect: MotorFriction, scene: Scene) -> complex:
    """Torque per angle that an amount of one is [N m/rad]."""
    return clinging_of_one(float(scene.values.motor_inertia[effect.joint]), effect.phase)


@column.register
def _(effect: Hysteresis | LoadStiffness | OneSided, scene: Scene) -> ComplexArray:
    return np.asarray(gear_share(effect, scene)[:, :, None, None] * scene.gear_slopes[..., effect.spring])


@singledispatch
def gear_share(effect: Effect, scene: Scene) -> ComplexArray:  # noqa: ARG001
    """What an amount of one adds to a gear's stiffness (n_conf, n_freq or 1), over it."""
    message = f"{type(effect).__name__} is beside no gear"
    raise TypeError(message)


@gear_share.register
def _(effect: Hysteresis, scene: Scene) -> ComplexArray:
    omega = 2 * np.pi * scene.problem.frf.frequency_hz
    return 2 / PERCENT * bristle_share(omega, scene.swing[:, :, effect.spring], effect.slip)


@gear_share.register
def _(effect: LoadStiffness, scene: Scene) -> ComplexArray:
    load = np.abs(scene.problem.model.rest.deflection[:, effect.spring])
    spread = load - load.mean()
    most = np.abs(spread).max()
    share = spread / most if most > NO_LOAD_RAD else np.zeros_like(spread)
    return np.asarray(share[:, None] / PERCENT, complex)


@gear_share.register
def _(effect: OneSided, scene: Scene) -> ComplexArray:
    return np.asarray(bent_ways(scene.problem.model, effect.spring)[:, None] / PERCENT, complex)


def bristle_share(omega: FloatArray, swing: FloatArray, relative_slip: float) -> ComplexArray:
    """What bristles add to a spring, over their stiffness times their mean gain, as `Hysteresis` says.

    Args:
        omega (n_freq,): Angular frequencies [rad/s].
        swing (n_conf, n_freq): Mean square deflection at each line; where all are zero, motion is taken to be alike.
        relative_slip: Deflection at which they slip over the root mean square one.

    Returns:
        Shares (n_conf, n_freq).
    """
    if not swing.any():
        return np.broadcast_to(1j * omega / (1j * omega + np.exp(np.log(omega).mean()) / relative_slip), swing.shape)
    slip = relative_slip * np.sqrt(swing.sum(axis=1).mean())
    power = omega**2 * swing
    speed = np.sqrt(power.sum(axis=1, keepdims=True))
    # Linearised about a normal motion, the mean of |dx/dt| z / h is sqrt(2/pi) v z / h: the corner of a low pass.
    corner = _MEAN_SIZE * speed / slip
    pulled = (power * corner / (omega**2 + corner**2)).sum(axis=1, keepdims=True)
    gain = 1 / (1 + _MEAN_SIZE * pulled / (np.maximum(speed, np.finfo(float).tiny) * slip))
    return np.asarray(gain / gain.mean() * 1j * omega / (1j * omega + corner))


@column.register
def _(effect: Compliance, scene: Scene) -> ComplexArray:
    names = [spring.name for spring in scene.robot.springs]
    if effect.spring.name in names:
        index = names.index(effect.spring.name)
        amount = PERCENT * effect.spring.stiffness / scene.values.stiffness[index]
        softer = scene.slopes("stiffness")[..., index] * scene.values.stiffness[index]
        # By the logarithm of its compliance, minus that by that of its stiffness; its damper is in proportion.
        softer = softer + scene.slopes("damping")[..., index] * scene.values.damping[index]
        return np.asarray(-softer / amount)
    factors = _RIGID, PERCENT / _STEP, 0.5 * PERCENT / _STEP
    rigid, stiff, soft = (scene.extended(stiffened(effect.spring, factor)) for factor in factors)
    # One-sided differences, extrapolated: there is no negative compliance.
    return np.asarray((2 * np.log(stiff / rigid) - 0.5 * np.log(soft / rigid)) / _STEP)


@column.register
def _(effect: RigidError, scene: Scene) -> ComplexArray:
    return np.asarray(np.log(scene.sampled(effect.off.robot) / scene.at_rest) / effect.off.deviations)
