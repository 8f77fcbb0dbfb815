"""The robot that a fit found: the robot file with its estimates in place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robid.models.elastic.fit.nuisance.kinds import freeable_nuisances, moved_robot
from robid.results.estimate import Estimate
from robid.robot.description import Inertial, Joint, Motor, Robot, Spring
from robid.robot.parameters import DOUBT, PARAMETER_KINDS

_LEAST_FACTOR = 0.01
_SPRING_VALUES = [kind for kind, about in PARAMETER_KINDS.items() if about.owner in ("spring", "transmission")]


def fitted_robot(robot: Robot, estimate: Estimate) -> Robot:
    """Puts estimates into a robot; what was not estimated stays as it is.

    Args:
        robot: The robot file that the fit started from; with another payload, what the fit found of it is as much more.
        estimate: What the fit found.

    Returns:
        The robot with springs, dampers, viscous friction, inertias, and, where the fit corrected them, the
        coefficients of friction and ripple, and moved by the doubts that it estimated. A friction's lag and a torque's
        scale belong to the measurement.
    """
    every = freeable_nuisances(robot) if DOUBT in estimate.kinds else ()
    off = [each for each in every if each.name in estimate.found]
    amounts = np.array([estimate.found[each.name] - estimate.stated[each.name] for each in off])
    return with_estimates(moved_robot(robot, off, amounts), estimate.found, estimate.stated)


def with_estimates(robot: Robot, found: Mapping[str, float], nominal: Mapping[str, float]) -> Robot:
    """Puts estimates into a robot, as `fitted_robot` does.

    Args:
        robot: The robot file that the fit started from.
        found: Estimates by name of the parameter.
        nominal: Values of the robot file, of at least these.
    """
    springs = tuple(_spring(spring, found) for spring in robot.springs)
    joints = tuple(_joint(joint, found, nominal) for joint in robot.joints)
    return replace(robot, springs=springs, joints=joints)


def fitted_delay_s(estimate: Estimate, nominal_s: float) -> float:
    """Returns the estimated delay, or the nominal one where it was not estimated [s]."""
    return estimate.found.get("delay", nominal_s)


def _spring(spring: Spring, found: Mapping[str, float]) -> Spring:
    point = [found.get(f"{spring.name}.location_{axis}") for axis in "xyz"]
    moved = any(value is not None for value in point)
    return replace(
        spring,
        **{kind: found.get(f"{spring.name}.{kind}", getattr(spring, kind)) for kind in _SPRING_VALUES},
        point_m=np.where([value is None for value in point], spring.point_m, np.array(point, float))
        if moved
        else spring.point_m,
    )


def _joint(joint: Joint, found: Mapping[str, float], nominal: Mapping[str, float]) -> Joint:
    name, link = f"{joint.name}.link_inertia", joint.link
    if name in found:
        # The fit counts a link's own inertia about its joint axis, or its mass, whatever else the last link carries.
        more = found[name] - nominal[name]
        if joint.type == "prismatic":
            link = Inertial(link.mass_kg + more, link.com_m, link.inertia_kgm2)
        else:
            link = Inertial(link.mass_kg, link.com_m, link.inertia_kgm2 + np.diag([0.0, 0.0, more]))
    arm_viscous = found.get(f"{joint.name}.arm_viscous", joint.arm_viscous)
    return replace(joint, link=link, motor=_motor(joint.name, joint.motor, found), arm_viscous=arm_viscous)


def _motor(name: str, motor: Motor, found: Mapping[str, float]) -> Motor:
    law = motor.friction
    level, shape = (max(_LEAST_FACTOR, 1 + found.get(f"{name}.{kind}", 0.0)) for kind in ("level", "shape"))
    viscous = found.get(f"{name}.viscous", law.viscous_nms_rad)
    friction = replace(law.scaled(level, shape), viscous_nms_rad=viscous)
    changed = replace(motor, inertia_kgm2=found.get(f"{name}.motor_inertia", motor.inertia_kgm2), friction=friction)
    if f"{name}.ripple_sin" not in found:
        return changed
    # What the fit counts opposes the motion; the description's ripple drives it.
    sine, cosine = -found[f"{name}.ripple_sin"], -found[f"{name}.ripple_cos"]
    size, phase = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
    return replace(changed, ripple_nm=motor.ripple_nm * size, ripple_phase_rad=phase)
