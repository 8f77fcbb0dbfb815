"""What the study of mistakes found: shares of right grades and causes, all mistakes, and logs in wrong units."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Section
from robid.studies.mistakes.cases import COVERED, GRADES, HALF_WIDTHS, SOUND, SPRING_ERROR
from robid.studies.mistakes.unit_logs import is_named, said_of
from robid.studies.mistakes.wrong_units import UnitSubject, unit_subjects
from robid.studies.page import CHOOSING, Asked, Conclusion, PartFound, concluded, table
from robid.studies.settings.defects import MistakesStudy, UnitMistake
from robid.studies.study import Earlier, study_of

ASKED = {
    "graded": Asked(lower=0.9, what="share of the cases with a mistake that get the right grade or a worse one"),
    "named": Asked(lower=0.8, what="where one cause is to blame, share in which it is named first"),
    "false_alarms": Asked(upper=0.1, what="share of the sound robots that are not graded trust"),
    "units.named": Asked(lower=0.9, what="share of wrong units that are named first"),
    "units.false": Asked(upper=2, what="sound records of rough robot files in which units are accused"),
}
_EACH = 0.85  # at least, of wrong units on each robot

_TRUST = 2

_Row = TypeVar("_Row")


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

    name, robot, cause, refusal = (str(told.get(key, "")) for key in ("case", "robot", "cause", "refusal"))
    causes, right, given = tuple(held.datasets["causes"].values.tolist()), int(number("right")), int(number("given"))
    sizes = number("worst_spring_error"), number("worst_half_widths"), number("misfit"), number("coverage")
    return CaseRow(name, robot, cause, causes, right, given, *sizes, refusal)


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns the cases into figures, the table of mistakes and the verdict."""
    study, subjects = study_of(run.loaded, MistakesStudy), unit_subjects(run)
    wrong = {} if study.units is None else study.units.mistakes
    rows = [read_row(held) for held in results[2]]
    units = [row for held in results[3] for row in _unit_rows(held, subjects, wrong)]
    summary = {**summarise(rows), **summarise_units(units)}
    sections = (*(_case_sections(rows) if rows else ()), *unit_sections(units))
    judged = study.use == "judge"
    warnings = () if judged else (CHOOSING,)
    asked = {name: limits for name, limits in ASKED.items() if name in summary} | unit_bars(units)
    found = concluded([PartFound(summary, asked, sections, warnings)], "mistakes are graded and named")
    return found if judged else replace(found, verdict=replace(found.verdict, level="warn"))


def summarise(rows: Sequence[CaseRow]) -> dict[str, float]:
    """Returns the figures of summary.json; what is not known is left out."""
    if not rows:
        return {}
    sound = [row for row in rows if row.name == SOUND]
    mistaken = [row for row in rows if row.name != SOUND]
    found = {
        "graded": _mean(row.graded for row in mistaken),
        "named": _mean(row.named for row in mistaken if row.blames),
        "false_alarms": _mean(row.given < _TRUST for row in sound),
        "sound.deserve_trust": _mean(row.right == _TRUST for row in sound),
        "sound.robots": float(len(sound)),
        "cases": float(len(mistaken)),
    }
    for robot, own in _by(sound, "robot").items():
        found[f"false_alarms.{robot}"] = _mean(row.given < _TRUST for row in own)
    for name, own in _by(rows, "name").items():
        found |= {
            f"{name}.graded": _mean(row.graded for row in own),
            f"{name}.named": _mean(row.named for row in own if row.blames),
            f"{name}.grade_mean": _mean(row.given for row in own),
            f"{name}.right_mean": _mean(row.right for row in own),
            f"{name}.worst_spring_error": max(_known(row.spring_error for row in own), default=math.nan),
            f"{name}.worst_half_widths": max(_known(row.half_widths for row in own), default=math.nan),
            f"{name}.coverage": _mean(row.coverage for row in own),
            f"{name}.misfit": _median(row.misfit for row in own),
            f"{name}.refused": _mean(bool(row.refusal) for row in own),
        }
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _by(rows: Sequence[_Row], *keys: str) -> dict[Any, list[_Row]]:
    """Rows by what these fields of theirs are, in the order in which that is first met."""
    found: dict[Any, list[_Row]] = {}
    for row in rows:
        named = tuple(getattr(row, key) for key in keys)
        found.setdefault(named if len(keys) > 1 else named[0], []).append(row)
    return found


def _known(values: Iterable[float]) -> list[float]:
    return [float(value) for value in values if math.isfinite(value)]


def _mean(values: Iterable[float]) -> float:
    known = _known(values)
    return float(np.mean(known)) if known else math.nan


def _median(values: Iterable[float]) -> float:
    known = _known(values)
    return float(np.median(known)) if known else math.nan


_COLUMNS: tuple[tuple[str, Callable[[list[CaseRow]], str]], ...] = (
    ("Robot", lambda rows: ", ".join(dict.fromkeys(row.robot for row in rows))),
    ("Worst spring", lambda rows: percent(_median(row.spring_error for row in rows))),
    ("In half-widths", lambda rows: significant(_median(row.half_widths for row in rows))),
    ("Misfit", lambda rows: significant(_median(row.misfit for row in rows))),
    ("Covered", lambda rows: percent(_mean(row.coverage for row in rows))),
    ("Right grade", lambda rows: _counted(GRADES[row.right] for row in rows)),
    ("Given grade", lambda rows: _counted(GRADES[row.given] for row in rows) + _refused(rows)),
    ("To blame", lambda rows: rows[0].cause or MISSING),
    ("First named", lambda rows: _counted((*row.causes, MISSING)[0] for row in rows)),
)


def _refused(rows: Sequence[CaseRow]) -> str:
    refused = sum(bool(row.refusal) for row in rows)
    return f" ({refused} refused)" if refused else ""


def _case_sections(rows: Sequence[CaseRow]) -> tuple[Section, ...]:
    caption = (
        "Medians over the seeds; grades and causes with the number of seeds. Worst spring: largest error of an"
        " identified spring, relative and over half its interval. Right grade: trust where at least"
        f" {percent(COVERED)} of the identified parameters are inside their intervals and no spring is off by more than"
        f" {HALF_WIDTHS:g} half-widths, do not use where one is off by more than {percent(SPRING_ERROR)} or the"
        " validation fails, else predicts."
    )
    made = _by([row for row in rows if row.name != SOUND], "name").values()
    sound = _by([row for row in rows if row.name == SOUND], "robot").values()
    mistakes = table((("Mistake", lambda own: own[0].name.replace("_", " ")), *_COLUMNS), made, caption=caption)
    robots = table((("Sound robots", lambda own: own[0].robot), *_COLUMNS), sound)
    return (Section("Mistakes", "", (mistakes,)), Section("Sound robots", "Nothing is wrong with these.", (robots,)))


def _counted(texts: Iterable[str]) -> str:
    return ", ".join(f"{count} {text}" for text, count in Counter(texts).most_common())


@dataclass(frozen=True)
class UnitRow:
    """One case of logs that are read in a unit of another."""

    name: str  # Name of the mistake; that of no mistake for a sound record
    robot: str
    seed: int  # Seed of the individual
    rough: bool  # Whether nothing but the robot file is wrong
    named: bool  # Whether the mistake is named first
    accused: bool  # Whether units are accused first, rightly or not
    first: str  # What is named first, in words


def _unit_rows(
    held: Artifact, subjects: Mapping[str, UnitSubject], mistakes: Mapping[str, UnitMistake]
) -> Iterator[UnitRow]:
    about = held.attributes
    robot, rough, seed = str(about["robot"]), bool(about["rough"]), int(str(about["seed"]))
    joints = [joint.name for joint in subjects[robot].run.loaded.robot.joints]
    columns = (held.datasets[key].values.tolist() for key in ("case", "causes", "scales", "refusal"))
    for name, *texts in zip(*columns, strict=True):
        said, mistake = said_of(*texts), mistakes.get(name)
        wrong = [joints[seed % len(joints)]] if mistake is not None and mistake.one_joint else joints
        named = mistake is not None and is_named(said, mistake, robot, joints, wrong)
        yield UnitRow(name, robot, seed, rough, named, said.accuses_units, said.first)


def summarise_units(rows: Sequence[UnitRow]) -> dict[str, float]:
    """Returns the figures of summary.json."""
    wrong, sound = ([row for row in rows if row.rough == rough] for rough in (False, True))
    found: dict[str, float] = {}
    if wrong:
        found = {"units.named": _mean(row.named for row in wrong), "units.cases": float(len(wrong))}
        for key in ("robot", "name"):
            for name, own in _by(wrong, key).items():
                found[f"units.{name}.named"] = _mean(row.named for row in own)
    if sound:
        found |= {"units.false": float(sum(row.accused for row in sound)), "units.sound": float(len(sound))}
    return found


def unit_bars(rows: Sequence[UnitRow]) -> dict[str, Asked]:
    """Returns what is asked of wrong units on the robot on which they are named least."""
    summary, robots = summarise_units(rows), _by([row for row in rows if not row.rough], "robot")
    worst = min(((summary[f"units.{robot}.named"], robot) for robot in robots), default=None)
    return {} if worst is None else {f"units.{worst[1]}.named": Asked(lower=_EACH, what="the same on the worst robot")}


def unit_sections(rows: Sequence[UnitRow]) -> tuple[Section, ...]:
    """Returns the tables of the page."""
    wrong, sound = ([row for row in rows if row.rough == rough] for rough in (False, True))
    seeds = ("Seeds", lambda own: str(len(own)))
    first = ("Said first", lambda own: _counted(row.first for row in own))
    sections = []
    if wrong:
        names = list(_by(wrong, "name"))
        pairs = sorted(_by(wrong, "name", "robot").values(), key=lambda own: names.index(own[0].name))
        columns = (
            ("Mistake", lambda own: own[0].name.replace("_", " ")),
            ("Robot", lambda own: own[0].robot),
            seeds,
            ("Named", lambda own: percent(_mean(row.named for row in own))),
            first,
        )
        caption = (
            "Named: the first cause is the unit, and its likeliest scale one of those that give the same data; a"
            " refusal must name the unit."
        )
        sections.append(Section("Wrong units", "", (table(columns, pairs, caption=caption),)))
    if sound:
        accused = ("Units accused", lambda own: str(sum(row.accused for row in own)))
        columns_of_sound = (("Robot", lambda own: own[0].robot), ("Sound records", seeds[1]), accused, first)
        shown = table(columns_of_sound, _by(sound, "robot").values())
        sections.append(Section("Rough robot files", "Nothing but the robot file is off.", (shown,)))
    return tuple(sections)
