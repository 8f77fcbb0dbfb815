"""Figures, bars and sections of set C of the study of trust: robots with one defect each, and sound ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.report.numbers import percent, significant
from robid.report.section import Section
from robid.studies.page import Asked, table
from robid.studies.settings.singles import KINDS, SINGLE, SOUND, SingleDefects
from robid.studies.settings.trust import Individual
from robid.studies.study import Results
from robid.studies.trust.figures import TRUST, RobotRow, is_trusted_wrong, largest, physical_held, share

SINGLE_ASKED: Mapping[str, Asked] = {
    "trusted_wrong": Asked(upper=0.05),
    "first": Asked(lower=0.7),
    "first_cases": Asked(lower=25),
    "false": Asked(upper=0.07),
    "width_ratio": Asked(upper=2.5),
}
"""What is asked of set C, by the end of a figure's name."""
_POWER = 0.8


@dataclass(frozen=True)
class Single:
    """What the study found of one robot of set C."""

    one: Individual
    row: RobotRow
    causes: tuple[str, ...]  # What was named, the likeliest first
    named: tuple[str, ...]  # What counts as right; empty for sound robots
    moved: float  # How far the defect moves a spring, over the half width of its interval; NaN where no fit was made
    power: float  # Power with which a test shows it by the truth; NaN where no fit was made

    @property
    def counts(self) -> bool:
        """Whether the defect is to be named: it moves a spring, the data show it, or they were refused."""
        return bool(self.named) and not (self.moved <= 1 and self.power < _POWER)

    @property
    def is_first(self) -> bool:
        """Whether what is right was named first."""
        return bool(self.causes) and self.causes[0] in self.named


def single_robots(
    single: SingleDefects | None, rows: Sequence[tuple[Individual, RobotRow]], grades: Results, effects: Results
) -> list[Single]:
    """Returns what was found of each robot of set C."""
    found = []
    for one, row in rows:
        if single is not None and one.kind == "single":
            defect, told = single.defect(one.group), _read(effects.by_name, one.key)
            named = () if defect is None else defect.named
            causes = read_artifact(grades.by_name[one.key], TASK).datasets["causes"].values.tolist()
            moved, power = (float(told.get(key, math.nan)) for key in ("moved", "power"))
            found.append(Single(one, row, tuple(dict.fromkeys(causes)), named, moved, power))
    return found


def _read(paths: Mapping[str, Path], key: str) -> Mapping[str, float]:
    held: Artifact | None = read_artifact(paths[key], TASK) if key in paths else None
    known = {} if held is None else held.attributes
    return {name: float(value) for name, value in known.items() if isinstance(value, int | float)}


def single_figures(robots: Sequence[Single]) -> dict[str, float]:
    """Returns the figures of set C; NaN where something is not known."""
    flawed, sound = ([each for each in robots if bool(each.named) == has] for has in (True, False))
    cases = [each for each in flawed if each.counts]
    # Robots of one kind have the same springs.
    fits = [
        [each.row.random for each in sound if each.one.robot == kind and each.row.random is not None] for kind in KINDS
    ]
    found = {
        "robots": float(len(flawed)),
        "sound": float(len(sound)),
        "trusted": share([each.row.grade == TRUST for each in flawed]),
        "trusted_wrong": share([is_trusted_wrong(each.row) for each in flawed]),
        "first": share([each.is_first for each in cases]),
        "first_cases": float(len(cases)),
        "false": share([each.row.grade != TRUST for each in sound]),
        "width_ratio": largest([physical_held(own).width_ratio for own in fits if own]),
    }
    for group in dict.fromkeys(each.one.group for each in flawed):
        own = [each for each in flawed if each.one.group == group]
        name = group.removeprefix(f"{SINGLE}_")
        found[f"{name}.first"] = share([each.is_first for each in own if each.counts])
        found[f"{name}.cases"] = float(sum(each.counts for each in own))
    return {f"{SINGLE}.{key}": value for key, value in found.items()}


def single_bars(single: SingleDefects | None) -> dict[str, Asked]:
    """Returns what is asked of the figures of set C, by their names."""
    return {} if single is None else {f"{SINGLE}.{key}": asked for key, asked in SINGLE_ASKED.items()}


_GRADES = ("do not use", "predicts", "trust")
_COLUMNS = (
    ("Robot", lambda each: f"{each.one.group.removeprefix(f'{SINGLE}_')} {each.one.seed}, {each.one.robot}"),
    ("Grade", lambda each: _GRADES[each.row.grade or 0]),
    ("Named first", lambda each: each.causes[0] if each.causes else ""),
    ("Right", lambda each: ", ".join(each.named)),
    ("Moves a spring by [half widths]", lambda each: significant(each.moved)),
    ("Power", lambda each: percent(each.power)),
    ("Spring off by [half widths]", lambda each: significant(largest([each.row.worst]))),
)


def single_sections(robots: Sequence[Single]) -> Iterator[Section]:
    """Yields what the page shows of set C."""
    if not robots:
        return
    note = (
        "Robots with one defect each. A defect counts where it moves a spring by more than half its interval, where a"
        " test that knows it shows it with a power of 80 %, or where the data were refused."
    )
    yield Section("Set C: one defect each", note, (table(_COLUMNS, [each for each in robots if each.named]),))
    yield Section(
        f"Set C: {SOUND} robots", "Of the same noises.", (table(_COLUMNS, [each for each in robots if not each.named]),)
    )
