"""What the study of mistakes found: shares of right grades and causes, and the table of all mistakes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Section, Table
from robid.studies.mistakes.cases import COVERED, GRADES, HALF_WIDTHS, SPRING_ERROR
from robid.studies.mistakes.responses import SOUND
from robid.studies.mistakes.unit_logs import is_named, said_of
from robid.studies.mistakes.wrong_units import UnitSubject, unit_subjects
from robid.studies.page import Conclusion
from robid.studies.settings.mistakes import MistakesStudy, UnitMistake
from robid.studies.study import Earlier, study_of

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
            _unit_cells(name.replace("_", " "), [row for row in wrong if (row.name, row.robot) == (name, robot)])
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


def _unit_cells(name: str, rows: Sequence[UnitRow]) -> tuple[str, ...]:
    return name, rows[0].robot, str(len(rows)), percent(_named(rows)), _counted(row.first for row in rows)


def _sound_cells(robot: str, rows: Sequence[UnitRow]) -> tuple[str, ...]:
    return robot, str(len(rows)), str(sum(row.accused for row in rows)), _counted(row.first for row in rows)


def _named(rows: Sequence[UnitRow]) -> float:
    return sum(row.named for row in rows) / len(rows)


def _asked(value: float, least: float) -> str:
    end = "reached" if value >= least else "missed"
    return f"{percent(value)} (asked: at least {percent(least)}, {end})"


ASKED = {"graded": 0.9, "named": 0.8, "false_alarms": 0.1}
"""What is asked: at least, at least, at most."""

_TRUST = 2


@dataclass(frozen=True)
class CaseRow:
    """One case."""

    name: str  # Name of the mistake, or `sound`
    robot: str  # `heavy` or `light`
    cause: str  # What is to blame; empty where there is no single one
    causes: tuple[str, ...]  # What the tool named, the strongest first
    right: int  # The grade that the truth asks for
    given: int  # The grade that it got
    # Largest relative error of an identified spring; NaN where nothing was fitted, as the following
    spring_error: float
    half_widths: float  # The same over half its interval
    misfit: float  # Misfit of the fit
    coverage: float  # Share of the identified parameters inside their intervals
    refusal: str  # Why nothing was fitted; empty where something was

    @property
    def graded(self) -> bool:
        """Whether the grade is the right one or a worse one."""
        return self.given <= self.right

    @property
    def blames(self) -> bool:
        """Whether there is something to blame: a single cause, and not a model that truth and tool both trust."""
        return bool(self.cause) and min(self.right, self.given) < _TRUST

    @property
    def named(self) -> bool:
        """Whether the first cause that was named is the one to blame."""
        return self.causes[:1] == (self.cause,)


def read_row(held: Artifact) -> CaseRow:
    """Reads a case."""
    told = held.attributes

    def number(key: str) -> float:
        value = told.get(key, math.nan)
        return float(value) if isinstance(value, int | float) else math.nan

    return CaseRow(
        name=str(told["case"]),
        robot=str(told["robot"]),
        cause=str(told["cause"]),
        causes=tuple(held.datasets["causes"].values.tolist()),
        right=int(number("right")),
        given=int(number("given")),
        spring_error=number("worst_spring_error"),
        half_widths=number("worst_half_widths"),
        misfit=number("misfit"),
        coverage=number("coverage"),
        refusal=str(told.get("refusal", "")),
    )


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns the cases into figures, the table of mistakes and the verdict."""
    rows, units = [read_row(held) for held in results[2]], unit_rows(run, results[3])
    summary = {**summarise(rows), **summarise_units(units)}
    sections = (*((_mistake_section(rows), _sound_section(rows)) if rows else ()), *unit_sections(units))
    asked = [name for name in ASKED if name in summary]
    clauses = [(_sentence(name, summary[name]), _is_reached(name, summary[name])) for name in asked]
    clauses += unit_verdicts(units)
    seeds = study_of(run.loaded, MistakesStudy).use
    is_good = all(reached for _, reached in clauses) and seeds == "judge"
    text = f"{'; '.join(sentence for sentence, _ in clauses)}."
    warnings = () if seeds == "judge" else ("These seeds are for choosing thresholds: their shares flatter.",)
    return Conclusion(Verdict(text, "ok" if is_good else "warn"), summary, sections, warnings)


def summarise(rows: Sequence[CaseRow]) -> dict[str, float]:
    """Returns the figures of summary.json; what is not known is left out."""
    if not rows:
        return {}
    sound = [row for row in rows if row.name == SOUND]
    mistaken = [row for row in rows if row.name != SOUND]
    found = {
        "graded": _share(row.graded for row in mistaken),
        "named": _share(row.named for row in mistaken if row.blames),
        "false_alarms": _share(row.given < _TRUST for row in sound),
        "sound.deserve_trust": _share(row.right == _TRUST for row in sound),
        "sound.robots": float(len(sound)),
        "cases": float(len(mistaken)),
    }
    for robot in dict.fromkeys(row.robot for row in sound):
        found[f"false_alarms.{robot}"] = _share(row.given < _TRUST for row in sound if row.robot == robot)
    for name in dict.fromkeys(row.name for row in rows):
        own = [row for row in rows if row.name == name]
        found |= {
            f"{name}.graded": _share(row.graded for row in own),
            f"{name}.named": _share(row.named for row in own if row.blames),
            f"{name}.grade_mean": float(np.mean([row.given for row in own])),
            f"{name}.right_mean": float(np.mean([row.right for row in own])),
            f"{name}.worst_spring_error": _largest(row.spring_error for row in own),
            f"{name}.worst_half_widths": _largest(row.half_widths for row in own),
            f"{name}.coverage": _mean(row.coverage for row in own),
            f"{name}.misfit": _median(row.misfit for row in own),
            f"{name}.refused": _share(bool(row.refusal) for row in own),
        }
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _share(said: Iterable[bool]) -> float:
    values = list(said)
    return sum(values) / len(values) if values else math.nan


def _known(values: Iterable[float]) -> list[float]:
    return [value for value in values if math.isfinite(value)]


def _largest(values: Iterable[float]) -> float:
    return max(_known(values), default=math.nan)


def _mean(values: Iterable[float]) -> float:
    known = _known(values)
    return float(np.mean(known)) if known else math.nan


def _median(values: Iterable[float]) -> float:
    known = _known(values)
    return float(np.median(known)) if known else math.nan


def _is_reached(name: str, value: float) -> bool:
    return value <= ASKED[name] if name == "false_alarms" else value >= ASKED[name]


def _sentence(name: str, value: float) -> str:
    said = {
        "graded": "{} of the cases with a mistake get the right grade or a worse one",
        "named": "where one cause is to blame, it is named first in {}",
        "false_alarms": "{} of the sound robots are not graded trust",
    }
    least = "at most" if name == "false_alarms" else "at least"
    end = "reached" if _is_reached(name, value) else "missed"
    return f"{said[name].format(percent(value))} (asked: {least} {percent(ASKED[name])}, {end})"


def _mistake_section(rows: Sequence[CaseRow]) -> Section:
    names = [name for name in dict.fromkeys(row.name for row in rows) if name != SOUND]
    cells = tuple(_cells(name, [row for row in rows if row.name == name]) for name in names)
    caption = (
        "Medians over the seeds; grades and causes with the number of seeds. Worst spring: largest error of an"
        " identified spring, relative and over half its interval. Right grade: trust where at least"
        f" {percent(COVERED)} of the identified parameters are inside their intervals and no spring is off by more than"
        f" {HALF_WIDTHS:g} half-widths, do not use where one is off by more than {percent(SPRING_ERROR)} or the"
        " validation fails, else predicts."
    )
    return Section("Mistakes", "", (Table(_HEADS, cells, caption=caption),))


_HEADS = (
    *("Mistake", "Robot", "Worst spring", "In half-widths", "Misfit", "Covered"),
    *("Right grade", "Given grade", "To blame", "First named"),
)


def _cells(name: str, rows: Sequence[CaseRow]) -> tuple[str, ...]:
    refused = sum(bool(row.refusal) for row in rows)
    given = _counted(GRADES[row.given] for row in rows)
    return (
        name.replace("_", " "),
        ", ".join(dict.fromkeys(row.robot for row in rows)),
        _percent(_median(row.spring_error for row in rows)),
        significant(_median(row.half_widths for row in rows)),
        significant(_median(row.misfit for row in rows)),
        _percent(_mean(row.coverage for row in rows)),
        _counted(GRADES[row.right] for row in rows),
        f"{given} ({refused} refused)" if refused else given,
        rows[0].cause or MISSING,
        _counted((*row.causes, MISSING)[0] for row in rows),
    )


def _sound_section(rows: Sequence[CaseRow]) -> Section:
    sound = [row for row in rows if row.name == SOUND]
    robots = dict.fromkeys(row.robot for row in sound)
    cells = tuple(_cells(robot, [row for row in sound if row.robot == robot]) for robot in robots)
    heads = ("Sound robots", *_HEADS[1:])
    return Section("Sound robots", "Nothing is wrong with these.", (Table(heads, cells),))


def _percent(value: float) -> str:
    return percent(value) if math.isfinite(value) else MISSING


def _counted(texts: Iterable[str]) -> str:
    return ", ".join(f"{count} {text}" for text, count in Counter(texts).most_common())
