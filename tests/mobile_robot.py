"""A mobile robot with two arms as a URDF: wheels, casters, a lift, a head, grippers whose fingers follow each other."""

from __future__ import annotations

ARM = ("shoulder", "upper", "elbow", "wrist")
_AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0")
_LIMITS = '<limit lower="-2" upper="2" effort="100" velocity="2"/>'


def inertial(mass: float, size: float = 0.1) -> str:
    """Mass properties of a block off its frame's origin."""
    moments = (mass * size**2 * factor for factor in (1.0, 1.2, 0.7))
    entries = " ".join(f'{key}="{value:.6g}"' for key, value in zip(("ixx", "iyy", "izz"), moments, strict=True))
    tensor = f'<inertia {entries} ixy="{1e-3 * mass * size:.6g}" ixz="0" iyz="0"/>'
    return (
        f'<inertial><origin xyz="0.02 {0.3 * size} {size}" rpy="0.1 0 0.2"/><mass value="{mass}"/>{tensor}</inertial>'
    )


def joint(name: str, parent: str, xyz: str, kind: str = "revolute", axis: str = "0 0 1", more: str = _LIMITS) -> str:
    """A joint with the link `<name>_link` that it carries, but for the link."""
    inner = f'<parent link="{parent}"/><child link="{name}_link"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>{more}'
    return f'<joint name="{name}" type="{kind}">{inner}</joint>'


def mobile_robot() -> str:
    """Returns the text of the file."""
    parts = [
        '<robot name="butler">',
        '<link name="base_link"/>',
        f'<link name="chassis_link">{inertial(80, 0.4)}</link>',
    ]
    parts.append(joint("chassis", "base_link", "0 0 0.2", "fixed", more=""))
    for side, y in (("left", 0.3), ("right", -0.3)):
        parts += _part(f"wheel_{side}", 4, "chassis_link", f"0 {y} 0", "continuous", "0 1 0", "")
        parts += _part(f"caster_{side}", 1, "chassis_link", f"0.3 {y} 0", "continuous", "0 0 1", "")
        parts += _part(f"roller_{side}", 0.5, f"caster_{side}_link", "-0.03 0 -0.05", "continuous", "0 1 0", "")
    lift = '<limit lower="0.05" upper="0.45" effort="900" velocity="0.2"/>'
    parts += _part("lift", 20, "chassis_link", "-0.1 0 0.4", "prismatic", "0 0 1", lift)
    parts += _part("pan", 1, "lift_link", "0.05 0 0.6", "revolute", "0 0 1", _LIMITS)
    parts += _part("tilt", 1.5, "pan_link", "0 0 0.1", "revolute", "0 1 0", _LIMITS)
    # A radio mast that somebody drew without masses, and a plate whose inertia was left at zero.
    parts += [joint("mast", "chassis_link", "-0.3 0 0.3", axis="0 0 1"), '<link name="mast_link"/>']
    nothing = '<mass value="0.1"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    parts += [joint("plate", "chassis_link", "0.3 0 0.3", "fixed", more="")]
    parts += [f'<link name="plate_link"><inertial>{nothing}</inertial></link>']
    for side, y in (("left", 0.2), ("right", -0.2)):
        parts += _arm(side, y)
    return "\n".join([*parts, "</robot>"])


def _part(name: str, mass: float, parent: str, xyz: str, kind: str, axis: str, more: str) -> list[str]:
    return [joint(name, parent, xyz, kind, axis, more), f'<link name="{name}_link">{inertial(mass)}</link>']


def _arm(side: str, y: float) -> list[str]:
    parts, parent, xyz = [], "lift_link", f"0.1 {y} 0.4"
    for name, axis, mass in zip(ARM, _AXES, (6, 5, 3, 1), strict=True):
        parts += _part(f"{side}_{name}", mass, parent, xyz, "revolute", axis, _LIMITS)
        parent, xyz = f"{side}_{name}_link", "0.05 0 0.3"
    stroke = '<limit lower="0" upper="0.04" effort="50" velocity="0.1"/>'
    mimic = f'{stroke}<mimic joint="{side}_finger" multiplier="-1" offset="0.01"/>'
    parts += _part(f"{side}_finger", 0.1, parent, "0 0.02 0.1", "prismatic", "0 1 0", stroke)
    parts += _part(f"{side}_thumb", 0.1, parent, "0 -0.02 0.1", "prismatic", "0 1 0", mimic)
    parts += [joint(f"{side}_tool", parent, "0 0 0.15", "fixed", more=""), f'<link name="{side}_tool_link"/>']
    return parts


def robot_file(joints: tuple[str, ...], more: str = "") -> str:
    """Returns the text of a robot file that drives some of its joints."""
    text = "schema_version: 1\nname: butler\nmodel: butler.urdf\njoints:\n"
    for name in joints:
        kind = "type: prismatic, " if name == "lift" else ""
        ratio = "gear_ratio_rad_m: 600" if name == "lift" else "gear_ratio: 100"
        text += f"- {{name: {name}, {kind}rigid: true, motor: {{inertia_kgm2: 2.0e-4, {ratio}}}}}\n"
    return f"{text}{more}\n"
