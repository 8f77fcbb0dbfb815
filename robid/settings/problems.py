"""Problems of settings files: gathered, placed on their line, and raised together."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import BaseModel, ValidationError

from robid.errors import SettingsError
from robid.printable import printable
from robid.settings.base import NAME_PATTERN
from robid.settings.yaml import Document, FieldPath

Found: TypeAlias = Iterator[tuple[FieldPath, str]]
"""What a check finds: where, and what is wrong."""

_Model = TypeVar("_Model", bound=BaseModel)
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_REMEDY = "correct the file"
_OF_KEYS = "`robid schema` prints every key with its meaning"
_ABOUT_KEYS = re.compile(r"\bS38[0-6]\b")
_MISSING = "S381 "
_MISTAKE = re.compile(r"S38[03-6] ")
_MEANT = re.compile(r"\bS380 .*did you mean `(.+)`\?$")
_LONGEST_VALUE = 60
_MOST_NAMES = 8
_MOST_ENTRIES = 3
MOST_PROBLEMS = 500
"""Problems of a file that are looked at: a list of thousands of wrong values needs no thousands of messages."""
_MOST_TOLD = 100


@dataclass(frozen=True)
class SettingsProblem:
    """One thing that is wrong in a settings file."""

    file: Path
    line: int
    field: str
    message: str
    path: FieldPath = ()
    origin: str = ""  # Where what is wrong is written, see `Document.origin`; empty where nothing is known of it

    def __str__(self) -> str:
        place = printable(f"{self.file}:{self.line}: {self.field}", keep="")
        return f"{place}: {self.message}"


def problem_at(document: Document, field: FieldPath, message: str) -> SettingsProblem:
    """Places a message on the line of a field, or of its nearest parent that is written."""
    place = document.line(field), format_field(field)
    return SettingsProblem(document.path, *place, message, field, document.origin(field))


def format_field(field: FieldPath) -> str:
    """Writes a path as `joints[1].motor.gear_ratio`; entries of lists count from 1, as all that a user is shown."""
    text = "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in field)
    return text.removeprefix(".")


def told_once(problems: Iterable[SettingsProblem]) -> list[SettingsProblem]:
    """Tells what is wrong in a section that YAML's anchors repeat once, at its first line, with how often."""
    alike: dict[tuple[object, ...], list[SettingsProblem]] = {}
    for problem in dict.fromkeys(problems):
        place = (problem.origin, problem.path[-1:]) if problem.origin else (problem.line, problem.path, problem.field)
        alike.setdefault((problem.file, problem.message, place), []).append(problem)
    found = []
    for same in alike.values():
        first = min(same, key=lambda problem: problem.line)
        more = f"{len(same) - 1} more place{'s' * (len(same) > 2)} that use{'s' * (len(same) == 2)} it"
        found.append(replace(first, message=f"{first.message} (and in {more})") if len(same) > 1 else first)
    return _told_of_entries(found)


def _told_of_entries(problems: Sequence[SettingsProblem]) -> list[SettingsProblem]:
    """Tells what is wrong in the same way with several entries of a list once, with the others."""
    alike: dict[tuple[object, ...], list[SettingsProblem]] = {}
    for problem in problems:
        place = tuple("" if isinstance(part, int) else part for part in problem.path)
        # What is missing is to be filled in at each place; a key or value that is wrong is one mistake, copied.
        copied = "" in place and _MISTAKE.match(problem.message)
        apart = () if copied else (problem.line, problem.field)
        alike.setdefault((problem.file, problem.message, place, apart), []).append(problem)
    found = []
    for same in alike.values():
        first, *others = sorted(same, key=lambda problem: problem.line)
        named = ", ".join(f"`{other.field}`" for other in others[:_MOST_ENTRIES])
        more = f" and {len(others) - _MOST_ENTRIES} more" if len(others) > _MOST_ENTRIES else ""
        found.append(replace(first, message=f"{first.message} (also {named}{more})") if others else first)
    return found


def raise_problems(problems: Sequence[SettingsProblem]) -> None:
    """Raises all problems as one error, in the order of files and lines; does nothing when there are none.

    Raises:
        SettingsError: If there is a problem.
    """
    if not problems:
        return
    files = list(dict.fromkeys(problem.file for problem in problems))
    ordered = sorted(told_once(problems), key=lambda problem: (files.index(problem.file), problem.line))
    more = [f"and {len(ordered) - _MOST_TOLD} more"] if len(ordered) > _MOST_TOLD else []
    told = "\n".join([*map(str, ordered[:_MOST_TOLD]), *more])
    raise SettingsError(told, remedy=f"{_REMEDY}; {_OF_KEYS}" if _ABOUT_KEYS.search(told) else _REMEDY)


def suggest(wrong: str, known: Iterable[str]) -> str:
    """Returns the end of a sentence that names what was probably meant, or what is known."""
    names = sorted({*known})
    close = difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    if close:
        return f"did you mean `{close[0]}`?"
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return f"known here: {', '.join(f'`{name}`' for name in names[:_MOST_NAMES])}{more}" if names else "there is none"


def validate_document(model: type[_Model], document: Document) -> tuple[_Model | None, list[SettingsProblem]]:
    """Builds a model from a document, or returns why it cannot be."""
    try:
        return model.model_validate(document.data), []
    except ValidationError as error:
        problems = _translate(model, document, error)
    meant = mistyped(problems)
    return None, [each for each in problems if each.path not in meant or not each.message.startswith(_MISSING)]


def mistyped(problems: Iterable[SettingsProblem]) -> set[FieldPath]:
    """Returns the keys that unknown ones were probably meant to be: that they are missing need not be told."""
    return {(*each.path[:-1], found[1]) for each in problems if (found := _MEANT.match(each.message))}


def wrong_fields(data: Any, error: ValidationError) -> list[tuple[FieldPath, str]]:  # noqa: ANN401
    """Lists what pydantic refuses, each with `missing`, `unknown` or `wrong`."""
    found = []
    for detail in _details(error):
        is_missing, is_unknown = detail["type"] == "missing", detail["type"] in _UNKNOWN
        field, _ = _written_field(data, detail["loc"], missing=is_missing)
        found.append((field, "missing" if is_missing else "unknown" if is_unknown else "wrong"))
    return found


def _translate(model: type[BaseModel], document: Document, error: ValidationError) -> list[SettingsProblem]:
    schema = _schema(model)
    messages: dict[FieldPath, list[str]] = {}
    choices: set[FieldPath] = set()
    for detail in _details(error):
        missing = detail["type"] == "missing"
        field, is_choice = _written_field(document.data, detail["loc"], missing=missing)
        message = _message(detail, field, schema)
        if message not in messages.setdefault(field, []):
            messages[field].append(message)
        if is_choice:
            choices.add(field)
    hidden = {outer for outer in choices if any(field[: len(outer)] == outer != field for field in messages)}
    return [
        problem_at(document, field, "; or: ".join(texts)) for field, texts in messages.items() if field not in hidden
    ]


def _details(error: ValidationError) -> Iterator[Any]:
    for detail in map(_at_tag, error.errors(include_url=False)[:MOST_PROBLEMS]):
        if detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]:
            continue  # the items are wrong, not their number
        yield detail


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema(by_alias=True)


def _at_tag(detail: Any) -> Any:  # noqa: ANN401
    """Moves what is wrong with the key that chooses a member of a union to that key."""
    if detail["type"] not in ("union_tag_invalid", "union_tag_not_found"):
        return detail
    key = detail["ctx"]["discriminator"].strip("'()")  # a function that finds the key is named after it
    moved = {**detail, "loc": (*detail["loc"], key)}
    if detail["type"] == "union_tag_not_found":
        return {**moved, "type": "missing"}
    message = f"Input should be one of {detail['ctx']['expected_tags']}"
    return {**moved, "type": "literal_error", "msg": message, "input": detail["ctx"]["tag"]}


def _written_field(data: Any, loc: FieldPath, *, missing: bool) -> tuple[FieldPath, bool]:  # noqa: ANN401
    """Drops what pydantic adds to a path (members of unions, `[key]`); says whether something was dropped."""
    field: list[str | int] = []
    node, dropped, tagged = data, False, False
    for position, part in enumerate(loc):
        if isinstance(node, dict) and node.get("kind") == part and not tagged:
            # The member of a union may be called like one of its fields.
            dropped = tagged = True
            continue
        inside = part in node if isinstance(node, dict) else isinstance(node, list) and part in range(len(node))
        if inside:
            node, tagged = node[part], False
        elif not (missing and position == len(loc) - 1):
            dropped = dropped or part != "[key]"
            continue
        field.append(part)
    return tuple(field), dropped


def _message(detail: Any, field: FieldPath, schema: dict[str, Any]) -> str:  # noqa: ANN401
    if detail["type"] in _UNKNOWN:
        nodes = _nodes_at(schema, field[:-1])
        keys = [key for node in nodes for key in node.get("properties", {})]
        return _other_member(nodes, *detail["loc"][-2:]) or f"S380 unknown key; {suggest(str(field[-1]), keys)}"
    if detail["type"] == "missing":
        return "S381 is missing" + (_wanted_entries(schema, field) or _meaning(schema, field))
    if detail["type"] in ("too_short", "tuple_type", "list_type") and not detail["input"]:
        wanted = _wanted_entries(schema, field)
        if wanted:
            return "S382 is empty" + wanted
    if detail["type"] == "value_error":
        return str(detail["ctx"]["error"])
    wrong = detail["msg"][0].lower() + detail["msg"][1:]
    message = f"S383 {wrong}"
    if detail["type"] == "literal_error" and field[-1] == "unit" and detail["input"]:
        told = f"state what one `{detail['input']}` stands for as `unit` and `scale` (data sheets tell it)"
        message = f"S384 {told}; {wrong}"
    if detail["type"] == "string_pattern_mismatch" and detail["ctx"]["pattern"] == NAME_PATTERN:
        message = "S385 a name has up to 64 letters, digits, `_` or `-`, and starts with a letter or digit"
    value = detail["input"]
    shown = "nothing" if value is None else repr(value)
    return message if len(shown) > _LONGEST_VALUE else f"{message} (found {shown})"


def _wanted_entries(schema: dict[str, Any], field: FieldPath) -> str:
    """Says what to fill in where a list of sections has to have entries; nothing of other fields."""
    for node in _nodes_at(schema, field[:-1]):
        place = node.get("properties", {}).get(field[-1], {})
        keys = [key for item in _resolve(schema, place.get("items", {})) for key in item.get("required", ())]
        if place.get("minItems") and keys:
            entry = ", ".join(f"{key}: .." for key in dict.fromkeys(keys))
            return f": fill in one line `- {{{entry}}}` for each. {place.get('description', '')}".rstrip()
    return ""


def _meaning(schema: dict[str, Any], field: FieldPath) -> str:
    told = [
        node.get("properties", {}).get(field[-1], {}).get("description", "") for node in _nodes_at(schema, field[:-1])
    ]
    known = list(dict.fromkeys(one for one in told if one))
    return f": {known[0][0].lower()}{known[0][1:].removesuffix('.')}" if len(known) == 1 else ""


def _other_member(nodes: Sequence[dict[str, Any]], member: str | int, key: str | int = "") -> str | None:
    """Names the members of a union that have a key which the chosen member lacks, by what chooses them."""
    sections: list[dict[str, Any]] = [node.get("properties", {}) for node in nodes]
    for tag in sections[0] if len(sections) > 1 else ():
        if all("const" in section.get(tag, {}) for section in sections):
            names = [f"`{tag}: {section[tag]['const']}`" for section in sections if key in section]
            return f"S386 belongs to {' or '.join(names)}, not to `{tag}: {member}`" if names else None
    return None


def _nodes_at(schema: dict[str, Any], field: FieldPath) -> list[dict[str, Any]]:
    """Lists what a JSON schema allows at a path."""
    nodes = _resolve(schema, schema)
    for part in field:
        nodes = [found for node in nodes for child in _children(node, part) for found in _resolve(schema, child)]
    return nodes


def _children(node: dict[str, Any], part: str | int) -> list[Any]:
    if isinstance(part, int):
        items = [*node.get("prefixItems", [])[part : part + 1], node.get("items")]
    else:
        items = [node.get("properties", {}).get(part), *node.get("patternProperties", {}).values()]
        items.append(node.get("additionalProperties"))
    return [item for item in items if isinstance(item, dict)]


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> list[dict[str, Any]]:
    """Follows references and unions to the plain schemas behind a node."""
    if "$ref" in node:
        return _resolve(schema, schema["$defs"][node["$ref"].rpartition("/")[2]])
    members = [*node.get("anyOf", []), *node.get("oneOf", []), *node.get("allOf", [])]
    return [found for member in members for found in _resolve(schema, member)] or [node]
