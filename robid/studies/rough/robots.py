"""Rigid robots with random masses and friction, and the rough robot files that fits of them are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.options import TrajectoryOptions
from robid.pipeline.design_excitation import base_model
from robid.robot.description import HarmonicBalance, Inertial, Joint, Robot
from robid.simulate.options import Truth
from robid.simulate.truth import true_robot
from robid.studies.mistakes.unit_logs import Factors
from robid.studies.settings.rough import FileErrors, RoughArm, Spread

_ROBOT, _FILE, _SHARES = 1, 2, 3  # keep the draws of a robot and of its file apart
_SECOND_HARMONIC = 0.1  # of the first: a counterbalance is no mass


def between(ends: tuple[float, float], generator: np.random.Generator) -> float:
    """Draws a log-uniform number between two ends."""
    return float(np.exp(generator.uniform(float(np.log(ends[0])), float(np.log(ends[1])))))


def drawn_robot(robot: Robot, arm: RoughArm, spread: Spread, seed: int, *, balanced: bool) -> Robot:
    """Returns a rigid robot like that of a file, with values drawn about the file's and a payload of up to the arm's.

    A `balanced` one has a counterbalance.
    """
    factors, generator = Factors(seed, _ROBOT), np.random.default_rng([seed, _SHARES])
    names = [joint.name for joint in robot.joints]
    truth = Truth(
        mass_factor={name: factors.up_to(spread.mass) for name in names},
        inertia_factor={name: factors.up_to(spread.inertia) for name in names},
        rotor_inertia_factor={name: factors.up_to(spread.rotor_inertia) for name in names},
    )
    rigid = true_robot(replace(robot, springs=()), truth)
    mass = arm.payload_kg * generator.uniform()
    centre = np.array(arm.payload_com_m) * generator.uniform(0.5, 1.5, 3)
    # A body as large as its centre is far from the flange.
    payload = Inertial(mass, centre, mass * 0.5 * float(np.sum(centre**2)) * np.eye(3))
    joints = tuple(
        _rubbing(
            joint, factors.up_to(spread.viscous), between(spread.dry, generator), between(spread.dry_width, generator)
        )
        for joint in rigid.joints
    )
    loaded = replace(rigid, joints=joints, payload=payload)
    share = generator.uniform(*spread.balance_share)
    return _balanced(loaded, arm, share) if balanced else loaded


def rough_file(robot: Robot, errors: FileErrors, seed: int) -> Robot:
    """Returns what a rough file says of a robot: no counterbalance, and values that are off by random factors."""
    factors, generator = Factors(seed, _FILE), np.random.default_rng([seed, _SHARES, _FILE])
    names = [joint.name for joint in robot.joints]
    small = names[len(names) // 2 :]
    truth = Truth(
        mass_factor={
            name: factors.up_to(errors.small_links if name in small else errors.large_links) for name in names
        },
        rotor_inertia_factor={name: factors.up_to(errors.rotor_inertia) for name in names},
    )
    off = generator.standard_normal(3)
    centre = robot.payload.com_m + errors.payload_com_m * off / np.linalg.norm(off)
    joints = tuple(replace(joint, counterbalance=None) for joint in true_robot(robot, truth).joints)
    joints = tuple(
        _rubbing(joint, factors.up_to(errors.friction), factors.up_to(errors.friction), 1.0) for joint in joints
    )
    return replace(robot, joints=joints, payload=replace(robot.payload, com_m=centre))


def _rubbing(joint: Joint, viscous: float, dry: float, width: float) -> Joint:
    """A joint with its motor's viscous coefficient, dry levels, and speeds and deflections times a factor each."""
    law = joint.motor.friction
    friction = replace(law.scaled(dry, width), viscous_nms_rad=viscous * law.viscous_nms_rad)
    return replace(joint, motor=replace(joint.motor, friction=friction))


def _balanced(robot: Robot, arm: RoughArm, share: float) -> Robot:
    """A robot with a counterbalance that takes a share of what gravity does to one joint at the home position."""
    index = [joint.name for joint in robot.joints].index(arm.balanced)
    turned = np.repeat(np.radians(arm.home_deg)[None], 2, axis=0)
    turned[:, index] = 0.0, np.pi / 2
    model = base_model(robot, TrajectoryOptions())
    still = np.zeros((3, 1, len(robot.joints)))
    held = model.torques(turned, still)[:, 0] @ robot.motor_per_arm
    # Gravity about an axis is `cosine cos q + sine sin q`: what it is at 0 and at a quarter turn.
    cosine, sine = share * held[:, index]
    balance = HarmonicBalance(sine * np.array([1, _SECOND_HARMONIC]), cosine * np.array([1, _SECOND_HARMONIC]))
    joints = [replace(joint, counterbalance=balance) if at == index else joint for at, joint in enumerate(robot.joints)]
    return replace(robot, joints=tuple(joints))


def rated_torque_nm(robot: Robot, share: float) -> FloatArray:
    """Returns the rated torques (n_joint,) of motors, a share of the peak torques that their file states [N m]."""
    return share * np.array([joint.motor.max_torque_nm for joint in robot.joints])


def with_rated(robot: Robot, rated_nm: FloatArray) -> Robot:
    """Returns a robot whose file states rated torques (n_joint,) of its motors [N m]."""
    joints = (
        replace(joint, motor=replace(joint.motor, rated_torque_nm=rated))
        for joint, rated in zip(robot.joints, rated_nm.tolist(), strict=True)
    )
    return replace(robot, joints=tuple(joints))
