"""The true robot of a simulated campaign: seeded deviations, stated ones, and unmodelled effects."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import HarmonicBalance, Inertial, Joint, Robot, Spring
from robid.robot.nuisance import NuisanceStd
from robid.robot.zeros import with_zeros
from robid.simulate.options import Imperfections, Truth

_MASS_DRAWS = 1  # keeps the draws of masses apart from those of springs


@dataclass(frozen=True)
class TrueRobot:
    """The robot that was simulated, and what of its simulation a fit may estimate."""

    robot: Robot
    truth: Truth
    imperfections: Imperfections
    delay_s: float  # Delay from recorded to applied torque, or of pose commands, hold excluded [s]
    seed: int
    steps_per_sample: int | None

    def without_springs(self, known: Collection[str]) -> Robot:
        """Returns the robot with the springs of these names alone."""
        springs = tuple(spring for spring in self.robot.springs if spring.name in known)
        return replace(self.robot, springs=springs)


def true_robot(robot: Robot, truth: Truth, further: tuple[Spring, ...] = ()) -> Robot:
    """Returns a robot that deviates from its file by seeded random amounts and by stated ones.

    Args:
        robot: Nominal robot.
        truth: Size and seed of the deviations; rotor inertias and masses.
        further: Springs that the file lacks, which have no random deviation.

    Returns:
        The robot with its springs, dampers, friction and masses multiplied by random factors, rotor inertias and masses
        by stated ones, with further couplings, counterbalances and zeros that are off, and with the further springs
        after its own.
    """
    generator = np.random.default_rng(truth.seed)
    damper_factor = truth.spring_factor if truth.damper_factor is None else truth.damper_factor
    spring_log = np.log([truth.spring_factor, damper_factor]) * generator.uniform(-1, 1, (len(robot.springs), 2))
    spring_log[[spring.name in truth.keep for spring in robot.springs]] = 0.0
    friction = 1 + truth.friction_relative * generator.uniform(-1, 1, (len(robot.joints), 3))
    springs = tuple(
        replace(spring, stiffness=spring.stiffness * float(factor[0]), damping=spring.damping * float(factor[1]))
        for spring, factor in zip(robot.springs, np.exp(spring_log), strict=True)
    )
    joints = tuple(_deviate(joint, *row) for joint, row in zip(robot.joints, friction.tolist(), strict=True))
    deviating = _deviating_masses(replace(robot, springs=springs, joints=joints), truth)
    return _with_drives(_reweighed(replace(deviating, springs=(*deviating.springs, *further)), truth), truth)


def bare(robot: Robot) -> Robot:
    """Returns a robot without what is not physics: names, notes, limits of the joints, what its file knows how well."""
    joints = tuple(
        replace(
            joint,
            lower=-np.inf,
            upper=np.inf,
            nuisance_std=NuisanceStd(),
            motor=replace(
                joint.motor,
                inertia_relative_std=0.0,
                torque_constant_nm_a=None,
                friction=replace(joint.motor.friction, relative_std=0.0),
            ),
        )
        for joint in robot.joints
    )
    return replace(robot, name="", assumed=(), notes=(), joints=joints, nuisance_std=NuisanceStd(), file_frames=None)


def recorded_torque_factor(robot: Robot, truth: Truth) -> FloatArray:
    """Returns recorded over true torque (n_joint,): wrong torque constants and signs."""
    names = [joint.name for joint in robot.joints]
    sign = np.where([name in truth.reversed_torque for name in names], -1.0, 1.0)
    return np.asarray(sign / [truth.torque_constant_factor.get(name, 1.0) for name in names])


def with_imperfections(robot: Robot, imperfections: Imperfections) -> Robot:
    """Returns the robot with the imperfections that are part of its description."""
    return replace(
        robot,
        springs=tuple(
            _stiffen(
                spring, imperfections.stiffening_1_m2 if robot.is_linear(spring) else imperfections.stiffening_1_rad2
            )
            for spring in robot.springs
        ),
        payload=_heavier(robot.payload, imperfections.unmodelled_payload_kg),
    )


def warmed(robot: Robot, imperfections: Imperfections, index: int) -> Robot:
    """Returns the robot with what is left of its motors' viscous friction in a campaign's configuration of an index."""
    passed = 1 - np.exp(-index / imperfections.drift_configurations)
    factor = float(1 + (imperfections.viscous_drift - 1) * passed)
    if factor == 1:
        return robot

    def drifted(joint: Joint) -> Joint:
        law = joint.motor.friction
        law = replace(law, viscous_nms_rad=factor * law.viscous_nms_rad)
        return replace(joint, motor=replace(joint.motor, friction=law))

    return replace(robot, joints=tuple(map(drifted, robot.joints)))


def _deviating_masses(robot: Robot, truth: Truth) -> Robot:
    """Multiplies each link's mass and inertia by a random factor each, from draws of their own."""
    least, most = truth.mass_relative
    if most == 0:
        return robot
    generator = np.random.default_rng([truth.seed, _MASS_DRAWS])
    shape = (len(robot.joints), 2)
    share = generator.uniform(least, most, shape) * generator.choice([-1.0, 1.0], shape)
    names = [joint.name for joint in robot.joints]
    mass, inertia = (dict(zip(names, column.tolist(), strict=True)) for column in (1 + share).T)
    # An inertia's factor comes on top of its mass's.
    further = {name: inertia[name] / mass[name] for name in names}
    return _reweighed(robot, Truth(mass_factor=mass, inertia_factor=further))


def _with_drives(robot: Robot, truth: Truth) -> Robot:
    """Adds couplings, counterbalances and errors of zeros that the robot file lacks."""

    def driven(joint: Joint) -> Joint:
        couplings = {**joint.couplings}
        for name, turn in truth.couplings.get(joint.name, {}).items():
            couplings[name] = couplings.get(name, 0.0) + turn
        waves = truth.counterbalance_nm.get(joint.name)
        balance = joint.counterbalance if waves is None else HarmonicBalance(*(np.array([wave]) for wave in waves))
        return replace(joint, couplings=couplings, counterbalance=balance)

    driven_robot = replace(robot, joints=tuple(driven(joint) for joint in robot.joints))
    return with_zeros(driven_robot, truth.zero_deg)


def _reweighed(robot: Robot, truth: Truth) -> Robot:
    """Multiplies rotor inertias, masses and inertias; a link's factors are those of its split parts."""

    def scaled(body: Inertial, name: str) -> Inertial:
        factor = truth.mass_factor.get(name, 1.0)
        spread = factor * truth.inertia_factor.get(name, 1.0)
        return (
            body if factor == spread == 1 else Inertial(factor * body.mass_kg, body.com_m, spread * body.inertia_kgm2)
        )

    def reweighed(joint: Joint) -> Joint:
        inertia = joint.motor.inertia_kgm2 * truth.rotor_inertia_factor.get(joint.name, 1.0)
        return replace(joint, link=scaled(joint.link, joint.name), motor=replace(joint.motor, inertia_kgm2=inertia))

    def split(spring: Spring) -> Spring:
        if spring.outboard is None:
            return spring
        return replace(spring, outboard=scaled(spring.outboard, robot.joints[spring.joint].name))

    return replace(
        robot,
        joints=tuple(reweighed(joint) for joint in robot.joints),
        springs=tuple(split(spring) for spring in robot.springs),
        payload=scaled(robot.payload, "payload"),
        base=None if robot.base is None else scaled(robot.base, "base"),
    )


def _deviate(joint: Joint, viscous: float, coulomb: float, shape: float) -> Joint:
    law = joint.motor.friction
    friction = replace(law.scaled(coulomb, shape), viscous_nms_rad=law.viscous_nms_rad * viscous)
    motor = replace(joint.motor, friction=friction)
    return replace(joint, motor=motor, arm_viscous=joint.arm_viscous * viscous)


def _stiffen(spring: Spring, share: float) -> Spring:
    if spring.place != "transmission" or share == 0:
        return spring
    return replace(spring, cubic=share * spring.stiffness)


def _heavier(payload: Inertial, extra_kg: float) -> Inertial:
    if extra_kg == 0:
        return payload
    factor = 1 + extra_kg / payload.mass_kg
    return Inertial(payload.mass_kg * factor, payload.com_m, payload.inertia_kgm2 * factor)
