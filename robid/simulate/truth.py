"""The true robot of a simulated campaign: seeded deviations and unmodelled effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.robot.description import Friction, Inertial, Joint, Robot, Spring
from robid.simulate.options import Imperfections, Truth


def true_robot(robot: Robot, truth: Truth) -> Robot:
    """Returns a robot that deviates from its file by seeded random amounts.

    Args:
        robot: Nominal robot.
        truth: Size and seed of the deviations.

    Returns:
        The robot with its springs, dampers and friction multiplied by random factors.
    """
    generator = np.random.default_rng(truth.seed)
    damper_factor = truth.spring_factor if truth.damper_factor is None else truth.damper_factor
    spring_log = np.log([truth.spring_factor, damper_factor]) * generator.uniform(-1, 1, (len(robot.springs), 2))
    spring_log[[spring.name in truth.keep for spring in robot.springs]] = 0.0
    friction = 1 + truth.friction_relative * generator.uniform(-1, 1, (len(robot.joints), 3))
    springs = tuple(
        replace(
            spring,
            stiffness_nm_rad=spring.stiffness_nm_rad * float(factor[0]),
            damping_nms_rad=spring.damping_nms_rad * float(factor[1]),
        )
        for spring, factor in zip(robot.springs, np.exp(spring_log), strict=True)
    )
    joints = tuple(_deviate(joint, *row) for joint, row in zip(robot.joints, friction.tolist(), strict=True))
    return replace(robot, springs=springs, joints=joints)


def with_imperfections(robot: Robot, imperfections: Imperfections) -> Robot:
    """Returns the robot with the imperfections that are part of its description."""
    return replace(
        robot,
        springs=tuple(_stiffen(spring, imperfections.stiffening_1_rad2) for spring in robot.springs),
        payload=_heavier(robot.payload, imperfections.unmodelled_payload_kg),
    )


def _deviate(joint: Joint, viscous: float, coulomb: float, shape: float) -> Joint:
    law = joint.motor.friction
    friction = Friction(
        viscous_nms_rad=law.viscous_nms_rad * viscous,
        coulomb_nm=law.coulomb_nm * coulomb,
        static_nm=law.static_nm * coulomb,
        stribeck_rad_s=law.stribeck_rad_s * shape,
        presliding_rad=law.presliding_rad * shape,
        relative_std=law.relative_std,
    )
    return replace(joint, motor=replace(joint.motor, friction=friction))


def _stiffen(spring: Spring, share: float) -> Spring:
    if spring.place != "transmission" or share == 0:
        return spring
    return replace(spring, cubic_nm_rad3=share * spring.stiffness_nm_rad)


def _heavier(payload: Inertial, extra_kg: float) -> Inertial:
    if extra_kg == 0:
        return payload
    factor = 1 + extra_kg / payload.mass_kg
    return Inertial(payload.mass_kg * factor, payload.com_m, payload.inertia_kgm2 * factor)
