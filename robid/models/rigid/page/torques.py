"""Measured and predicted torques over time, motor by motor and record by record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.models.parameters import ERROR, MEASURED, MODEL, over_time
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import significant
from robid.report.section import Choices, Figure, Line, Part, Section

_POINTS = 1000  # of a curve
_MOST_RECORDS = 6  # of the fit's own, and of the validation's
_MOST_JOINED = 6
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Course:
    """Torques along one record, filtered as the fit filters them; NaN where a row does not count."""

    name: str
    time_s: FloatArray  # (n_row,): time since its first row [s]
    measured: FloatArray  # (n_row, n_joint): measured torques
    predicted: FloatArray  # (n_row, n_joint): the model's
    begins: tuple[tuple[float, str], ...] = ()  # where the records begin that it joins [s], and their names

    @property
    def relative_error(self) -> float:
        """Norm of the error over that of the torque, the worst motor's."""
        error, size = (np.nansum(each**2, axis=0) for each in (self.measured - self.predicted, self.measured))
        return float(np.sqrt(np.max(np.divide(error, size, out=np.zeros_like(error), where=size > 0))))


def torque_section(content: RigidContent) -> Section:
    """Lays out measured against predicted torques over time, with what is between them."""
    own, new = courses_of(content)
    shown = [*_with_joined(own, "fit"), *_with_joined(new, "validation")]
    found, joints = content.solution.residuals, range(len(content.joints))
    deviation = np.sqrt(np.nanmean(found.residual**2, axis=0)).tolist()
    options: list[tuple[tuple[str, ...], tuple[Part, ...]]] = [
        ((content.motors.names[joint], course.name), _figures(course, joint, content.units[joint], deviation[joint]))
        for joint in joints
        for course in shown
    ]
    return Section(
        "Torques over time", _lead(content, own, new), (Choices(("Motor", "Record"), tuple(options)),), "torques"
    )


def courses_of(content: RigidContent) -> tuple[list[Course], list[Course]]:
    """Returns the records of the fit and those of its validation."""
    found = content.solution.residuals
    own = [*_split(found.time_s, found.torque, found.torque - found.residual, found.shot, found.shots)]
    if content.validation is None:
        return own, []
    new = content.validation.prediction
    return own, [*_split(new.time_s, new.measured, new.predicted, new.shot, new.shots)]


def _split(
    time_s: FloatArray, measured: FloatArray, predicted: FloatArray, shot: IntArray, names: tuple[str, ...]
) -> Iterator[Course]:
    """Takes rows (n_row, ...) apart into the records that they are of; a file that does not say it has a single one."""
    if not shot.size:
        yield Course("record", time_s - time_s[0], measured, predicted)
        return
    for index in np.unique(shot).tolist():
        rows, name = shot == index, names[index] or f"record {index + 1}"
        yield Course(name, time_s[rows] - time_s[rows][0], measured[rows], predicted[rows])


def _with_joined(courses: list[Course], role: str) -> list[Course]:
    """Names the records by their role, leaves out the better ones of many, and puts a few after each other, too."""
    worst = sorted(range(len(courses)), key=lambda index: -courses[index].relative_error)[:_MOST_RECORDS]
    kept = [courses[index] for index in sorted(worst)]
    named = [Course(f"{course.name} ({role})", course.time_s, course.measured, course.predicted) for course in kept]
    return [*named, joined(kept, f"all after each other ({role})")] if 1 < len(kept) <= _MOST_JOINED else named


def joined(courses: list[Course], name: str) -> Course:
    """Puts records after each other, with a gap between them and a mark where each begins."""
    start, times, begins = 0.0, [], []
    gap = np.full((1, courses[0].measured.shape[1]), np.nan)
    measured, predicted = [], []
    names = short_names([course.name for course in courses])
    for course, own in zip(courses, names, strict=True):
        step = float(course.time_s[1] - course.time_s[0]) if len(course.time_s) > 1 else 0.0
        begins.append((start, own))
        end = start + float(course.time_s[-1]) + step
        times += [start + course.time_s, np.array([end])]
        measured += [course.measured, gap]
        predicted += [course.predicted, gap]
        start = end + step
    return Course(name, np.concatenate(times), np.concatenate(measured), np.concatenate(predicted), tuple(begins))


def short_names(names: list[str]) -> list[str]:
    """Names without what all begin with, as the campaign in `estimation, realization 1`."""
    parts = [name.split(", ") for name in names]
    common = 0
    while min(map(len, parts)) > common + 1 and len({tuple(each[: common + 1]) for each in parts}) == 1:
        common += 1
    return [", ".join(each[common:]) for each in parts]


def _figures(course: Course, joint: int, unit: str, deviation: float) -> tuple[Figure, Figure]:
    """One motor's torques, and the residual beneath them with three deviations of the fit's own."""
    measured, predicted = course.measured[:, joint], course.predicted[:, joint]
    marks = tuple(Line("x", at, name) for at, name in course.begins)
    both = (
        over_time("measured", course.time_s, measured, MEASURED, _POINTS),
        over_time("predicted", course.time_s, predicted, MODEL, _POINTS),
    )
    left = over_time("measured less predicted", course.time_s, measured - predicted, ERROR, _POINTS)
    limits = tuple(
        Line("y", sign * _DEVIATIONS * deviation, name)
        for sign, name in ((1, "3 deviations of the fit's own"), (-1, ""))
    )
    quantity = "Force" if unit == "N" else "Current" if unit == "A" else "Torque"
    first = Figure(quantity, "", f"{quantity} [{unit}]", both, log_x=False, log_y=False, height=300, lines=marks)
    below = (*limits, *(Line("x", at) for at, _ in course.begins))
    title = f"Residual [{unit}]"
    second = Figure("Residual", "Time [s]", title, (left,), log_x=False, log_y=False, height=230, lines=below)
    ends = (0.0, float(course.time_s[-1]))
    return replace(first, x_range=ends), replace(second, x_range=ends)


def _lead(content: RigidContent, own: list[Course], new: list[Course]) -> str:
    filtered = content.solution.filtered
    rate = 1 / (filtered.decimation * filtered.sampling_period_s)
    told = [
        f"Positions are low-passed at {significant(filtered.cut_hz, 3)} Hz, and measured and predicted torques alike"
        f" filtered to {significant(rate, 3)} rows a second, as the fit reads them."
    ]
    slow = any(np.isnan(course.measured).any() for course in (*own, *new))
    told += ["Gaps are rows that are left out: of motors that stand still or are slow."] if slow else []
    told.append("Curves are thinned to the smallest and the largest value of each stretch, so that peaks stay.")
    if content.solution.chosen != "weighted" and own:
        told.append("On the fit's own records the prediction is that of least squares.")
    for role, courses in (("fit", own), ("validation", new)):
        if len(courses) > _MOST_RECORDS:
            told.append(
                f"Of {len(courses)} records of the {role} the {_MOST_RECORDS} with the largest error are shown."
            )
    return " ".join(told)
