"""True values of gears in a simulated robot, in the terms of data sheets."""

from __future__ import annotations

import numpy as np

from robid.models.transmission.fit.law import BAND_SHARE, GearLaw, data_sheet_loop
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.robot.description import Joint, Robot, Spring
from robid.robot.model import HYSTERESIS_SHARE
from robid.simulate.options import Imperfections
from robid.simulate.truth import TrueRobot, with_imperfections


def true_values_of(robot: Robot, true: TrueRobot, options: TransmissionFitOptions) -> dict[str, float]:
    """Returns the true value of what is known of each gear, by the name that a fit gives it.

    Lost motion and hysteresis are known where the gear's rated torque is stated, for the loop is measured there.
    """
    found: dict[str, float] = {}
    flaws = true.imperfections
    for spring in with_imperfections(true.robot, flaws).springs:
        if spring.place != "transmission":
            continue
        joint = robot.joints[spring.joint]
        slides = joint.type == "prismatic"
        slip, backlash = (flaws.hysteresis_n, flaws.backlash_m) if slides else (flaws.hysteresis_nm, flaws.backlash_rad)
        found |= _encoders(spring.joint, joint, true, options)
        found |= {
            f"{spring.name}.stiffness": spring.stiffness,
            f"{spring.name}.cubic": spring.cubic,
            f"{joint.name}.slip": slip,
            f"{joint.name}.backlash": backlash,
        }
        rated = options.rated_torque_nm.get(joint.name)
        if rated is None and joint.motor.rated_torque_nm is not None:
            rated = abs(joint.motor.gear_ratio) * joint.motor.rated_torque_nm
        if rated is not None:
            found |= _measured(joint.name, spring, slip, backlash, rated)
    return found


def _encoders(index: int, joint: Joint, true: TrueRobot, options: TransmissionFitOptions) -> dict[str, float]:
    """Lag of the arm's encoder behind the motor's, and what repeats with the turns of motor and arm."""
    flaws = true.imperfections
    late_s = flaws.link_encoder_lag_s - true.truth.late_angle_s.get(joint.name, 0.0)
    found = {f"{joint.name}.encoder_lag": late_s}
    if joint.type == "prismatic":
        return found
    for order in options.gear.motor_orders:
        found |= _wave(f"{joint.name}.motor_turn_{order:g}", _of_motor(index, joint, flaws, order))
    turning = flaws.link_encoder_eccentricity_rad * np.exp(1j * flaws.link_encoder_eccentricity_phase_rad)
    return found | _wave(f"{joint.name}.arm_turn_1", complex(turning))


def _of_motor(index: int, joint: Joint, flaws: Imperfections, order: float) -> complex:
    """Sine and cosine of an error with periods per motor turn, arm side, as real and imaginary part.

    What the motor's encoder shows too much, the gear seems to lack.
    """
    found = 0j
    phases = [*flaws.transmission_error_phase_rad, *[0.0] * len(flaws.transmission_error_rad)]
    for harmonic, (size, phase) in enumerate(zip(flaws.transmission_error_rad, phases, strict=False), start=1):
        if order == harmonic:
            found += size * np.exp(1j * (phase + index))
    if order == flaws.gear_error_order:
        found += flaws.gear_error_rad * np.exp(1j * (flaws.gear_error_phase_rad + index))
    if order == flaws.resolver_order:
        found -= flaws.resolver_error_rad / joint.motor.gear_ratio
    return complex(found)


def _wave(name: str, of: complex) -> dict[str, float]:
    """Amplitude and phase; no phase where there is no wave."""
    return {name: abs(of)} | ({f"{name}.phase": float(np.angle(of))} if abs(of) > 0 else {})


def _measured(joint: str, spring: Spring, slip: float, backlash: float, rated: float) -> dict[str, float]:
    law = GearLaw(
        *(
            np.array([value])
            for value in (
                spring.stiffness,
                spring.cubic / spring.stiffness,
                slip,
                max(slip, 1e-9) / (HYSTERESIS_SHARE * spring.stiffness),
                backlash,
            )
        )
    )
    loop = data_sheet_loop(law, rated, BAND_SHARE * rated)
    return {f"{joint}.lost_motion": float(loop.lost_motion(rated)[0]), f"{joint}.hysteresis": float(loop.width()[0])}
