"""Placeholders of an experiment file, `${row.column}`, which a row of a manifest fills."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from ruamel.yaml import YAML
from ruamel.yaml.nodes import ScalarNode

from robid.errors import SettingsError
from robid.settings.base import DATA_VARIABLE
from robid.settings.problems import SettingsProblem, format_field, problem_at, suggest
from robid.settings.yaml import Document, FieldPath

Value: TypeAlias = str | int | float | bool | None

COLUMN_PATTERN = r"[A-Za-z_][A-Za-z0-9_]*"
_PLACEHOLDER = re.compile(r"\$\{row\.(" + COLUMN_PATTERN + r")\}")
_ANY = re.compile(r"\$\{[^}]*\}?")
_OF_ALL = {"name": "the name of the run folder of all rows", "execution": "how all rows are computed"}
_TYPED = ("null", "bool", "int", "float")
_OUTSIDE = "S379 `{}` lies outside the {}, where a file that a row names must be"


@dataclass(frozen=True)
class Row:
    """A row of a manifest."""

    id: str
    place: str  # Where it stands, as `fleet.csv:7`
    folder: Path  # Folder of the manifest, an absolute path
    values: Mapping[str, Value]  # Its values by column
    typed: bool = False  # Whether a text is one, as in Parquet; else it is read as YAML would where it stands alone

    def alone(self, column: str) -> Value:
        """Returns what stands in the place of a placeholder that is a whole value; nothing for an empty text."""
        value = self.values[column]
        if self.typed and isinstance(value, str):
            return value if value.strip() else None
        return read_as_yaml(value)


@dataclass(frozen=True)
class Filled:
    """An experiment file with a row in the place of its placeholders."""

    document: Document  # The file; names of files that the row fills are absolute paths
    written: Mapping[FieldPath, str]  # These names as the row says them, by field
    problems: tuple[SettingsProblem, ...]  # What could not be filled


def placeholders(document: Document) -> dict[FieldPath, tuple[str, ...]]:
    """Returns the columns that each field asks for."""
    found = {field: tuple(_PLACEHOLDER.findall(text)) for field, text in _texts(document.data)}
    return {field: columns for field, columns in found.items() if columns}


def refuse_placeholders(document: Document) -> None:
    """Refuses a file that only the rows of a manifest complete.

    Raises:
        SettingsError: If it has a placeholder.
    """
    found = placeholders(document)
    if found:
        field, columns = next(iter(found.items()))
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise SettingsError(
            f"S329 {format_field(field)}: `${{row.{columns[0]}}}`{more} is filled by `robid reprocess`, from a "
            "manifest",
            where=f"{document.path}:{document.line(field)}",
            remedy=f"`robid reprocess MANIFEST {document.path}`, or write a value in its place",
        )


def check_placeholders(document: Document, columns: tuple[str, ...]) -> list[SettingsProblem]:
    """Returns what no row of a manifest with these columns could fill."""
    problems = []
    for field, text in _texts(document.data):
        for found in _ANY.findall(text):
            match = _PLACEHOLDER.fullmatch(found)
            if match is None and found != DATA_VARIABLE:
                message = f"nothing fills `{found}`: a placeholder is written `${{row.column}}`"
                problems.append(problem_at(document, field, message))
            elif match is not None and match[1] not in columns:
                message = f"the manifest has no column `{match[1]}`; {suggest(match[1], columns)}"
                problems.append(problem_at(document, field, message))
    for field in placeholders(document):
        if field[0] in _OF_ALL:
            message = f"is {_OF_ALL[str(field[0])]}: write it without a placeholder"
            problems.append(problem_at(document, field, message))
    return problems


def fill(document: Document, row: Row) -> Filled:
    """Puts a row in the place of all placeholders; its columns are there, see `check_placeholders`."""
    written: dict[FieldPath, str] = {}
    problems: list[SettingsProblem] = []

    def filled(field: FieldPath, text: str) -> object:
        columns = _PLACEHOLDER.findall(text)
        if not columns:
            return text
        is_file = _names_file(field)
        if _PLACEHOLDER.fullmatch(text) and not is_file:
            return row.alone(columns[0])
        empty = [column for column in columns if row.values[column] in ("", None)]
        if empty:
            problems.append(problem_at(document, field, f"`{empty[0]}` is empty in this row"))
            return text
        whole = _PLACEHOLDER.sub(lambda found: _text(row.values[found[1]]), text)
        if not is_file:
            return whole
        outside = _outside(whole)
        if outside:
            problems.append(problem_at(document, field, outside))
            return text
        if whole.startswith(DATA_VARIABLE):
            return whole
        written[field] = whole
        folder = str(row.folder)
        # Braces stand for numbers in names of logs.
        return str(Path(folder if field == ("robot",) else folder.replace("{", "{{").replace("}", "}}")) / whole)

    data = _walk(document.data, (), filled)
    return Filled(replace(document, data=data), written, tuple(problems))


def _names_file(field: FieldPath) -> bool:
    return field == ("robot",) or (field[-1] == "file" and bool({"acquire", "response"} & set(field)))


def _outside(name: str) -> str:
    """Says that a name leads out of its folder, as far as the name alone tells; empty where it does not."""
    if "\0" in name:
        return f"`{name}` is no name of a file: it has a NUL character".replace("\0", "\N{REPLACEMENT CHARACTER}")
    inside = name.removeprefix(DATA_VARIABLE)
    kind = "manifest's folder" if inside == name else "data folder"
    clean = Path(os.path.normpath(inside.lstrip("/") if inside != name else inside))
    return _OUTSIDE.format(name, kind) if clean.is_absolute() or ".." in clean.parts else ""


def leads_outside(path: Path, folder: Path) -> str:
    """Says that a path in a folder, by its name, leads out of it through links, or nowhere; empty where it does not."""
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):
        return f"S360 `{path.relative_to(folder)}` cannot be followed: a link leads back to itself"
    if inside:
        return ""
    return _OUTSIDE.format(path.relative_to(folder), "folder it is named in, through a link")


def read_as_yaml(value: Value) -> Value:
    """Returns a single value as YAML reads its text; what is no number, truth value or nothing stays text."""
    return _read(value.strip()) if isinstance(value, str) else value


@lru_cache(maxsize=4096)
def _read(text: str) -> Value:
    yaml = _scalars()
    tag = str(yaml.resolver.resolve(ScalarNode, text, (True, False)))
    if tag.rpartition(":")[2] not in _TYPED:
        return text
    try:
        value: Value = yaml.constructor.construct_object(ScalarNode(tag, text))
    except (ValueError, IndexError):
        # The resolver takes more for numbers than there are: `-_`, `0x_`, very many digits.
        return text
    return value


@cache
def _scalars() -> YAML:
    return YAML(typ="safe", pure=True)


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value is None else str(value)


def _texts(data: object) -> list[tuple[FieldPath, str]]:
    found: list[tuple[FieldPath, str]] = []

    def note(field: FieldPath, text: str) -> object:
        if "${" in text:
            found.append((field, text))
        return text

    _walk(data, (), note)
    return found


def _walk(node: object, field: FieldPath, change: Callable[[FieldPath, str], object]) -> Any:  # noqa: ANN401
    if isinstance(node, dict):
        return {key: _walk(item, (*field, key), change) for key, item in node.items()}
    if isinstance(node, list):
        return [_walk(item, (*field, index), change) for index, item in enumerate(node)]
    return change(field, node) if isinstance(node, str) else node
