"""Real data beside published values: the EMPS axis, and the Staubli TX40."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robid.artifacts.artifact import Artifact
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.pipeline.graph import Run
from robid.report.numbers import significant
from robid.report.section import Section, Table
from robid.robot.description import Robot
from robid.settings.yaml import load_yaml
from robid.studies.settings.parts import RealCase, RecordedCase
from robid.studies.study import Asked, PartFound, recorded_part

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
    """A parameter beside its published value."""

    name: str  # Its name in the literature
    unit: str
    published: float  # The published value
    found: float  # Ours

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


_ASKED = {
    "tx40.max_inertia_error_percent": Asked(upper=15.0),
    "tx40.max_viscous_error_percent": Asked(upper=20.0),
}


def _conclude_tx40(_run: Run, _case: RecordedCase, own: Run, models: list[Artifact]) -> PartFound:
    """Turns the arm's fit into figures and what is asked of them."""
    solution = solution_from_artifact(models[0])
    robot = own.loaded.robot.to_robot()
    rows = tuple(
        (row.name, row.unit, significant(row.published), significant(row.found), f"{row.error_percent:+.1f} %")
        for row in published_rows(solution, robot)
    )
    caption = "Arm side, as published; the wrist's sixth motor turns with axes 5 and 6."
    table = Table(("Parameter", "Unit", "Published", "Ours", "Off"), rows, caption=caption, fit="compact")
    section = Section("Real data: the TX40", solution.checks.sentence, (table,))
    return PartFound(tx40_figures(solution, robot), _ASKED, (section,))


_FITS = ("axis", "asymmetric")
_KINDS = {"inertia": "M", "mass": "M", "viscous": "Fv", "coulomb": "Fc", "torque_offset": "offset"}
_DIGITS = 6  # as they are published
_NEAR, _NEAR_OFFSET, _NEAR_ERROR = 0.01, 0.02, 0.1


def _conclude_emps(run: Run, case: RealCase, _own: Run, models: list[Artifact]) -> PartFound:
    """Turns the axis' fits into figures and what is asked of them."""
    published = load_yaml(run.loaded.path.parent / case.published).data
    plain, asymmetric = map(solution_from_artifact, models)
    figures = _figures(plain, asymmetric)
    return PartFound(figures, asked_of(published), (_section(figures, published, plain),))


EMPS = recorded_part("emps", "The EMPS axis", lambda _case: _FITS, _conclude_emps)


def _figures(plain: RigidSolution, asymmetric: RigidSolution) -> dict[str, float]:
    estimate = plain.estimate
    named = {
        _KINDS[kind]: value
        for kind, value in zip(estimate.kinds, estimate.value.tolist(), strict=True)
        if kind in _KINDS
    }
    return {
        **{f"emps.{name}": value for name, value in named.items()},
        "emps.condition": plain.base.unscaled_condition,
        "emps.relative_error_percent": 100 * plain.residuals.total_error,
        "emps.asymmetric_relative_error_percent": 100 * asymmetric.residuals.total_error,
    }


def _published(values: Mapping[str, Any]) -> dict[str, float]:
    keys = ("condition", "relative_error_percent", "asymmetric_relative_error_percent")
    return {**values["ordinary"], **{key: values[key] for key in keys}}


def asked_of(values: Mapping[str, Any]) -> dict[str, Asked]:
    """Returns how near to the published values the figures must lie."""
    asked = {}
    for name, value in _published(values).items():
        reach = _NEAR_ERROR if name.endswith("percent") else abs(value) * (_NEAR_OFFSET if name == "offset" else _NEAR)
        asked[f"emps.{name}"] = Asked(value - reach, value + reach)
    return asked


def _section(figures: Mapping[str, float], values: Mapping[str, Any], plain: RigidSolution) -> Section:
    rows = tuple(
        (name, significant(value, _DIGITS), significant(figures[f"emps.{name}"], _DIGITS))
        for name, value in _published(values).items()
        if f"emps.{name}" in figures
    )
    caption = (
        "M [kg], Fv [N s/m], Fc and offset [N]; condition number of the unscaled decimated rows; norm of the residual"
        " over that of the force. Nothing is dropped near zero speed."
    )
    table = Table(("Figure", "Published", "Ours"), rows, caption=caption, fit="compact")
    lead = f"A carriage on a ball screw, measured: ordinary least squares. {plain.checks.sentence}"
    return Section("Real data: the EMPS axis", lead, (table,))


TX40 = recorded_part("tx40", "The TX40", lambda case: (case.fit,), _conclude_tx40)
