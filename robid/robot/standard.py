"""Standard parameters of a rigid model back into the description of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.robot.balances import Counterbalance, GasBalance, HarmonicBalance, SpringBalance
from robid.robot.description import Inertial, Joint, Robot, Spring
from robid.robot.friction import Friction, with_level
from robid.robot.inertia import about_origin, remove
from robid.robot.regressor.links import COMPONENTS, PAYLOAD

_HOMELESS = (
    *("torque_offset", "load_friction", "quadratic_viscous"),
    *("coupling_inertia", "coupling_viscous", "coupling_coulomb"),
)
_NO_PAYLOAD = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
_LEAST_INERTIA = 1e-12  # a motor has some


@dataclass(frozen=True)
class StandardRobot:
    """A robot with given standard parameters."""

    robot: Robot
    payload_is_in_link: bool  # Whether its payload is in its last link, as no real body would be left without it
    homeless: tuple[str, ...]  # Parameters that differ from zero and that a robot's description has no place for
    averaged: tuple[str, ...]  # Joints whose friction differs between directions; the description has the mean


def with_standard(robot: Robot, values: Mapping[str, float]) -> StandardRobot:
    """Returns a robot with other masses, inertias, friction and counterbalances.

    Parts of links beyond split springs are deformed as their link is.

    Args:
        robot: The robot, with the payload that the parameters were found with.
        values: Standard parameters of its rigid model by name; what is not there stays.
    """
    shafts = robot.shaft_inertia_kgm2.tolist()
    joints = tuple(_joint(joint, values, shaft) for joint, shaft in zip(robot.joints, shafts, strict=True))
    loops = tuple(replace(link, link=_body(link.name, link.link, values)) for link in robot.loop_links)
    payload, in_link = _body(PAYLOAD, robot.payload, values), False
    if f"{PAYLOAD}.M" not in values and payload.mass_kg > 0 and f"{joints[-1].name}.M" in values:
        # The parameters of the last link hold the payload: it is taken out again if a real body is left.
        alone = remove(joints[-1].link, payload)
        in_link = not is_real(alone)
        if in_link:
            payload = _NO_PAYLOAD
        else:
            joints = (*joints[:-1], replace(joints[-1], link=alone))
    springs = tuple(_spring(spring, robot.joints[spring.joint], joints[spring.joint]) for spring in robot.springs)
    return StandardRobot(
        robot=replace(robot, joints=joints, loop_links=loops, payload=payload, springs=springs),
        payload_is_in_link=in_link,
        homeless=tuple(name for name, value in values.items() if name.rpartition(".")[2] in _HOMELESS and value != 0),
        averaged=tuple(joint.name for joint in robot.joints if f"{joint.name}.coulomb_forward" in values),
    )


def inertial_of(standard: FloatArray) -> Inertial:
    """Returns the body of ten standard parameters (10,), in the order of `COMPONENTS`; it may be no real one."""
    mass, first = float(standard[9]), standard[6:9]
    com = first / mass if mass > 0 else np.zeros(3)
    inertia = np.zeros((3, 3))
    inertia[np.triu_indices(3)] = standard[:6]
    # Six entries of a symmetric matrix; Steiner's term is taken off to come to the centre of mass.
    inertia = inertia + np.triu(inertia, 1).T
    return Inertial(mass, com, inertia - mass * (com @ com * np.eye(3) - np.outer(com, com)))


def is_real(body: Inertial) -> bool:
    """Whether a body could be: its mass lies somewhere, and is nowhere negative."""
    return bool(np.linalg.eigvalsh(_density_moments(body)).min() > 0)


def deformed(part: Inertial, before: Inertial, after: Inertial) -> Inertial:
    """Deforms a part of a body as the body is deformed, so that what is left of it stays a real body too.

    The body's space is mapped affinely and its density scaled alike everywhere, so that its moments become the others.

    Args:
        part: The part, in the body's frame.
        before: The real body that it is part of.
        after: The real body that this becomes.
    """
    # x -> A x with A = U_after U_before^-1 maps all moments of the body onto the wanted ones: A S A'.
    change = _root(_density_moments(after)) @ np.linalg.inv(_root(_density_moments(before)))
    moments = change @ _density_moments(part) @ change.T
    mass, com = float(moments[3, 3]), moments[:3, 3] / moments[3, 3]
    second = moments[:3, :3] - mass * np.outer(com, com)
    return Inertial(mass, com, np.trace(second) * np.eye(3) - second)


def _density_moments(body: Inertial) -> FloatArray:
    """Moments (4, 4) of a body's density: second and first ones about the frame's origin, and its mass."""
    about = about_origin(body)
    # int x x' dm = tr(I) / 2 1 - I, the pseudo-inertia's block (Wensing, Kim and Slotine 2018).
    second = 0.5 * np.trace(about) * np.eye(3) - about
    first = body.mass_kg * body.com_m
    return np.block([[second, first[:, None]], [first[None], np.array([[body.mass_kg]])]])


def _root(moments: FloatArray) -> FloatArray:
    """Upper triangle `U` with `U U^T` the moments: a map of space by whose last row nothing but density changes."""
    # Reversed twice, Cholesky's lower factor becomes an upper one.
    return np.asarray(np.linalg.cholesky(moments[::-1, ::-1])[::-1, ::-1])


def _body(name: str, stated: Inertial, values: Mapping[str, float]) -> Inertial:
    if f"{name}.M" not in values:
        return stated
    return inertial_of(np.array([values[f"{name}.{component}"] for component in COMPONENTS]))


def _spring(spring: Spring, before: Joint, after: Joint) -> Spring:
    if spring.outboard is None or before.link is after.link:
        return spring
    return replace(spring, outboard=deformed(spring.outboard, before.link, after.link))


def _joint(joint: Joint, values: Mapping[str, float], shaft: float) -> Joint:
    """Puts a joint's values in place; what its shafts turn is not its rotor's."""
    if not joint.has_motor:
        return _without_motor(joint, values)
    inertia = values.get(f"{joint.name}.motor_inertia", joint.motor.inertia_kgm2 + shaft) - shaft
    inertia = max(inertia, _LEAST_INERTIA)
    motor = replace(joint.motor, inertia_kgm2=inertia, friction=_friction(joint, values))
    return replace(
        joint, link=_body(joint.name, joint.link, values), motor=motor, counterbalance=_counterbalance(joint, values)
    )


def _without_motor(joint: Joint, values: Mapping[str, float]) -> Joint:
    """The same of a joint without a motor, whose viscous friction is the arm's."""
    coulomb = _mean(joint.name, "coulomb", values, joint.motor.friction.coulomb_nm)
    law = replace(joint.motor.friction, coulomb_nm=coulomb, static_nm=coulomb)
    return replace(
        joint,
        link=_body(joint.name, joint.link, values),
        motor=replace(joint.motor, friction=law),
        arm_viscous=_mean(joint.name, "viscous", values, joint.arm_viscous),
        counterbalance=_counterbalance(joint, values),
    )


def _friction(joint: Joint, values: Mapping[str, float]) -> Friction:
    """Friction with other levels; breakaway keeps its ratio to the Coulomb level."""
    law, arm = joint.motor.friction, 0.0 if joint.couplings else joint.reflected_viscous_nms_rad
    viscous = max(0.0, _mean(joint.name, "viscous", values, law.viscous_nms_rad + arm) - arm)
    coulomb = _mean(joint.name, "coulomb", values, law.coulomb_nm)
    return replace(with_level(law, coulomb), viscous_nms_rad=viscous)


def _mean(name: str, kind: str, values: Mapping[str, float], stated: float) -> float:
    """Mean over both directions, where they differ; friction never drives."""
    forward = values.get(f"{name}.{kind}_forward", values.get(f"{name}.{kind}", stated))
    backward = values.get(f"{name}.{kind}_backward", forward)
    return max(0.0, 0.5 * (forward + backward))


def _counterbalance(joint: Joint, values: Mapping[str, float]) -> Counterbalance | None:
    balance = joint.counterbalance
    if isinstance(balance, SpringBalance):
        return replace(
            balance,
            stiffness_n_m=values.get(f"{joint.name}.counterbalance_stiffness", balance.stiffness_n_m),
            preload_n=values.get(f"{joint.name}.counterbalance_preload", balance.preload_n),
        )
    if isinstance(balance, GasBalance):
        pressure = values.get(f"{joint.name}.counterbalance_pressure", balance.rest_pressure_pa)
        return replace(balance, rest_pressure_pa=pressure)
    if isinstance(balance, HarmonicBalance):
        stated = (("sin", balance.sine_nm), ("cos", balance.cosine_nm))
        found = [
            np.array([values.get(f"{joint.name}.counterbalance_{wave}{k + 1}", own) for k, own in enumerate(levels)])
            for wave, levels in stated
        ]
        return HarmonicBalance(found[0], found[1])
    return None
