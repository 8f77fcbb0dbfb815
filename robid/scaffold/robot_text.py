"""A robot file on a rigid model: what nobody can know from the model stands in one table, to be filled."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robid.scaffold.chains import CarriedJoint, Chain
from robid.scaffold.sizes import Drive

_CONTROLLER = (
    "{sampling_period_s: 1.0e-3, position_gain_1_s: 6, speed_bandwidth_hz: 20, integral_time_s: 0.1, delay_samples: 1}"
)
_TURN = ("gear_ratio", "stiffness_nm_rad", "damping_nms_rad")
_SLIDE = ("gear_ratio_rad_m", "stiffness_n_m", "damping_ns_m")
_HEADER = (
    "#    joint",
    "stiffness of the gear, arm side [N m/rad]",
    "damping [N m s/rad]",
    "",
    "rotor inertia [kg m^2]",
    "motor turns per arm turn",
    "motor's limits [rad/s]",
    "[N m]",
    "friction of the motor [N m], [N m s/rad]",
    "torque ripple [N m]",
)


def robot_text(name: str, model: str, chain: Chain, drives: Sequence[Drive], *, weightless: bool) -> str:
    """Writes the robot file; `model` is the name of the model's file beside it, `weightless` one without gravity."""
    load = chain.load
    x, y, z = (number(value) for value in load.com_m)
    inertia = number(load.inertia_kgm2)
    moving = sum(one.link_kg for one in chain.joints)
    lines = [
        f"# {name}: its rigid model made elastic. Frames, masses, inertias and limits come from the model.",
        "# What the model cannot say is typical of the size of each joint, and listed under `assumed`: replace it by",
        "# what data sheets, the maker or measurements say, and take the name off the list. Reports mark the others.",
        "# `&motor_1` names a list that `*motor_1` repeats: for a joint that differs write a list instead.",
        "schema_version: 2",
        f"name: {name}",
        f"model: {model}",
        *([f"flange: {chain.flange} # the frame that the payload is given in"] if chain.flange else []),
        f"# total_mass_kg: {moving:.4g} # mass of what moves in the model: state the data sheet's, and it is checked",
        *(["locked: rest # joints that are not listed stay where they rest"] if chain.held else []),
        *(["gravity_m_s2: [0, 0, -9.81] # the model has none that can be meant"] if weightless else []),
        "# The controller, for simulations: its cycle, gain of its position loop, bandwidth of its speed loop. All are",
        "# typical values.",
        f"controller: {_CONTROLLER}",
        "",
        "# One line per joint, base to flange. Slides: N, N/m and N s/m of the arm, motor radians per metre.",
        *_table(chain.joints, drives),
        "",
        "# A test load of usual size; leave it out, or set its mass to 0, where the robot carries none.",
        f"payload: {{mass_kg: {number(load.mass_kg)}, com_m: [{x}, {y}, {z}],"
        f" inertia_kgm2: {{xx: {inertia}, yy: {inertia}, zz: {inertia}}}, assumed: [mass_kg, com_m, inertia_kgm2]}}",
    ]
    return "\n".join(lines) + "\n"


def number(value: float) -> str:
    """Writes a number as YAML reads it as one."""
    text = f"{value:.6g}"
    return text if "e" not in text or "." in text else text.replace("e", ".0e")


def _table(joints: Sequence[CarriedJoint], drives: Sequence[Drive]) -> list[str]:
    anchors: dict[str, str] = {}
    rows = [_row(joint, drive, anchors) for joint, drive in zip(joints, drives, strict=True)]
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    used = [index for index, column in enumerate(zip(*rows, strict=True)) if any(column)]
    header = [_HEADER[index] for index in used if index < len(_HEADER)]
    widths = [max(map(len, (title, *column))) for title, column in zip(header, columns, strict=False)]
    lines = []
    for cells in (header, *([row[index] for index in used] for row in rows)):
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
        lines.append(" ".join([*padded, *cells[len(header) :]]).rstrip())
    return [lines[0], "joints:", *lines[1:]]


def _row(joint: CarriedJoint, drive: Drive, anchors: dict[str, str]) -> tuple[str, ...]:
    ratio, stiffness, damping = _SLIDE if joint.slides else _TURN
    guessed = ["inertia_kgm2", ratio]
    guessed += ["max_speed_rad_s"] if drive.max_speed_rad_s is not None else []
    guessed += ["max_torque_nm"] if drive.max_torque_nm is not None else []
    guessed += ["friction", "ripple_nm", "ripple_order"]
    friction = f"coulomb_nm: {number(drive.coulomb_nm)}, viscous_nms_rad: {number(drive.viscous_nms_rad)}"
    return (
        f"  - {{name: {joint.name},{' type: prismatic,' * joint.slides}{_limits(joint)}",
        f"gear: {{{stiffness}: {number(drive.stiffness)},",
        f"{damping}: {number(drive.damping)},",
        f"assumed: {_listed('gear', [stiffness, damping], anchors)}}},",
        f"motor: {{inertia_kgm2: {number(drive.inertia_kgm2)},",
        f"{ratio}: {number(drive.ratio)},",
        "" if drive.max_speed_rad_s is None else f"max_speed_rad_s: {number(drive.max_speed_rad_s)},",
        "" if drive.max_torque_nm is None else f"max_torque_nm: {number(drive.max_torque_nm)},",
        f"friction: {{{friction}}},",
        f"ripple_nm: {number(drive.ripple_nm)},",
        f"assumed: {_listed('motor', guessed, anchors)}}}}}",
        f"# {_said(joint, drive)}",
    )


def _limits(joint: CarriedJoint) -> str:
    """Limits that the model lacks, as assumed ones."""
    if joint.range is not None:
        return ""
    key, limits = ("limits_m", "[-0.5, 0.5]") if joint.slides else ("limits_deg", "[-180, 180]")
    return f" {key}: {limits}, assumed: [{key}],"


def _said(joint: CarriedJoint, drive: Drive) -> str:
    """What the model says of a joint."""
    unit, force, scale = ("m", "N", 1.0) if joint.slides else ("deg", "N m", 180 / math.pi)
    told = []
    if joint.range is not None:
        lower, upper = (f"{scale * limit:.4g}" for limit in joint.range)
        told.append(f"{lower} to {upper} {unit}")
    if joint.speed is not None and drive.max_speed_rad_s is None:
        told.append(f"{scale * joint.speed:.4g} {unit}/s")
    if joint.torque is not None:
        left = " (too little or too much for the arm, left out)" if drive.torque_left_out is not None else ""
        told.append(f"{joint.torque:.4g} {force}{left}")
    return f"model: {', '.join([*told, f'{joint.link_kg:.4g} kg'])}"


def _listed(stem: str, names: Sequence[str], anchors: dict[str, str]) -> str:
    """A list, written once and named from then on."""
    text = f"[{', '.join(names)}]"
    if text in anchors:
        return f"*{anchors[text]}"
    anchors[text] = f"{stem}_{1 + sum(name.startswith(stem) for name in anchors.values())}"
    return f"&{anchors[text]} {text}"
