"""Robot files that are roughly right: every value off by a factor of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

from robid.arrays import FloatArray
from robid.settings.base import Section
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import Body, JointSection
from robid.studies.settings.unit_mistakes import Rough

_DRAWS, _CONSTANT_DRAWS = 3, 4  # keep these draws apart from those of the true robot
_FRICTION = ("viscous_nms_rad", "coulomb_nm", "static_nm")
_STIFFNESS = ("stiffness_nm_rad", "stiffness_n_m")
_DAMPING = ("damping_nms_rad", "damping_ns_m")
_Part = TypeVar("_Part", bound=Section)


class Factors:
    """Draws log-uniform factors."""

    def __init__(self, seed: int, draws: int) -> None:
        """Starts the draws of a robot."""
        self._generator = np.random.default_rng([seed, draws])

    def up_to(self, largest: float) -> float:
        """Returns the next factor, between one over the largest and the largest."""
        return float(np.exp(np.log(largest) * self._generator.uniform(-1, 1)))


def rough_robot(robot: RobotFile, rough: Rough, seed: int) -> RobotFile:
    """Returns a robot file that is roughly that of a robot."""
    factors = Factors(seed, _DRAWS)
    masses = {joint.name: (factors.up_to(rough.mass), factors.up_to(rough.inertia)) for joint in robot.joints}
    joints = tuple(_rough_joint(joint, masses[joint.name], rough, factors) for joint in robot.joints)
    springs = []
    for spring in robot.springs:
        changed = _rough_spring(spring, rough, factors)
        if spring.outboard is not None and spring.joint is not None:
            # Part of the link: lighter or heavier together with it.
            changed = changed.model_copy(update={"outboard": _rough_body(spring.outboard, *masses[spring.joint])})
        springs.append(changed)
    return robot.model_copy(update={"joints": joints, "springs": tuple(springs)})


def rough_torque_constants(n_joint: int, rough: Rough, seed: int) -> FloatArray:
    """Returns the factors (n_joint,) by which torque constants, and so the torques of a log, are off."""
    factors = Factors(seed, _CONSTANT_DRAWS)
    return np.array([factors.up_to(rough.torque_constant) for _ in range(n_joint)])


def _rough_joint(joint: JointSection, masses: tuple[float, float], rough: Rough, factors: Factors) -> JointSection:
    rotor, friction = factors.up_to(rough.rotor_inertia), factors.up_to(rough.friction)
    changed: dict[str, Any] = {}
    if joint.motor is not None:
        law = _scaled(joint.motor.friction, dict.fromkeys(_FRICTION, friction))
        changed["motor"] = _scaled(joint.motor, {"inertia_kgm2": rotor}).model_copy(update={"friction": law})
    if joint.gear is not None:
        changed["gear"] = _rough_spring(joint.gear, rough, factors)
    if joint.link is not None:
        changed["link"] = _rough_body(joint.link, *masses)
    return joint.model_copy(update=changed)


def _rough_body(body: Body, mass: float, beside: float) -> Body:
    tensor = _scaled(body.inertia_kgm2, dict.fromkeys(type(body.inertia_kgm2).model_fields, mass * beside))
    return body.model_copy(update={"mass_kg": body.mass_kg * mass, "inertia_kgm2": tensor})


def _rough_spring(spring: _Part, rough: Rough, factors: Factors) -> _Part:
    stiffness, damping = factors.up_to(rough.spring), factors.up_to(rough.damper)
    return _scaled(spring, dict.fromkeys(_STIFFNESS, stiffness) | dict.fromkeys(_DAMPING, damping))


def _scaled(section: _Part, factors: Mapping[str, float]) -> _Part:
    """The section with these of its values, where it states them, times factors."""
    stated = {key: getattr(section, key) for key in factors}
    return section.model_copy(update={key: value * factors[key] for key, value in stated.items() if value is not None})
