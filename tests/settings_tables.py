"""The tables of settings in the documentation, written from the JSON schemas.

Below a line `<!-- settings: NAME -->` of a page stands the table of the section NAME; `file` is the whole file. Several
names, the members of a union, have one table, which says what only some of them have.
`.venv/bin/python tests/settings_tables.py` writes them anew, and a test compares.
"""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

from robid.models.known import experiment_schema
from robid.settings.load import robot_schema
from robid.studies.settings.study import Study

ROOT = Path(__file__).parent.parent
PAGES = {
    ("docs/reference/experiment-file.md", "docs/reference/studies.md"): partial(experiment_schema, study=Study),
    ("docs/reference/robot-file.md",): robot_schema,
}
_HEAD = ["| key | value | default | meaning |", "|---|---|---|---|"]
_MARK = re.compile(r"^<!-- settings: (\w+(?:, \w+)*) -->\n(?:\|.*\n)*", re.MULTILINE)
_LIMITS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
_TYPES = {"number": "number", "integer": "whole number", "boolean": "true, false", "string": "text", "array": "list"}


def marked(page: str) -> list[str]:
    """Returns the sections that a page has tables of."""
    return [name for names in _MARK.findall(page) for name in names.split(", ")]


def renewed(page: str, schema: dict[str, Any]) -> str:
    """Returns a page with its tables written from a schema."""

    def table(found: re.Match[str]) -> str:
        return "\n".join([f"<!-- settings: {found[1]} -->", *_HEAD, *_rows(found[1].split(", "), schema), ""])

    return _MARK.sub(table, page)


def _rows(sections: list[str], schema: dict[str, Any]) -> list[str]:
    nodes = [schema if section == "file" else schema["$defs"][section] for section in sections]
    # `assumed` is the same everywhere and is explained once.
    keys = [key for node in nodes for key in node["properties"] if key != "assumed" or sections == ["file"]]
    return [_row(key, nodes, schema) for key in dict.fromkeys(keys)]


def _row(key: str, nodes: list[dict[str, Any]], schema: dict[str, Any]) -> str:
    """The row of a key; of several sections the first that has it says what is the same in all."""
    having = [node for node in nodes if key in node["properties"]]
    field = having[0]["properties"][key]
    values = ", ".join(dict.fromkeys(_values(node["properties"][key]) for node in having))
    default = "required" if key in having[0].get("required", ()) else _default(field)
    only = "" if len(having) == len(nodes) else f"{', '.join(f'`{_member(node)}`' for node in having)}: "
    return f"| `{key}` | {values} | {default} | {only}{_meaning(field, schema)} |"


def _member(node: dict[str, Any]) -> str:
    """What chooses a member of a union."""
    return next(str(field["const"]) for field in node["properties"].values() if "const" in field)


def _meaning(field: dict[str, Any], schema: dict[str, Any]) -> str:
    section = schema["$defs"].get(field.get("$ref", "").rpartition("/")[2], {})
    # A dataclass' docstring goes on with its attributes, which have a table of their own.
    return " ".join(str(field.get("description") or section["description"]).split("\n\n")[0].split())


def _values(field: dict[str, Any]) -> str:
    choices = field.get("anyOf") or field.get("oneOf")
    if choices:
        members = (_values(member) for member in choices if member.get("type") != "null")
        return " or ".join(dict.fromkeys(members))
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    if "$ref" in field or field["type"] == "object":
        return "section"
    if field["type"] == "array" and "enum" in field.get("items", {}):
        return f"list of {_values(field['items'])}"
    limits = ", ".join(f"{sign} {field[limit]:g}" for limit, sign in _LIMITS.items() if limit in field)
    return f"{_TYPES[field['type']]} {limits}".strip()


def _default(field: dict[str, Any]) -> str:
    default = field.get("default")
    if default in (None, []) or isinstance(default, dict):
        return ""
    return f"`{json.dumps(default)}`".replace('"', "")


if __name__ == "__main__":
    for names, make_schema in PAGES.items():
        for file in (ROOT / name for name in names):
            file.write_text(renewed(file.read_text(encoding="utf-8"), make_schema()), encoding="utf-8")
