"""True values of gears in a simulated robot, in the terms of data sheets."""

from __future__ import annotations

import numpy as np

from robid.models.transmission.fit.law import BAND_SHARE, GearLaw, data_sheet_loop
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.robot.description import Robot, Spring
from robid.robot.model import HYSTERESIS_SHARE
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
