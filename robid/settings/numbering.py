"""How numbers of configurations count in an experiment file: from 1, in files of version 1 from 0.

Inside, indices count from 0; a file is brought to that before it is checked. Version history of the format:
    1: indices of configurations count from 0.
    2: they count from 1, as in the terminal, in reports and in names of logs.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from robid.errors import SettingsError
from robid.settings.problems import SettingsProblem, problem_at

if TYPE_CHECKING:
    from robid.settings.yaml import Document, FieldPath

NEWEST = 2
_KEY = "schema_version"
COUNTED = (
    ("fits", "*", "configurations"),
    ("fits", "*", "choose_on"),
    ("study", "models", "*", "configurations"),
    ("study", "mistakes", "*", "swapped"),
)
"""Lists of an experiment file that hold numbers of configurations; a star stands for any name."""


def of_known_version(document: Document) -> tuple[Document, list[SettingsProblem]]:
    """Returns a file that says a version that there is, for further checks, and what is wrong with the one it says.

    Raises:
        SettingsError: If it is of a newer version, of which nothing else can be said.
    """
    stated = document.data.get(_KEY)
    if isinstance(stated, int) and not isinstance(stated, bool):
        if 1 <= stated <= NEWEST:
            return document, []
        if stated > NEWEST:
            what = f"S521 `{_KEY}: {stated}` is newer than this robid reads, which is {NEWEST}"
            where = f"{document.path}:{document.line((_KEY,))}"
            remedy = f"install the robid that it was written for, or write it for `{_KEY}: {NEWEST}`"
            raise SettingsError(what, where=where, remedy=remedy)
    # A 0 among its numbers shows that they count from 0.
    meant = 1 if any(0 in numbers for _, numbers in numbered_lists(document.data)) else NEWEST
    found = "S522 is missing" if stated is None else f"S531 `{stated!r}` is no version"
    told = f"{found}: write `{_KEY}: {meant}`, in which configurations count from {counts_from(meant)}"
    known = replace(document, data={**document.data, _KEY: meant})
    return known, [problem_at(document, (_KEY,), told)]


def counts_from(version: int) -> int:
    """Returns what the first configuration is called in a file of a version."""
    return 0 if version == 1 else 1


def numbered_lists(data: dict[str, Any]) -> Iterator[tuple[FieldPath, list[Any]]]:
    """Yields the lists of numbers of configurations in an experiment file, with where they stand."""
    for pattern in COUNTED:
        yield from _below(data, pattern, ())


def _below(data: Any, pattern: tuple[str, ...], place: FieldPath) -> Iterator[tuple[FieldPath, list[Any]]]:  # noqa: ANN401
    if not pattern:
        if isinstance(data, list):
            yield place, data
    elif isinstance(data, dict):
        for key in list(data) if pattern[0] == "*" else [pattern[0]] if pattern[0] in data else []:
            yield from _below(data[key], pattern[1:], (*place, key))


def counted_from_zero(document: Document) -> tuple[Document, list[SettingsProblem]]:
    """Returns an experiment file whose numbers of configurations count from 0, and those that there cannot be."""
    if document.data.get(_KEY) != NEWEST:
        return document, []
    data, problems = deepcopy(document.data), []
    for place, numbers in numbered_lists(data):
        for position, number in enumerate(numbers):
            if not isinstance(number, int) or isinstance(number, bool):
                continue  # its type is complained of elsewhere
            numbers[position] = max(number - 1, 0)
            if number < 1:
                told = f"S535 is {number}, but configurations count from 1"
                problems.append(problem_at(document, (*place, position), told))
    return replace(document, data=data), problems
