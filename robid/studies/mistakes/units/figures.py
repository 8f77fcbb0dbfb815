"""What became of logs in wrong units: how often the unit is named, how often it is accused for nothing, and of what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import percent
from robid.report.section import Section, Table
from robid.studies.mistakes.units.cases import UnitSubject, unit_subjects
from robid.studies.mistakes.units.scales import is_named, said_of
from robid.studies.settings.mistakes import MistakesStudy, UnitMistake
from robid.studies.study import study_of

POOLED, EACH, FALSE = 0.9, 0.85, 2
"""What is asked: at least, over all robots; at least, on each; records that may be accused for nothing, at most."""


@dataclass(frozen=True)
class UnitRow:
    """One case."""

    name: str  # Name of the mistake; that of no mistake for a sound record
    robot: str
    seed: int  # Seed of the individual
    rough: bool  # Whether nothing but the robot file is wrong
    named: bool  # Whether the mistake is named first
    accused: bool  # Whether units are accused first, rightly or not
    first: str  # What is named first, in words


def unit_rows(run: Run, results: Iterable[Artifact]) -> list[UnitRow]:
    """Reads the cases."""
    study, subjects = study_of(run.loaded, MistakesStudy), unit_subjects(run)
    mistakes = {} if study.units is None else study.units.mistakes
    return [row for held in results for row in _rows(held, subjects, mistakes)]


def _rows(held: Artifact, subjects: dict[str, UnitSubject], mistakes: dict[str, UnitMistake]) -> Iterator[UnitRow]:
    robot, rough = str(held.attributes["robot"]), bool(held.attributes["rough"])
    seed = int(str(held.attributes["seed"]))
    joints = [joint.name for joint in subjects[robot].run.loaded.robot.joints]
    columns = (held.datasets[key].values.tolist() for key in ("case", "causes", "scales", "refusal"))
    for name, *texts in zip(*columns, strict=True):
        said, mistake = said_of(*texts), mistakes.get(name)
        wrong = [joints[seed % len(joints)]] if mistake is not None and mistake.one_joint else joints
        named = mistake is not None and is_named(said, mistake, robot, joints, wrong)
        yield UnitRow(name, robot, seed, rough, named, said.accuses_units, said.first)


def summarise_units(rows: Sequence[UnitRow]) -> dict[str, float]:
    """Returns the figures of summary.json."""
    wrong, sound = [row for row in rows if not row.rough], [row for row in rows if row.rough]
    found: dict[str, float] = {}
    if wrong:
        found = {"units.named": _named(wrong), "units.cases": float(len(wrong))}
        for robot in dict.fromkeys(row.robot for row in wrong):
            found[f"units.{robot}.named"] = _named([row for row in wrong if row.robot == robot])
        for name in dict.fromkeys(row.name for row in wrong):
            found[f"units.{name}.named"] = _named([row for row in wrong if row.name == name])
    if sound:
        found |= {"units.false": float(sum(row.accused for row in sound)), "units.sound": float(len(sound))}
    return found


def unit_verdicts(rows: Sequence[UnitRow]) -> list[tuple[str, bool]]:
    """Returns a clause on each figure that something is asked of, and whether that is reached."""
    summary, found = summarise_units(rows), []
    if "units.named" in summary:
        worst = min((summary[f"units.{robot}.named"], robot) for robot in dict.fromkeys(row.robot for row in rows))
        pooled = summary["units.named"]
        found = [
            (f"a wrong unit is named first in {_asked(pooled, POOLED)}", pooled >= POOLED),
            (f"on the robot `{worst[1]}` in {_asked(worst[0], EACH)}", worst[0] >= EACH),
        ]
    if "units.false" in summary:
        count, of = summary["units.false"], summary["units.sound"]
        reached = count <= FALSE
        end = f"(asked: at most {FALSE}, {'reached' if reached else 'missed'})"
        found.append(
            (f"units are accused in {count:.0f} of {of:.0f} sound records of rough robot files {end}", reached)
        )
    return found


def unit_sections(rows: Sequence[UnitRow]) -> tuple[Section, ...]:
    """Returns the tables of the page."""
    wrong, sound = [row for row in rows if not row.rough], [row for row in rows if row.rough]
    sections = []
    if wrong:
        pairs = dict.fromkeys((row.name, row.robot) for row in sorted(wrong, key=lambda row: _order(row, wrong)))
        cells = tuple(
            _cells(name.replace("_", " "), [row for row in wrong if (row.name, row.robot) == (name, robot)])
            for name, robot in pairs
        )
        caption = (
            "Named: the first cause is the unit, and its likeliest scale one of those that give the same data; a"
            " refusal must name the unit."
        )
        heads = ("Mistake", "Robot", "Seeds", "Named", "Said first")
        sections.append(Section("Wrong units", "", (Table(heads, cells, caption=caption),)))
    if sound:
        robots = dict.fromkeys(row.robot for row in sound)
        found = tuple(_sound_cells(robot, [row for row in sound if row.robot == robot]) for robot in robots)
        table = Table(("Robot", "Sound records", "Units accused", "Said first"), found)
        sections.append(Section("Rough robot files", "Nothing but the robot file is off.", (table,)))
    return tuple(sections)


def _order(row: UnitRow, rows: Sequence[UnitRow]) -> int:
    return [other.name for other in rows].index(row.name)


def _cells(name: str, rows: Sequence[UnitRow]) -> tuple[str, ...]:
    return name, rows[0].robot, str(len(rows)), percent(_named(rows)), _counted(rows)


def _sound_cells(robot: str, rows: Sequence[UnitRow]) -> tuple[str, ...]:
    return robot, str(len(rows)), str(sum(row.accused for row in rows)), _counted(rows)


def _named(rows: Sequence[UnitRow]) -> float:
    return sum(row.named for row in rows) / len(rows)


def _asked(value: float, least: float) -> str:
    end = "reached" if value >= least else "missed"
    return f"{percent(value)} (asked: at least {percent(least)}, {end})"


def _counted(rows: Sequence[UnitRow]) -> str:
    return ", ".join(f"{count} {said}" for said, count in Counter(row.first for row in rows).most_common())
