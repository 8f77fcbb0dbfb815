"""What can be checked of a settings file some of whose values are of the wrong type: all that these do not touch."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from robid.settings.problems import MOST_PROBLEMS, SettingsProblem, mistyped, wrong_fields
from robid.settings.robot import RobotFile
from robid.settings.yaml import Document, FieldPath

_Model = TypeVar("_Model", bound=BaseModel)
_ATTEMPTS = 6
_NAMED = {"campaigns": 3, "designs": 2, "fits": 2, "joints": 2, "springs": 2, "sensors": 2, "loop_links": 2}
"""How many keys say which part of a file a value may change the meaning of; 1 where the section is not named here."""
_PROPOSED = re.compile(r"; (did you mean|known here).*", re.DOTALL)
_PLACE = {"dh": None, "frame": None, "link": None, "limits_deg": None, "limits_m": None}


@dataclass(frozen=True)
class LeftOut:
    """A value that was left out of a file, being wrong, or a section that cannot be without one."""

    field: FieldPath
    is_unknown: bool  # Whether nothing has this key, so that it may stand for one of those that are not there
    beside: frozenset[str]  # Keys beside it

    def touches(self, field: FieldPath) -> bool:
        """Whether a field may look wrong because of it alone."""
        if self.field[0] == "springs" and (field == ("base",) or (field[:1], field[-1:]) == (("joints",), ("name",))):
            return True  # a joint needs a transmission and a base springs: this may be the one
        zone = self.field[: _NAMED.get(str(self.field[0]), 1)]
        if self.is_unknown and zone == self.field:
            parent = self.field[:-1]
            inside = field[: len(parent)] == parent
            return inside and (len(field) == len(parent) or field[len(parent)] not in self.beside)
        return all(ours == theirs for ours, theirs in zip(zone, field, strict=False))


def sound_part(model: type[_Model], document: Document) -> tuple[_Model | None, list[LeftOut]]:
    """Builds a model of what is left of a file without what is wrong; None where that is too little."""
    data = deepcopy(document.data)
    left_out: list[LeftOut] = []
    for _ in range(_ATTEMPTS):
        try:
            return model.model_validate(data), left_out
        except ValidationError as error:
            if error.error_count() > MOST_PROBLEMS:
                return None, left_out
            wrong = wrong_fields(data, error)
        for written, kind in wrong:
            field = _removable(data, written, is_missing=kind == "missing")
            if field is None:
                return None, left_out
            parent = _at(data, field[:-1])
            if isinstance(parent, dict) and field[-1] in parent:
                left_out.append(LeftOut(field, kind == "unknown", frozenset(parent)))
                del parent[field[-1]]
    return None, left_out


def _removable(data: Any, field: FieldPath, *, is_missing: bool) -> FieldPath | None:  # noqa: ANN401
    """What has to go where a field is wrong; None where an entry of a list of sections, or all, would go."""
    field = field[:-1] if is_missing else field
    while field and isinstance(field[-1], int):
        if isinstance(_at(data, field), dict):
            return None
        field = field[:-1]
    return field or None


def _at(data: Any, field: FieldPath) -> Any:  # noqa: ANN401
    for part in field:
        inside = part in data if isinstance(data, dict) else isinstance(data, list) and part in range(len(data))
        if not inside:
            return None
        data = data[part]
    return data


def untouched(
    problems: Iterable[SettingsProblem], left_out: Sequence[LeftOut], words: Iterable[str] = ()
) -> list[SettingsProblem]:
    """Returns those problems that do not follow from what was left out: elsewhere, and about something else."""
    about = {str(one.field[1]) for one in left_out if len(one.field) > 1 and isinstance(one.field[1], str)} | {*words}
    return [
        problem
        for problem in problems
        if not any(one.touches(problem.path) for one in left_out)
        and about.isdisjoint(re.findall(r"[\w-]+", _PROPOSED.sub("", problem.message)))
    ]


def sketch(robot: RobotFile) -> RobotFile:
    """Returns a robot of which something is wrong, for checks of an experiment: its joints have no place and limits."""
    joints = tuple(joint.model_copy(update=_PLACE) for joint in robot.joints)
    return robot.model_copy(update={"joints": joints})


def names_of(robot: RobotFile, problems: Iterable[SettingsProblem]) -> set[str]:
    """Returns the names of what is wrong with a robot: joints, springs and others, or keys of its file."""
    problems = list(problems)
    names = {str(field[0]) for field in mistyped(problems) if len(field) == 1}
    for problem in problems:
        section, *rest = problem.path or ("",)
        entries = getattr(robot, str(section), None)
        index = rest[0] if rest else None
        is_entry = isinstance(entries, tuple) and isinstance(index, int) and index < len(entries)
        names.add(getattr(entries[index], "name", str(section)) if is_entry and entries else str(section))
    return names
