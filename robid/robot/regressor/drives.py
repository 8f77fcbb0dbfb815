"""The motors of a rigid model.

Its options, and the regressor columns of motors, coupled gears and counterbalances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Literal

import numpy as np

from robid.arrays import FloatArray, option
from robid.robot.balances import HarmonicBalance, PointBalance, SpringBalance, stretch
from robid.robot.description import Joint, Robot
from robid.robot.parameters import PARAMETER_KINDS, RigidKind

FrictionForm = Literal["none", "viscous", "coulomb", "asymmetric", "load", "quadratic"]
PayloadForm = Literal["link", "body"]


@dataclass(frozen=True)
class RigidOptions:
    """What a rigid model has beside its links."""

    friction: FrictionForm = option(
        "coulomb",
        "Friction of each motor. `none`. `viscous`. `coulomb`: viscous and Coulomb. `asymmetric`: both for "
        "either direction. `load`: viscous, and Coulomb that grows with the motor's torque. `quadratic`: "
        "viscous, Coulomb, and a part that grows with the square of the speed.",
    )
    offsets: bool = option(True, "Whether each motor's torque has an offset.")
    motor_inertias: bool = option(True, "Whether rotors have inertia.")
    couplings: bool = option(
        True,
        "Whether gears that several motors drive have their own inertia, viscous and, if the motors have it, "
        "Coulomb friction, which move with the arm.",
    )
    counterbalances: bool = option(True, "Whether the model has the counterbalances of the robot file.")
    payload: PayloadForm = option(
        "link",
        "Whether the payload is part of the last link (`link`) or a separate body with its own parameters (`body`).",
    )


@dataclass(frozen=True)
class BaseOptions:
    """How base parameters are found."""

    n_sample: int = option(500, "Random configurations with speeds and accelerations.", ge=10, le=100_000)
    speed_rad_s: float = option(2.0, "Largest arm speed [rad/s, or m/s].", gt=0)
    acceleration_rad_s2: float = option(10.0, "Largest arm acceleration [rad/s^2, or m/s^2].", gt=0)
    threshold: float = option(
        1e-8, "Columns, each scaled to 1, that are nearer than this to the space of others are dependent.", gt=0, lt=1
    )
    seed: int = option(0, "Seed of the random configurations.", ge=0)


_FORCES = {
    "N m": "N",
    "N m s/rad": "N s/m",
    "N m s^2/rad^2": "N s^2/m^2",
    "kg m^2": "kg",
}  # Units of what acts on a motor, where it is a slide's force that counts instead


def acts_along(joint: Joint) -> bool:
    """Whether what drives a joint is a force along it: on a slide without a motor, or whose radian is a metre."""
    return joint.type == "prismatic" and (not joint.has_motor or abs(joint.motor.gear_ratio) == 1.0)


@dataclass(frozen=True)
class DriveMotion:
    """Motion of what a torque acts on: a motor, or the arm of a joint."""

    position: FloatArray  # (n_sample,) Position [rad, or m]
    velocity: FloatArray  # (n_sample,) Speed
    acceleration: FloatArray  # (n_sample,) Acceleration
    sense: FloatArray  # (n_sample,) Sign of the speed that friction feels, or a smooth one between -1 and 1
    torque: FloatArray  # (n_sample,) Torque of the motor; zero where nothing asks for it [N m]


@dataclass(frozen=True)
class DriveTerm:
    """A torque that one parameter gives."""

    owner: str
    component: str  # What its name says beside the joint
    kind: RigidKind
    unit: str
    nominal: float
    row: FloatArray  # (n_joint,) Motion of what it acts on per motor angle; the motors feel it by the same factors
    effect: Callable[[DriveMotion], FloatArray]  # Its torque per unit of the parameter, (n_sample,)

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return f"{self.owner}.{self.component}"


_acceleration, _velocity, _sense = (attrgetter(name) for name in ("acceleration", "velocity", "sense"))


def drive_terms(robot: Robot, options: RigidOptions) -> Iterator[DriveTerm]:
    """Yields the terms of a robot: motors, then coupled gears, then counterbalances.

    The inertias of rotors that ride on links are not among them: they belong to the tree.
    """
    turns = robot.arm_per_motor
    inertias = (robot.motor_inertia_kgm2 + robot.shaft_inertia_kgm2).tolist()
    for joint, row, inertia in zip(robot.joints, np.eye(len(robot.joints)), inertias, strict=True):
        if options.motor_inertias and robot.rotor == "spong" and joint.has_motor:
            yield _term(joint, row, "motor_inertia", inertia, _acceleration)
        yield from _friction(joint, row, options)
        if options.offsets:
            yield _term(joint, row, "torque_offset", 0.0, _one)
    for joint, row in zip(robot.joints, turns, strict=True):
        if options.couplings and joint.couplings:
            yield from _coupling(joint, row, options)
    for joint, row in zip(robot.joints, turns, strict=True):
        if options.counterbalances:
            yield from _counterbalance(joint, row)


def _term(
    joint: Joint,
    row: FloatArray,
    kind: RigidKind,
    nominal: float,
    effect: Callable[[DriveMotion], FloatArray],
    component: str = "",
) -> DriveTerm:
    about = PARAMETER_KINDS[kind]
    unit = about.linear_unit if joint.type == "prismatic" else about.unit
    if acts_along(joint):
        unit = _FORCES.get(unit, unit)
    return DriveTerm(joint.name, component or kind, kind, unit, nominal, row, effect)


def _friction(joint: Joint, row: FloatArray, options: RigidOptions) -> Iterator[DriveTerm]:
    law, form = joint.motor.friction, options.friction
    # Behind a rigid gear the arm's friction is the motor's; that of coupled gears has a term of its own.
    stated = law.viscous_nms_rad + (0.0 if joint.couplings else joint.reflected_viscous_nms_rad)
    if form == "asymmetric":
        for name, sense in (("forward", 1.0), ("backward", -1.0)):
            yield _term(joint, row, "viscous", stated, partial(_one_way, _velocity, sense), f"viscous_{name}")
            yield _term(joint, row, "coulomb", law.coulomb_nm, partial(_one_way, _sense, sense), f"coulomb_{name}")
    elif form != "none":
        yield _term(joint, row, "viscous", stated, _velocity)
        if form != "viscous":
            yield _term(joint, row, "coulomb", law.coulomb_nm, _sense)
        if form == "load":
            yield _term(joint, row, "load_friction", 0.0, _load)
        elif form == "quadratic":
            yield _term(joint, row, "quadratic_viscous", 0.0, _square)


def _coupling(joint: Joint, row: FloatArray, options: RigidOptions) -> Iterator[DriveTerm]:
    """What turns with the arm of a joint that several motors move, its own link apart."""
    if options.motor_inertias:
        yield _term(joint, row, "coupling_inertia", 0.0, _acceleration)
    if options.friction != "none":
        yield _term(joint, row, "coupling_viscous", joint.arm_viscous, _velocity)
    if options.friction not in ("none", "viscous"):
        yield _term(joint, row, "coupling_coulomb", 0.0, _sense)


def _counterbalance(joint: Joint, row: FloatArray) -> Iterator[DriveTerm]:
    balance = joint.counterbalance
    if isinstance(balance, HarmonicBalance):
        for name, wave, levels in (("sin", np.sin, balance.sine_nm), ("cos", np.cos, balance.cosine_nm)):
            for order, level in enumerate(levels.tolist(), start=1):
                effect = partial(_harmonic, wave, order)
                yield _term(joint, row, "counterbalance", level, effect, f"counterbalance_{name}{order}")
        return
    if balance is None:
        return
    slides = joint.type == "prismatic"
    if isinstance(balance, SpringBalance):
        effect = partial(_between, balance, slides, lambda length: length - balance.free_length_m)
        yield _term(joint, row, "counterbalance_stiffness", balance.stiffness_n_m, effect)
        effect = partial(_between, balance, slides, np.ones_like)
        yield _term(joint, row, "counterbalance_preload", balance.preload_n, effect)
    else:
        # Only the scale is linear: points, volume and exponent are taken as stated.
        effect = partial(_between, balance, slides, balance.per_pressure)
        yield _term(joint, row, "counterbalance_pressure", balance.rest_pressure_pa, effect)


def _one(motion: DriveMotion) -> FloatArray:
    return np.ones_like(motion.position)


def _load(motion: DriveMotion) -> FloatArray:
    return np.asarray(np.abs(motion.torque) * motion.sense)


def _square(motion: DriveMotion) -> FloatArray:
    return np.asarray(np.abs(motion.velocity) * motion.velocity)


def _one_way(effect: Callable[[DriveMotion], FloatArray], sense: float, motion: DriveMotion) -> FloatArray:
    return np.asarray(np.where(motion.sense * sense > 0, effect(motion), 0.0))


def _harmonic(wave: Callable[[FloatArray], FloatArray], order: int, motion: DriveMotion) -> FloatArray:
    # The parameter is what the counterbalance does to the arm; the motor does the opposite.
    return -wave(order * motion.position)


def _between(
    balance: PointBalance, slides: bool, pull: Callable[[FloatArray], FloatArray], motion: DriveMotion
) -> FloatArray:
    """What the motor does against a pull (n_sample,) that follows the distance of two points (n_sample,)."""
    length, lever, _ = stretch(balance, motion.position, slides=slides)
    return np.asarray(pull(length) * lever)
