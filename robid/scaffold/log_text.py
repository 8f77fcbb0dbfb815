"""An experiment on a log: the mapping that the log itself proposes, with the robot's joints for its channels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robid.later import later
from robid.scaffold.joint_sides import behind_gears
from robid.scaffold.robot_text import number

if TYPE_CHECKING:
    from robid.logs.inspection.channels import Entry
    from robid.logs.inspection.findings import Findings
    from robid.scaffold.chains import CarriedJoint

with later(__name__):
    from robid.logs.inspection.text import write_experiment


@dataclass(frozen=True)
class Variant:
    """An experiment file on a log, and what it leaves to be done."""

    text: str
    steps: tuple[str, ...]


def variants(
    found: Findings, name: str, joints: Sequence[CarriedJoint], path: Callable[[Path], str]
) -> Iterator[Variant]:
    """Yields experiments on a log, from the one that says most to the one that needs least.

    Args:
        found: What is in the log.
        name: Name of the experiment.
        joints: The robot's, base to flange.
        path: How the experiment file shall name the log.
    """
    checked = f"{name}.yaml: check each line that says `# check:`"
    named, told = _named_by_joints(found, joints)
    if named is not None:
        named, sides = behind_gears(named, joints)
        told = (*told, *sides)
        text = _with_robot(write_experiment(named, name, path), name, joints)
        placed = f"{name}.yaml: state in `configurations` where the robot stood"
        steps = (*told, checked, *([placed] if "    configurations: " in text else []))
        yield Variant(_with_fit(text, found), steps)
        missing = f"{name}.yaml: add a fit; `robid status` says what the log has to hold for it"
        yield Variant(text, (*steps, missing))
    unnamed = f"{name}.yaml: give the channels the names of joints, and take the mark before `robot` away"
    text = write_experiment(found, name, path).replace("# robot: my_robot.yaml", f"# robot: {name}_robot.yaml")
    yield Variant(text, (checked, unnamed))


def _named_by_joints(found: Findings, joints: Sequence[CarriedJoint]) -> tuple[Findings | None, tuple[str, ...]]:
    """Gives channels the names of joints, in their order where names say nothing; None where the two do not match."""
    made, names = found.proposal, [joint.name for joint in joints]
    told: tuple[str, ...] = ()
    stems = list(dict.fromkeys(_stem(entry) for entry in made.inputs))
    if set(stems) <= set(names):
        new = {stem: stem for stem in stems}
    elif len(stems) == len(names):
        new = dict(zip(stems, names, strict=True))
        pairs = ", ".join(f"`{stem}` is {joint}" for stem, joint in new.items())
        told = (f"check that the log's channels are the joints in their order: {pairs}",)
    else:
        return None, ()
    every = (*made.inputs, *made.outputs, *made.references)
    if not stems or not {_stem(entry) for entry in every} <= set(new):
        return None, ()
    inputs, outputs, references = (
        tuple(replace(entry, name=new[_stem(entry)] + entry.name[len(_stem(entry)) :]) for entry in entries)
        for entries in (made.inputs, made.outputs, made.references)
    )
    return replace(found, proposal=replace(made, inputs=inputs, outputs=outputs, references=references)), told


def _stem(entry: Entry) -> str:
    return entry.name.partition(".")[0]


def _with_robot(text: str, name: str, joints: Sequence[CarriedJoint]) -> str:
    """Names the robot, and a configuration in the middle of what it can reach, to be replaced."""
    slides = any(joint.slides for joint in joints)
    places = ", ".join(number(_place(joint)) for joint in joints)
    lines = []
    for line in text.splitlines():
        if line.startswith("# robot:"):
            lines.append(f"robot: {name}_robot.yaml")
        elif line.startswith("    # configurations:"):
            key = "list" if slides else "list_deg"
            lines.append(f"    configurations: {{{key}: [[{places}]]}} # check: where it stood")
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


def _place(joint: CarriedJoint) -> float:
    """Zero, or the middle of the limits where these leave it out [deg, or m]."""
    lower, upper = joint.range or (-0.5, 0.5)
    middle = 0.0 if lower <= 0 <= upper else (lower + upper) / 2
    return float(f"{middle if joint.slides else middle * 57.29577951308232:.4g}")


def _with_fit(text: str, found: Findings) -> str:
    """Adds a fit: of springs to a response, of masses and friction to a record without one."""
    family = "rigid" if found.proposal.one_shot or found.proposal.is_motion else "elastic"
    fit = f"fits:\n  {family}: {{family: {family}, from: log}}"
    return text.replace("\nexecution:", f"\n{fit}\nexecution:", 1)
