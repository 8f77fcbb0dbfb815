"""What a page shows of a rigid model's torques over time, motor by motor, and of their sizes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.parameters import curve, thinned
from robid.models.rigid.fit.solution import RigidSolution, RowResiduals
from robid.models.rigid.judge.motors import EXPECTED_ERROR_LIMIT, MOTOR_ERROR_LIMIT, Motors, added_error
from robid.models.rigid.judge.validating import Prediction, RigidValidation
from robid.report.numbers import percent, significant
from robid.report.section import Figure, Line, Section, Table
from robid.signals.record import Record

_OUTLIER = 3.0


def joins_of(time_s: FloatArray, lengths: Sequence[float]) -> tuple[Line, ...]:
    """Marks where rows (n_row,) of one record end and those of the next begin, by the length of each [s].

    Filters take as much from the ends of every record: what the rows lack in all is shared out.
    """
    taken = (sum(lengths) - float(time_s[-1] - time_s[0])) / len(lengths)
    ends = time_s[0] + np.cumsum(np.asarray(lengths) - taken)[:-1]
    return tuple(Line("x", float(end), "" if index else "next record") for index, end in enumerate(ends.tolist()))


def own_joins(solution: RigidSolution) -> tuple[Line, ...]:
    """Marks where the records of a fit are joined."""
    travel = solution.travel
    lengths = [float(np.ptp(travel.time_s[travel.shot == shot])) for shot in np.unique(travel.shot).tolist()]
    return joins_of(solution.residuals.time_s, lengths)


def new_joins(found: Prediction, new: Sequence[Record]) -> tuple[Line, ...]:
    """Marks where the records of a validation are joined: experiments of one campaign are as long as each other."""
    counts = [int(np.prod(record.inputs.shape[:3])) for record in new]
    return joins_of(found.time_s, [1.0] * sum(counts)) if counts else ()


def course(found: RowResiduals, joint: int, name: str, unit: str, joins: tuple[Line, ...] = ()) -> Figure:
    """One motor's residuals over time, with three deviations on either side."""
    deviation = float(np.nanstd(found.residual[:, joint]))
    time, residual = thinned_rows(found.time_s, found.residual[:, joint])
    ends = np.array([time[0], time[-1]])
    curves = (
        curve("residual", time, residual),
        curve("3 deviations", ends, np.full(2, _OUTLIER * deviation)),
        curve("-3 deviations", ends, np.full(2, -_OUTLIER * deviation)),
    )
    return Figure(name, "Time [s]", f"Residual [{unit}]", curves, log_x=False, log_y=False, height=260, lines=joins)


def torques(found: Prediction, joint: int, name: str, unit: str, joins: tuple[Line, ...] = ()) -> Figure:
    """One motor's measured and predicted torque over time."""
    time, measured = thinned_rows(found.time_s, found.measured[:, joint])
    again, predicted = thinned_rows(found.time_s, found.predicted[:, joint])
    rest, error = thinned_rows(found.time_s, found.measured[:, joint] - found.predicted[:, joint])
    curves = (curve("measured", time, measured), curve("predicted", again, predicted), curve("error", rest, error))
    quantity = "Force" if unit == "N" else "Torque"
    return Figure(name, "Time [s]", f"{quantity} [{unit}]", curves, log_x=False, log_y=False, lines=joins)


def thinned_rows(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows that count, no more than a page can draw."""
    known = np.isfinite(x) & np.isfinite(y)
    return thinned(x[known], y[known])


def motors_section(
    solution: RigidSolution, motors: Motors, units: Sequence[str], validation: RigidValidation | None
) -> Section:
    """Tabulates what each motor's torques are off: on the fit's own motion, on another, and what is to be expected."""
    own, expected, identified = solution.residuals, solution.expected, solution.estimate.identified
    resting = [identified[solution.base.rests_on == joint] for joint in range(len(motors.names))]
    columns = [
        _sizes(own.torque, units),
        _sizes(own.residual, units),
        *([percent(each) for each in figures] for figures in (expected.residual, expected.left_out)),
    ]
    heads = ["Motor", "Torque", "Residual", "over size", "on left-out pieces"]
    lead = "Errors of each motor's torque, root mean square, over the larger of its torque and a tenth of its rated one"
    if validation is None:
        columns += [[percent(each) for each in figures] for figures in (expected.error, expected.bound)]
        heads += ["Expected on other motions", "95 % stay below"]
    else:
        new = validation.prediction
        error = [percent(each) for each in validation.relative_error]
        columns += [_sizes(new.measured, units), _sizes(new.measured - new.predicted, units), error]
        heads += ["Torque, another motion", "Error", "over size"]
    columns += [[f"{int(each.sum())} of {each.size}" for each in resting], _grades(solution, motors, validation)]
    heads += ["Parameters that rest on it, identified", "Grade"]
    table = Table(tuple(heads), tuple(zip(motors.names, *columns, strict=True)))
    return Section("Errors of each motor", f"{lead}.", (table,), "motors")


def _grades(solution: RigidSolution, motors: Motors, validation: RigidValidation | None) -> list[str]:
    """What each motor's torques are worth, by the limits of the grade."""
    if validation is None:
        bad = (solution.expected.residual > MOTOR_ERROR_LIMIT) | (added_error(solution) > EXPECTED_ERROR_LIMIT)
    else:
        bad = validation.relative_error > MOTOR_ERROR_LIMIT
    words = {True: "do not use", False: "predicts" if validation is None else "holds"}
    rows = zip(bad.tolist(), motors.determined.tolist(), strict=True)
    return [words[is_bad] if told else "not determined" for is_bad, told in rows]


def _sizes(values: FloatArray, units: Sequence[str]) -> list[str]:
    """Root mean square of each motor's values (n_row, n_joint), as text."""
    found = np.sqrt(np.nanmean(values**2, axis=0)).tolist()
    return [f"{significant(size, 3)} {unit}" for size, unit in zip(found, units, strict=True)]
