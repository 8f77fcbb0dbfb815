"""What was reached of the motors' limits, and the plane of each motor's speed and torque."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from robid.report.numbers import MISSING, percent, pretty_unit, significant
from robid.report.section import Cell, Choice, Curve, Figure, Line, Part, Row, Section, Table

_NEAR = 0.25  # of a limit, from which on a figure goes as far as it
_ROOM = 1.08  # times what a figure holds


@dataclass(frozen=True)
class ReachedRow:
    """What one signal of a motor or joint reached in one campaign."""

    campaign: str  # name of the campaign
    joint: str  # motor or joint
    quantity: str  # what was reached, as in `speed`
    unit: str  # SI unit
    rms: float  # RMS in the experiment where it is largest; NaN where it says nothing
    peak: float  # largest magnitude, or what else is compared with the limit
    limit: float  # limit of the robot file; infinite where it states none

    @property
    def share(self) -> float:
        """What was reached over the limit; NaN without one."""
        return self.peak / self.limit if 0 < self.limit < math.inf else math.nan


@dataclass(frozen=True)
class Plane:
    """Speed and torque of one motor in one campaign."""

    campaign: str  # name of the campaign
    motor: str  # name of the motor
    hull: tuple[tuple[float, float], ...]  # corners (speed, torque) of what encloses all samples [rad/s, N m]
    points: tuple[tuple[float, float], ...]  # some samples
    speed_limit: float  # limit of the speed, infinite where it is unknown [rad/s]
    torque_limit: float  # limit of the torque, infinite where it is unknown [N m]
    rated_torque: float  # torque that it can give for ever, NaN where it is unknown [N m]
    units: tuple[str, str] = ("rad/s", "N m")  # of the speed and the torque


def reached_section(rows: tuple[ReachedRow, ...], planes: tuple[Plane, ...]) -> tuple[Section, ...]:
    """Lays out what campaigns reached of the motors' limits; nothing where no limit is known."""
    if not any(math.isfinite(row.share) for row in rows):
        return ()
    parts: list[Part] = [_table(rows)]
    motors = dict.fromkeys(plane.motor for plane in planes if plane.hull)
    options: list[tuple[str, tuple[Part, ...]]] = [
        (motor, (_figure([plane for plane in planes if plane.motor == motor and plane.hull]),)) for motor in motors
    ]
    parts += [Choice("Motor", tuple(options))] if options else []
    return (Section("Signals against the motors' limits", _lead(rows), tuple(parts), "limits"),)


def _lead(rows: tuple[ReachedRow, ...]) -> str:
    known = [row for row in rows if math.isfinite(row.share)]
    beyond = [row for row in known if row.share > 1]
    told = "What was measured, against the limits of the robot file; speeds and torques are motor side."
    if beyond:
        named = ", ".join(dict.fromkeys(f"{row.quantity} of {row.joint} in {row.campaign}" for row in beyond))
        return f"{told} Beyond a limit: {named}."
    nearest = [
        max((row for row in known if row.quantity == quantity), key=lambda row: row.share)
        for quantity in dict.fromkeys(row.quantity for row in known)
    ]
    named = "; ".join(f"{row.quantity} {percent(row.share)} ({row.joint}, {row.campaign})" for row in nearest)
    return f"{told} Nearest to a limit: {named}."


def _table(rows: tuple[ReachedRow, ...]) -> Table:
    return Table(
        ("Motor", "Quantity", "Campaign", "RMS", "Peak", "Limit", "Share of limit", ""),
        tuple(_cells(row) for row in rows),
        title="Reached",
        caption=(
            "RMS: of the experiment where it is largest. Speeds that were not measured are differences of the angles,"
            " with their noise. Position: its distance from the middle between the joint's limits."
        ),
        styles=("name", "text", "text", "number", "strong", "number", "number", "meter"),
        choice="Motor",
        fit="tall",
    )


def _cells(row: ReachedRow) -> Row:
    sizes = (row.rms, row.peak, row.limit if math.isfinite(row.limit) else math.nan)
    texts = (MISSING if math.isnan(size) else f"{significant(size, 3)} {pretty_unit(row.unit)}" for size in sizes)
    if math.isnan(row.share):
        return Row((row.joint, row.quantity, row.campaign, *texts, MISSING, ""), choice=row.joint)
    text = percent(row.share)
    shares = Cell(f"✗ {text}" if row.share > 1 else text, "bad" if row.share > 1 else ""), Cell(text, share=row.share)
    return Row((row.joint, row.quantity, row.campaign, *texts, *shares), choice=row.joint)


def _figure(planes: list[Plane]) -> Figure:
    """The plane of speed and torque of one motor, as far as its limits where the samples come near them."""
    curves = [curve for index, plane in enumerate(planes) for curve in _curves(plane, index)]
    speed_limit, torque_limit = planes[0].speed_limit, planes[0].torque_limit
    ends = [
        _end(max(abs(corner[axis]) for plane in planes for corner in plane.hull), limit)
        for axis, limit in enumerate((speed_limit, torque_limit))
    ]
    levels = (("x", speed_limit, "limit", ends[0]), ("y", torque_limit, "limit", ends[1]))
    rated = ("y", planes[0].rated_torque, "rated", ends[1])
    lines = tuple(
        Line("x" if along == "x" else "y", sign * level, name if sign > 0 else "")
        for along, level, name, end in (*levels, rated)
        for sign in (1, -1)
        if level <= end
    )
    turns = planes[0].units[0].startswith("rad")
    return Figure(
        f"{'Torque' if turns else 'Force'} over speed, {planes[0].motor}",
        f"{'Motor speed' if turns else 'Speed'} [{planes[0].units[0]}]",
        f"{'Motor torque' if turns else 'Force'} [{planes[0].units[1]}]",
        tuple(curves),
        log_x=False,
        log_y=False,
        height=360,
        lines=lines,
        x_range=(-ends[0], ends[0]),
        y_range=(-ends[1], ends[1]),
        caption="Lines enclose all samples (convex hull), points are some of them. " + _drawn(speed_limit, ends[0])
        + _drawn(torque_limit, ends[1], "torque"),
    )  # fmt: skip


def _drawn(limit: float, end: float, what: str = "speed") -> str:
    """Says where a limit is that the figure does not hold."""
    if limit <= end:
        return ""
    return f"No limit of the {what} is known. " if math.isinf(limit) else f"The limit of the {what} lies outside. "


def _end(reached: float, limit: float) -> float:
    """How far an axis goes: as far as the limit where what was reached comes near it."""
    return _ROOM * (max(reached, limit) if reached > _NEAR * limit else reached)


def _curves(plane: Plane, shade: int) -> Iterator[Curve]:
    closed = (*plane.hull, plane.hull[0])
    x, y = zip(*closed, strict=True)
    yield Curve(plane.campaign, x, y, shade=shade)
    points = [point for point in plane.points if all(map(math.isfinite, point))]
    x, y = zip(*points, strict=True)
    yield Curve(f"{plane.campaign}, samples", x, y, points=True, symbol="small", shade=shade)
