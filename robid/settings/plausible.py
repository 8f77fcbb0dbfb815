"""Values of a robot file that are possible, but not for a robot: slips of unit and decimal point."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.robot.inertia import stretched_inertia
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found = Iterator[tuple[FieldPath, str]]
_LARGEST_RATIO = 2000.0
_RUN_UP_S = (2e-4, 10.0)
_SMALLEST_SHARE = 2e-3
_LARGEST_SHARE = 30.0
_MASS_TOLERANCE = 0.01


def implausible(robot: RobotFile) -> _Found:
    """Yields gear ratios, motor inertias and a total mass that cannot be meant, with the reason."""
    yield from _ratios(robot)
    yield from _run_up(robot)
    if all((joint.dh or joint.frame) and joint.link and joint.link.mass_kg > 0 for joint in robot.joints):
        yield from _reflected(robot)
        yield from _mass(robot)


def _ratios(robot: RobotFile) -> _Found:
    for index, joint in enumerate(robot.joints):
        ratio = joint.motor.gear_ratio
        if 1 <= ratio <= _LARGEST_RATIO:
            continue
        reason = f"{ratio:g} is implausible: motor turns per arm turn are a number from 1 to {_LARGEST_RATIO:g}"
        if 1 <= np.deg2rad(ratio) <= _LARGEST_RATIO:
            reason += f"; {ratio:g} would be {np.deg2rad(ratio):.4g} taken for degrees per radian"
        elif 0 < ratio < 1:
            reason += f"; its inverse, {1 / ratio:.4g}, may be meant"
        yield ("joints", index, "motor", "gear_ratio"), reason


def _run_up(robot: RobotFile) -> _Found:
    """A motor alone, at full torque, reaches its speed within milliseconds to seconds."""
    for index, joint in enumerate(robot.joints):
        motor = joint.motor
        if motor.max_speed_rad_s is None or motor.max_torque_nm is None:
            continue
        time_s = motor.inertia_kgm2 * motor.max_speed_rad_s / motor.max_torque_nm
        if not _RUN_UP_S[0] <= time_s <= _RUN_UP_S[1]:
            message = (
                f"{motor.inertia_kgm2:g} kg m^2 is implausible: at {motor.max_torque_nm:.3g} N m the rotor alone would "
                f"take {time_s:.2g} s to {motor.max_speed_rad_s:.3g} rad/s; check the units (g cm^2 is 1e-7 kg m^2)"
            )
            yield ("joints", index, "motor", "inertia_kgm2"), message


def _reflected(robot: RobotFile) -> _Found:
    """The rotor behind its gear and the arm that it moves are of comparable inertia."""
    moved = stretched_inertia([position for position, _ in robot.joint_frames()], robot.links())
    for index, joint in enumerate(robot.joints):
        motor = joint.motor
        reflected = motor.inertia_kgm2 * motor.gear_ratio**2
        if not 1 <= motor.gear_ratio <= _LARGEST_RATIO:
            continue
        if reflected < _SMALLEST_SHARE * moved[index]:
            compared = f"{_rounded(moved[index] / reflected)} times less than what `{joint.name}` moves, stretched out"
        elif reflected > _LARGEST_SHARE * moved.max():
            compared = f"{_rounded(reflected / moved.max())} times that of the whole arm, stretched out"
        else:
            continue
        message = (
            f"{motor.inertia_kgm2:g} kg m^2 is implausible: behind a ratio of {motor.gear_ratio:g} it is "
            f"{reflected:.3g} kg m^2 at the arm, {compared}"
        )
        yield ("joints", index, "motor", "inertia_kgm2"), message


def _rounded(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def _mass(robot: RobotFile) -> _Found:
    if robot.total_mass_kg is None:
        return
    masses = {joint.name: link.mass_kg for joint, link in zip(robot.joints, robot.links(), strict=True)}
    found = sum(masses.values())
    if abs(found - robot.total_mass_kg) > _MASS_TOLERANCE * robot.total_mass_kg:
        parts = ", ".join(f"{name} {mass:.4g}" for name, mass in masses.items())
        message = f"{robot.total_mass_kg:g} kg is stated, but the links that move have {found:.6g} kg ({parts})"
        yield ("total_mass_kg",), message
