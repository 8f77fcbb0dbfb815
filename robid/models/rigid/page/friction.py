"""Friction of each axis, at the joint in the units of data sheets, and as the motor feels it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robid.models.rigid.judge.joint_side import FRICTION_KINDS, is_at_joint, to_joint_side
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import percent, pretty_unit, scale_for
from robid.report.parameters import ParameterRow, parameter_line
from robid.report.section import ColumnStyle, Row, Section, Table
from robid.robot.description import Joint
from robid.robot.parameters import PARAMETER_KINDS

_TITLES = {
    "coulomb": PARAMETER_KINDS["coulomb"].title,
    "viscous": "Viscous friction",
    "quadratic_viscous": PARAMETER_KINDS["quadratic_viscous"].title,
    "load_friction": PARAMETER_KINDS["load_friction"].title,
    "coupling_coulomb": "Coulomb friction of coupled gears",
    "coupling_viscous": "Viscous friction of coupled gears",
}
_SIDES = (
    "Joint side: the force or torque at the axis and per its speed, through the joint's own gear. Coulomb friction is"
    " the motor's times the ratio, viscous friction times its square; friction per torque is the same on both sides."
)


def friction_section(content: RigidContent) -> tuple[Section, ...]:
    """Tabulates friction on both sides of the gears; nothing where the model has none.

    Of currents whose torque constant is unknown there is no torque at the joint.
    """
    rows = [row for row in content.estimates.rows if row.kind in FRICTION_KINDS]
    if not rows:
        return ()
    known = content.estimates.torque_unit == "N m"
    beside = not all(is_at_joint(joint) for joint in content.joints)
    interval = f"{percent(content.estimates.level)} interval"
    at_joint = ("Joint side", interval, "Unit") if known else ()
    at_motor = ("Motor side" if beside else "Estimate", interval, "Unit") if beside or not known else ()
    sides = (bool(at_joint), bool(at_motor))
    columns: tuple[ColumnStyle, ...] = ("strong", "number", "unit")
    heads = ("Friction of", *at_joint, *at_motor, "Estimate ±")
    styles: tuple[ColumnStyle, ...] = ("name", *(columns * sum(sides)), "number")
    table = Table(heads, tuple(_rows(content, rows, sides)), caption=_SIDES if known and beside else "", styles=styles)
    return (Section("Friction", _lead(content, rows), (table,), "friction"),)


def _lead(content: RigidContent, rows: Sequence[ParameterRow]) -> str:
    count = sum(row.identified for row in rows)
    intervals = f"with {percent(content.estimates.level)} intervals, {count} of {len(rows)} determined by the data"
    if content.estimates.torque_unit != "N m":
        return f"Friction of each motor, {intervals}, as ratios to the unknown torque constant."
    return f"Friction of each axis as data sheets state it, {intervals}."


def _rows(content: RigidContent, rows: Sequence[ParameterRow], sides: tuple[bool, bool]) -> Iterator[Row]:
    order = [kind for kind in FRICTION_KINDS if any(row.kind == kind for row in rows)]
    for row in sorted(rows, key=lambda row: order.index(row.kind)):
        joint = _joint_of(row, content.joints)
        factor, unit = to_joint_side(row.kind, joint)
        line = parameter_line(row, content.estimates.identifiable_relative_std)
        motor = line.estimate, f"{line.lower} … {line.upper}", line.unit
        cells = (*(written(row, factor, unit) if sides[0] else ()), *(motor if sides[1] else ()))
        name, note = _named(row, joint)
        notes = "; ".join(text for text in (line.note, note) if text)
        yield Row((name, *cells, line.predicts), faint=not row.identified, group=_TITLES[row.kind], note=notes)


def written(row: ParameterRow, factor: float, unit: str) -> tuple[str, str, str]:
    """Writes a parameter times a factor, its interval and its unit, without a prefix."""
    scale = scale_for(factor * row.estimate, "", factor * row.near)
    lower, upper = (scale.text(factor * each) for each in (row.lower, row.upper))
    plain = "" if unit == "1" else pretty_unit(unit)
    return scale.text(factor * row.estimate), f"{lower} … {upper}", f"{scale.unit} {plain}".strip()


def _joint_of(row: ParameterRow, joints: Sequence[Joint]) -> Joint:
    return max(
        (joint for joint in joints if row.name == joint.name or row.name.startswith(f"{joint.name}.")),
        key=lambda joint: len(joint.name),
    )


def _named(row: ParameterRow, joint: Joint) -> tuple[str, str]:
    """The axis, with the motor's direction where friction differs by it, and what that is at a gear that reverses."""
    direction = row.name.rpartition("_")[2]
    if direction not in ("forward", "backward") or row.kind not in ("coulomb", "viscous"):
        return joint.name, ""
    turned = {"forward": "backward", "backward": "forward"}[direction]
    return f"{joint.name}, {direction}", f"{turned} at the joint" if joint.motor.gear_ratio < 0 else ""
