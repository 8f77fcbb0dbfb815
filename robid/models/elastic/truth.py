"""The true values of an elastic fit's parameters in a true robot."""

from __future__ import annotations

import numpy as np

from robid.robot.description import HarmonicBalance, Joint, Robot
from robid.robot.linearize import axial_inertia
from robid.robot.model import build_model
from robid.simulate.options import Imperfections
from robid.simulate.truth import TrueRobot


def true_values(nominal: Robot, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of everything that an elastic fit may estimate, by the fit's own names.

    What the robot file has no spring for is no value of a fit: the springs that it lacks are left out.

    Args:
        nominal: The robot as its file describes it, with the campaign's payload.
        true: The robot that was simulated.
    """
    known = [spring.name for spring in nominal.springs]
    values: dict[str, float] = {}
    for spring in true.robot.springs:
        if spring.name in known:
            values[f"{spring.name}.stiffness"] = spring.stiffness
            values[f"{spring.name}.damping"] = spring.damping
            values[f"{spring.name}.cubic"] = spring.cubic
            place = zip("xyz", spring.point_m.tolist(), strict=True)
            values |= {f"{spring.name}.location_{axis}": x for axis, x in place}
    axial = axial_inertia(build_model(true.without_springs(known), balanced=True))
    for joint, stated, inertia in zip(true.robot.joints, nominal.joints, axial.tolist(), strict=True):
        values[f"{joint.name}.viscous"] = joint.motor.friction.viscous_nms_rad
        values[f"{joint.name}.arm_viscous"] = joint.arm_viscous
        values[f"{joint.name}.motor_inertia"] = joint.motor.inertia_kgm2
        values[f"{joint.name}.link_inertia"] = inertia
        errors = _torque_errors(joint, stated, true.imperfections)
        values |= {f"{joint.name}.{key}": value for key, value in errors.items()}
    values["delay"] = true.delay_s
    return values | _doubts(nominal, true.robot) | _drives(nominal, true)


def _doubts(nominal: Robot, robot: Robot) -> dict[str, float]:
    """What the robot file has wrong of payload and links, as freed doubts count it."""
    bodies = {joint.name: (joint.link, own.link) for joint, own in zip(nominal.joints, robot.joints, strict=True)}
    values = {"payload.mass": robot.payload.mass_kg}
    values |= {
        f"{name}.mass": 100 * (own.mass_kg / stated.mass_kg - 1)
        for name, (stated, own) in bodies.items()
        if stated.mass_kg
    }
    for name, (stated, own) in {"payload": (nominal.payload, robot.payload), **bodies}.items():
        shift = 1e3 * (own.com_m - stated.com_m)
        values |= {f"{name}.com_{axis}": float(x) for axis, x in zip("xyz", shift.tolist(), strict=True)}
    return values


def _drives(nominal: Robot, true: TrueRobot) -> dict[str, float]:
    """The same of couplings, recorded torques, counterbalances and what gears do beside springs and dampers."""
    values: dict[str, float] = {}
    for joint, stated in zip(true.robot.joints, nominal.joints, strict=True):
        for other in nominal.joints:
            turn = joint.couplings.get(other.name, 0.0) - stated.couplings.get(other.name, 0.0)
            values[f"{joint.name}.coupling_{other.name}"] = 100 * turn * other.motor.gear_ratio
        factor = true.truth.torque_constant_factor.get(joint.name, 1.0)
        values[f"{joint.name}.torque_constant"] = -100 * float(np.log(factor))
        own = joint.counterbalance
        waves = (own.sine_nm[0], own.cosine_nm[0]) if isinstance(own, HarmonicBalance) else (0.0, 0.0)
        values |= {f"{joint.name}.counterbalance_{n}": float(w) for n, w in zip(("sine", "cosine"), waves, strict=True)}
    flaws = true.imperfections
    for spring in nominal.springs:
        slip = flaws.hysteresis_n if nominal.is_linear(spring) else flaws.hysteresis_nm
        values |= {f"{spring.name}.load_damping": flaws.load_damping_1_rad, f"{spring.name}.hysteresis": slip}
    return values


def _torque_errors(joint: Joint, stated: Joint, flaws: Imperfections) -> dict[str, float]:
    """Relative errors of the robot file's friction and ripple, as the response's coefficients count them."""
    errors: dict[str, float] = {}
    law, known = joint.motor.friction, stated.motor.friction
    if known.coulomb_nm > 0 and flaws.friction != "none":
        errors["level"] = law.coulomb_nm / known.coulomb_nm - 1
        errors |= {"shape": law.presliding_rad / known.presliding_rad - 1} if flaws.friction == "lugre" else {}
    if stated.motor.ripple_nm > 0:
        # The ripple drives the motor; what a regressor counts opposes it.
        errors |= {"ripple_sin": -1.0 if flaws.ripple else 0.0, "ripple_cos": 0.0}
    return errors
