"""The Staubli TX40 of the public recording: what was published of its motors, its wrist and its friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from robid.models.rigid.fit.solution import RigidSolution
from robid.robot.description import Robot

PUBLISHED: Mapping[str, float] = {
    **{"Ia3": 0.0988, "Ia4": 0.0313, "Ia5": 0.0468, "Ia6": 0.0105, "Iam6": 0.00964, "fvm6": 0.616},
    **{"fv1": 8.05, "fv2": 5.53, "fv3": 1.97, "fv4": 1.11, "fv5": 1.86, "fv6": 0.65},
    **{"fs1": 7.14, "fs2": 8.26, "fs3": 6.34, "fs4": 2.48, "fs5": 3.03, "fs6": 0.282, "fsm6": 1.95},
}
"""Arm-side values of the recording's authors: inertias [kg m^2], viscous [N m s/rad] and Coulomb friction [N m]."""

_INERTIAS = ("Ia3", "Ia4", "Ia5", "Ia6", "Iam6", "fvm6")
_VISCOUS = ("fv1", "fv2", "fv3", "fv4", "fv5", "fv6")
_UNITS = {"Ia": "kg m^2", "fv": "N m s/rad", "fs": "N m"}


@dataclass(frozen=True)
class Row:
    """A parameter beside its published value.

    Attributes:
        name: Its name in the literature.
        unit: Its unit.
        published: The published value.
        found: Ours.
    """

    name: str
    unit: str
    published: float
    found: float

    @property
    def error_percent(self) -> float:
        """Difference from the published value over it [%]."""
        return 100 * (self.found / self.published - 1)


def published_rows(solution: RigidSolution, robot: Robot) -> tuple[Row, ...]:
    """Returns the published parameters with what a fit found of them.

    Args:
        solution: The fit.
        robot: The robot that it is of, for its gears.
    """
    found = arm_side(solution.estimate.found, robot)
    return tuple(Row(name, _UNITS[name[:2]], value, found[name]) for name, value in PUBLISHED.items())


def tx40_figures(solution: RigidSolution, robot: Robot) -> dict[str, float]:
    """Returns the figures of the study: how far a fit is from what was published, and what its residuals say."""
    error = {row.name: abs(row.error_percent) for row in published_rows(solution, robot)}
    return {
        "tx40.max_inertia_error_percent": max(error[name] for name in _INERTIAS),
        "tx40.max_viscous_error_percent": max(error[name] for name in _VISCOUS),
        "tx40.relative_error_percent": 100 * solution.residuals.total_error,
        "tx40.trusted": float(solution.checks.trust),
    }


def arm_side(parameters: Mapping[str, float], robot: Robot) -> dict[str, float]:
    """Returns motor inertias and friction as the literature writes them, at the axes.

    A motor's inertia `J` and friction count with its gear ratio squared, Coulomb friction with the ratio. Motor 6 turns
    with axes 5 and 6: `Iam6 = J6`, `Ia5 = J5 + J6`, `Ia6 = J6 + ` the coupled gear's own, viscous friction alike. Of
    Coulomb friction, which feels each speed by itself, `fsm6` is motor 6's and `fs6` the coupled gear's.

    Args:
        parameters: What a fit found, by name; motor inertias that are not there belong to an axis that cannot tell
            them from its links'.
        robot: The robot.
    """
    joints = dict(enumerate(robot.joints, start=1))
    gear, result = robot.joints[-1].name, dict[str, float]()
    for letter, kind, coupled in (
        ("Ia", "motor_inertia", "coupling_inertia"),
        ("fv", "viscous", "coupling_viscous"),
        ("fs", "coulomb", "coupling_coulomb"),
    ):
        power = 1 if letter == "fs" else 2
        own = {
            index: abs(joint.motor.gear_ratio) ** power * parameters[f"{joint.name}.{kind}"]
            for index, joint in joints.items()
            if f"{joint.name}.{kind}" in parameters
        }
        wrist = own.pop(len(joints))
        shared = 0.0 if letter == "fs" else wrist
        own[len(joints) - 1] += shared
        result |= {f"{letter}{index}": value for index, value in own.items()}
        result |= {f"{letter}6": shared + parameters[f"{gear}.{coupled}"], f"{letter}m6": wrist}
    return result
