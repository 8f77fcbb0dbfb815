"""Errors of each motor: what an industrial user looks for first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.motors import EXPECTED_ERROR_LIMIT, MOTOR_ERROR_LIMIT, Motors, added_error
from robid.models.rigid.judge.validating import RigidValidation
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import ColumnStyle, Section, Table


def motors_section(content: RigidContent) -> Section:
    """Tabulates what each motor's torques are off: on the fit's own motion, on another, and what is to be expected."""
    solution, validation, units = content.solution, content.validation, content.units
    own, expected = solution.residuals, solution.expected
    columns: dict[str, list[str]] = {
        "Torque": _sizes(own.torque, units),
        "Error": _sizes(own.residual, units),
        "of size": [percent(each) for each in expected.residual],
        "of rated": _of_rated(own.residual, solution),
    }
    if validation is None:
        columns["left out"] = [percent(each) for each in expected.left_out]
        columns["expected"] = [percent(each) for each in expected.error]
        columns["95 % below"] = [percent(each) for each in expected.bound]
    else:
        columns |= _on_new(validation, solution, units)
    identified = solution.estimate.identified
    resting = [identified[solution.base.rests_on == joint] for joint in range(len(units))]
    columns["Identified"] = [f"{int(each.sum())} of {each.size}" for each in resting]
    columns["Grade"] = _grades(solution, content.motors, validation)
    kept = {head: cells for head, cells in columns.items() if "rated" not in head or expected.stated.any()}
    rows = tuple(zip(content.motors.names, *kept.values(), strict=True))
    numbers: tuple[ColumnStyle, ...] = ("number",)
    styles: tuple[ColumnStyle, ...] = ("name", *numbers * (len(kept) - 1), "text")
    table = Table(("Motor", *kept), rows, caption=_caption(content), styles=styles)
    new = "" if validation is None else " and on a new one"
    lead = f"How far the torque of each motor is off, root mean square, on the fit's own motion{new}."
    return Section("Errors of each motor", lead, (table,), "motors")


def _on_new(validation: RigidValidation, solution: RigidSolution, units: Sequence[str]) -> dict[str, list[str]]:
    """Columns on a motion that the fit never saw."""
    new = validation.prediction
    error, forward = new.measured - new.predicted, validation.forward_error
    columns = {
        "Torque, new": _sizes(new.measured, units),
        "Error, new": _sizes(error, units),
        "of size, new": [percent(each) for each in validation.relative_error],
        "of rated, new": _of_rated(error, solution),
        "to own": [significant(each, 3) for each in validation.error_ratio.tolist()],
    }
    if forward is not None:
        columns["Position off"] = [percent(each) for each in forward.tolist()]
    return columns


def _caption(content: RigidContent) -> str:
    """Says what the columns are related to."""
    stated, validation = content.solution.expected.stated, content.validation
    told = ["Size: the larger of a motor's RMS torque and a tenth of its rated one."]
    if not stated.any():
        told.append("The robot file states no rated torques: the largest of the log stand for them there.")
    elif not stated.all():
        lacking = (name for name, known in zip(content.motors.names, stated.tolist(), strict=True) if not known)
        told.append(f"The robot file states no rated torque of {', '.join(lacking)}.")
    if validation is None:
        told.append(
            "Left out: on pieces of the log that the fit did not see. Expected: on other motions, root mean square."
        )
        told.append("95 % below: what 95 % of errors on other motions stay below.")
    else:
        told.append("To own: error on the new motion over that on the fit's own.")
    if validation is not None and validation.forward_error is not None:
        told.append("Position off: positions simulated in the robot's loop under the recorded commands.")
    told.append("Identified: of the parameters that rest on the motor's torque.")
    return " ".join(told)


def _of_rated(error: FloatArray, solution: RigidSolution) -> list[str]:
    """Root mean square of errors (n_row, n_joint) over the rated torques that the robot file states."""
    expected = solution.expected
    share = np.sqrt(np.nanmean(error**2, axis=0)) / expected.rated
    return [percent(each) if known else MISSING for each, known in zip(share, expected.stated, strict=True)]


def _grades(solution: RigidSolution, motors: Motors, validation: RigidValidation | None) -> list[str]:
    """How far to trust each motor's torques, by the limits of the grade."""
    if validation is None:
        bad = (solution.expected.residual > MOTOR_ERROR_LIMIT) | (added_error(solution) > EXPECTED_ERROR_LIMIT)
    else:
        bad = validation.relative_error > MOTOR_ERROR_LIMIT
    words = {True: "do not use", False: "predicts"}
    rows = zip(bad.tolist(), motors.determined.tolist(), strict=True)
    return [words[is_bad] if told else "not determined" for is_bad, told in rows]


def _sizes(values: FloatArray, units: Sequence[str]) -> list[str]:
    """Root mean square of each motor's values (n_row, n_joint), as text."""
    found = np.sqrt(np.nanmean(values**2, axis=0)).tolist()
    return [f"{significant(size, 3)} {unit}" for size, unit in zip(found, units, strict=True)]
