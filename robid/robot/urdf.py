"""What a URDF file states, checked link by link, and written anew as far as a robot's motion depends on it."""

from __future__ import annotations

import copy
import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from robid.arrays import LARGEST

_MOVES = {"revolute", "continuous", "prismatic"}
_TYPES = {*_MOVES, "fixed", "floating", "planar"}
_KEPT = {"link": ("inertial",), "joint": ("origin", "parent", "child", "axis", "limit", "mimic", "dynamics")}
_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_SPEED_OF_LIGHT = 3e8
NOT_EXPANDED = "D257 is a xacro file that was not expanded: `xacro robot.urdf.xacro > robot.urdf` writes the URDF"
_ALTERS_MASSES = ("balanceinertia", "boundmass", "boundinertia", "settotalmass", "inertiafromgeom")


@dataclass
class Urdf:
    """A URDF file as far as a robot's motion depends on it."""

    text: str = ""  # The file without shapes, transmissions and simulators' parts; unreadable numbers are 1 or 0
    fixed: tuple[str, ...] = ()
    links: dict[str, str] = field(default_factory=dict)  # What is wrong with a link, by its name
    # What is wrong with the limits of a joint, by its name; `text` has none for it
    limits: dict[str, str] = field(default_factory=dict)
    speed: dict[str, float] = field(default_factory=dict)  # Speed limits by joint [rad/s, or m/s]
    gravity: tuple[float, float, float] | None = None  # Gravity that MuJoCo's extension states [m/s^2]
    balances: bool = False  # Whether MuJoCo's extension replaces inertias that no body has
    notes: list[str] = field(default_factory=list)


def unusable(root: ET.Element) -> list[str]:
    """Says why a file cannot be read as a URDF at all, a sentence each; empty if it can."""
    if _is_xacro(root):
        return [NOT_EXPANDED]
    links = [link.get("name", "") for link in root.findall("link")]
    joints = root.findall("joint")
    found = [f"D258 has more than one link `{name}`" for name, count in Counter(links).items() if count > 1]
    names = Counter(joint.get("name", "") for joint in joints)
    found += [f"D246 has more than one joint `{name}`" for name, count in names.items() if count > 1]
    parents: dict[str, list[str]] = {}
    for joint in joints:
        found += _joint_faults(joint, set(links), set(names))
        parents.setdefault(_link_of(joint, "child"), []).append(_link_of(joint, "parent"))
    for child, above in parents.items():
        if len(above) > 1:
            told = f"link `{child}` hangs on {len(above)} joints: a URDF is a tree; what closes a loop is left out"
            found.append(f"D247 {told} (`loop_links` of the robot file can hold cranks and rods)")
    roots = [name for name in dict.fromkeys(links) if name not in parents]
    if len(roots) > 1 and not found:
        found.append(f"D248 has {len(roots)} links that no joint carries: {', '.join(f'`{name}`' for name in roots)}")
    if not roots and not found:
        found.append("D249 has no link that no joint carries, to stand on" if links else "D250 has no links")
    return found


def _is_xacro(root: ET.Element) -> bool:
    if any("xacro" in element.tag.partition("}")[0] for element in root.iter() if element.tag.startswith("{")):
        return True
    moving = [*root.findall("link/inertial"), *root.findall("joint")]
    texts = (value for part in moving for element in part.iter() for value in element.attrib.values())
    return any("${" in text or "$(" in text for text in texts)


def _joint_faults(joint: ET.Element, links: set[str], joints: set[str]) -> Iterator[str]:
    name, kind = joint.get("name", ""), joint.get("type", "")
    if kind not in _TYPES:
        yield f"D212 joint `{name}` is of type `{kind}`, which URDF does not know"
    for end in ("parent", "child"):
        link = _link_of(joint, end)
        if link not in links:
            yield f"D213 joint `{name}`: there is no link `{link}`, its {end}"
    mimic = joint.find("mimic")
    if mimic is not None and mimic.get("joint", "") not in joints - {name}:
        yield f"D214 joint `{name}` mimics `{mimic.get('joint', '')}`, and there is no such joint"


def _link_of(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def read_urdf(root: ET.Element, *, with_shapes: bool = False) -> Urdf:
    """Reads a URDF file of which `unusable` finds nothing.

    Args:
        root: The file.
        with_shapes: Whether `text` has collision shapes, but for meshes, in the place of masses.
    """
    urdf, clean = Urdf(), ET.Element("robot", {"name": root.get("name", "")})
    dropped = 0
    for element in root:
        if element.tag not in _KEPT:
            continue
        kept = ET.SubElement(clean, element.tag, dict(element.attrib))
        kept.extend(copy.deepcopy([child for child in element if child.tag in _KEPT[element.tag]]))
        dropped += sum(child.tag in ("visual", "collision") for child in element)
        if element.tag == "joint":
            _clean_joint(kept, urdf)
        else:
            _clean_link(kept, urdf)
            if with_shapes:
                _keep_shapes(element, kept)
    urdf.text = ET.tostring(clean, encoding="unicode")
    urdf.fixed = tuple(joint.get("name", "") for joint in root.findall("joint") if joint.get("type") == "fixed")
    if dropped:
        urdf.notes.append(f"{dropped} shapes and their contacts left out")
    _read_extension(root, urdf)
    return urdf


def _clean_link(link: ET.Element, urdf: Urdf) -> None:
    """Checks the numbers of a link; its file is compiled with a stand-in where they cannot be read."""
    name, inertial = link.get("name", ""), link.find("inertial")
    if inertial is None:
        return
    wrong = []
    mass, inertia, origin = (inertial.find(key) for key in ("mass", "inertia", "origin"))
    if mass is None:
        wrong.append("its `inertial` has no `mass`")
    else:
        wrong += _wrong_numbers(mass, {"value": 1}, required=True)
    if inertia is None:
        wrong.append("its `inertial` has no `inertia`")
    else:
        wrong += _wrong_numbers(inertia, dict.fromkeys(_INERTIA, 1), required=True)
    if origin is not None:
        wrong += _wrong_numbers(origin, {"xyz": 3, "rpy": 3})
    if wrong:
        urdf.links[name] = "; ".join(wrong)
        link.remove(inertial)


def _clean_joint(joint: ET.Element, urdf: Urdf) -> None:
    name, kind, child = joint.get("name", ""), joint.get("type", ""), _link_of(joint, "child")
    axis, origin, limit = (joint.find(key) for key in ("axis", "origin", "limit"))
    wrong = []
    for element, counts in ((axis, {"xyz": 3}), (origin, {"xyz": 3, "rpy": 3}), (joint.find("mimic"), _MIMIC)):
        found = [] if element is None else _wrong_numbers(element, counts)
        if found and element is not None:
            joint.remove(element)
        wrong += found
    if axis is not None and kind in _MOVES and not wrong and not any(map(float, axis.get("xyz", "1 0 0").split())):
        wrong.append("its `axis` has no direction")
        joint.remove(axis)
    if wrong:
        urdf.links[child] = f"joint `{name}`, which carries it: {'; '.join(wrong)}"
    mimic, dynamics = joint.find("mimic"), joint.find("dynamics")
    if mimic is not None and kind not in _MOVES:
        joint.remove(mimic)
    if dynamics is not None and list(_wrong_numbers(dynamics, {"damping": 1, "friction": 1})):
        joint.remove(dynamics)
    if limit is not None:
        told = _limit_fault(limit, kind)
        if told:
            urdf.limits[name] = told
            joint.remove(limit)
        _clean_limit(limit, name, urdf)


_MIMIC = {"multiplier": 1, "offset": 1}


def _limit_fault(limit: ET.Element, kind: str) -> str:
    """Says what is wrong with the limits of a joint; nothing of one that has none."""
    if kind not in ("revolute", "prismatic") or {"lower", "upper"}.isdisjoint(limit.attrib):
        return ""
    wrong = _wrong_numbers(limit, {"lower": 1, "upper": 1})
    if wrong:
        return "; ".join(wrong)
    lower, upper = (float(limit.get(key, "0")) for key in ("lower", "upper"))
    return wrong_limits(lower, upper) if lower >= upper else ""


def wrong_limits(lower: float, upper: float) -> str:
    """Says what is wrong with a lower limit that is not below the upper one."""
    if lower == upper:
        return f"both limits are {lower:g}" + (", as where nobody stated them" if lower == 0 else "")
    return f"its limits are exchanged: lower {lower:g}, upper {upper:g}"


def _clean_limit(limit: ET.Element, name: str, urdf: Urdf) -> None:
    """Keeps the speed and torque limits that can be read."""
    speed, effort = (_number(limit.get(key, "0")) for key in ("velocity", "effort"))
    if speed is not None and 0 < speed < _SPEED_OF_LIGHT:
        urdf.speed[name] = speed
    limit.attrib.pop("velocity", None)
    if effort is None or not math.isfinite(effort):
        limit.attrib.pop("effort", None)


def _wrong_numbers(element: ET.Element, counts: dict[str, int], *, required: bool = False) -> list[str]:
    """Says which attributes are not this many finite numbers."""
    wrong = []
    for key, count in counts.items():
        text = element.get(key)
        if text is None:
            if required:
                wrong.append(f"its `{element.tag}` has no `{key}`")
            continue
        numbers = [_number(part) for part in text.split()]
        if len(numbers) != count or not all(number is not None and abs(number) < LARGEST for number in numbers):
            wanted = "a number" if count == 1 else f"{count} numbers"
            wrong.append(f"`{key}` of its `{element.tag}` is {wanted}, not `{text}`")
    return wrong


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _keep_shapes(link: ET.Element, kept: ET.Element) -> None:
    """Gives a link its collision shapes, but for meshes."""
    for inertial in kept.findall("inertial"):
        kept.remove(inertial)
    for shape in link.findall("collision"):
        if shape.find("geometry/mesh") is None:
            kept.append(copy.deepcopy(shape))


def _read_extension(root: ET.Element, urdf: Urdf) -> None:
    """Takes gravity from MuJoCo's part of a URDF file, and says what else of it changes masses."""
    keys = [key for compiler in root.findall("mujoco/compiler") for key in _ALTERS_MASSES if key in compiler.attrib]
    urdf.balances = any(each.get("balanceinertia") == "true" for each in root.findall("mujoco/compiler"))
    if keys:
        named = ", ".join(f"`{key}`" for key in keys)
        urdf.notes.append(f"MuJoCo's {named} left out: masses and inertias are those that the links state")
    for option in root.findall("mujoco/option"):
        if not _wrong_numbers(option, {"gravity": 3}) and "gravity" in option.attrib:
            x, y, z = map(float, option.attrib["gravity"].split())
            urdf.gravity = (x, y, z)
