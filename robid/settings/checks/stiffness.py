"""What must hold of shafts in a robot file, and where a stiffness depends on a joint's position."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection, SpringSection
from robid.settings.stiffness import StiffnessOver
from robid.settings.yaml import FieldPath

_Found = Iterator[tuple[FieldPath, str]]
_POINTS = 2001
_ROUNDING = 1e-9


def check_stiffness_over(field: FieldPath, law: StiffnessOver, robot: RobotFile) -> _Found:
    """Yields what is wrong with one law.

    Args:
        field: Where it stands.
        law: The law.
        robot: The robot file.
    """
    joints = {joint.name: joint for joint in robot.joints}
    if law.joint not in joints:
        yield (*field, "joint"), f"there is no joint `{law.joint}`; {suggest(law.joint, joints)}"
        return
    forms = law.forms
    if len(forms) != 1:
        found = f"found {' and '.join(forms)}" if forms else "found none"
        yield field, f"needs one of `factors` with their positions, `stiffness` and `compliance` ({found})"
    elif forms == ("factors",):
        yield from _table(field, law, joints[law.joint])
    else:
        yield from _polynomial((*field, forms[0]), law, joints[law.joint])


def _table(field: FieldPath, law: StiffnessOver, joint: JointSection) -> _Found:
    wanted, other = ("positions_m", "positions_deg") if joint.slides else ("positions_deg", "positions_m")
    positions = getattr(law, wanted)
    if getattr(law, other) is not None:
        yield (*field, other), f"has the wrong unit for `{joint.name}`: write `{wanted}`"
    elif positions is None:
        yield (*field, wanted), "is missing: one position for each of the `factors`"
    elif law.factors is None:
        yield (*field, "factors"), "is missing: one for each of the positions"
    elif len(law.factors) != len(positions):
        yield (*field, "factors"), f"has {len(law.factors)} values for {len(positions)} positions"
    elif (np.diff(positions) <= 0).any():
        yield (*field, wanted), "must ascend"
    else:
        limits, unit = joint.stated_limits, joint.limits_unit
        if limits and (positions[0] > limits[0] + _ROUNDING or positions[-1] < limits[1] - _ROUNDING):
            message = f"goes from {positions[0]:g} to {positions[-1]:g} {unit}, but `{joint.name}` from {limits[0]:g}"
            yield (*field, wanted), f"{message} to {limits[1]:g} {unit}"


def _polynomial(field: FieldPath, law: StiffnessOver, joint: JointSection) -> _Found:
    limits = joint.stated_limits
    if limits is None:
        return
    stated = np.linspace(limits[0], limits[1], _POINTS)
    value = np.polynomial.Polynomial(law.stiffness or law.compliance or (0.0,))(
        stated if joint.slides else np.deg2rad(stated)
    )
    if value.min() <= 0:
        shown = float(stated[value.argmin()])
        message = f"must be above 0 wherever `{joint.name}` may be, but is {value.min():.4g}"
        yield field, f"{message} at {shown:g} {joint.limits_unit}"


def check_shaft(field: FieldPath, spring: SpringSection, robot: RobotFile) -> _Found:
    """Yields what is wrong with a spring that is a shaft, or that has a shaft's inertia and is none.

    Args:
        field: Where it stands.
        spring: The spring.
        robot: The robot file.
    """
    is_shaft = spring.place == "shaft"
    if is_shaft != (spring.inertia_kgm2 is not None):
        yield (*field, "inertia_kgm2"), "is missing: a shaft needs it" if is_shaft else "is for shafts only"
    if not is_shaft:
        return
    for joint in robot.joints:
        if joint.name == spring.joint and joint.rigid:
            yield (*field, "joint"), f"joint `{joint.name}` is rigid: a shaft lies before a transmission"
    for gear in robot.all_springs:
        if gear.joint == spring.joint and gear.place == "transmission" and (gear.cubic_nm_rad3 or gear.cubic_n_m3):
            yield (*field, "place"), f"`{gear.name}` is cubic: what swings it can only be told without shafts before it"
