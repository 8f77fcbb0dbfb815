"""The tables of `docs/reference/json-output.md`, written from the schemas of what commands print with `--json`.

Below a line `<!-- answer: TYPE -->` stands the table of the answers of a type.
`.venv/bin/python tests/json_tables.py` writes them anew, and a test compares.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from robid.commands.answers import ANSWERS, schema_of
from settings_tables import ROOT

PAGE = ROOT / "docs/reference/json-output.md"
_HEAD = ["| key | value | meaning |", "|---|---|---|"]
_MARK = re.compile(r"^<!-- answer: ([\w-]+) -->\n(?:Version .*\n\n)?(?:\|.*\n)*", re.MULTILINE)
_WORDS = {"string": "text", "integer": "whole number", "boolean": "true, false", "array": "list", "object": "object"}


def types() -> list[str]:
    """Returns the types of answers, errors last."""
    return [*dict.fromkeys(kind.type for kinds in ANSWERS.values() for kind in kinds), "error"]


def marked(page: str) -> list[str]:
    """Returns the types of answers that a page has tables of."""
    return _MARK.findall(page)


def renewed(page: str) -> str:
    """Returns the page with its tables written from the schemas."""
    return _MARK.sub(lambda found: f"<!-- answer: {found[1]} -->\n{_table(found[1])}\n", page)


def _table(kind: str) -> str:
    made, parts = _definitions()[kind]
    version = re.search(r"here (\d+\.\d+)", made["properties"]["json_version"]["description"])
    assert version is not None
    rows = [f"| `{key}` | {value} | {meaning} |" for key, value, meaning in _rows("", made, parts, set())]
    return "\n".join([f"Version {version[1]}. {made['description']}", "", *_HEAD, *rows])


@cache
def _definitions() -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """The schema of each type of answer, and of what it is made of."""
    found = {}
    for command in ANSWERS:
        parts = schema_of(command)["$defs"]
        for made in parts.values():
            if "json_version" in made["properties"]:
                found[made["properties"]["type"]["const"]] = made, parts
    return found


def _rows(path: str, made: dict[str, Any], parts: dict[str, Any], seen: set[str]) -> Iterator[tuple[str, str, str]]:
    """Rows of all keys, as jq names them; what was described above is not described again."""
    for key, field in made["properties"].items():
        if (path, key) in {("", "type"), ("", "json_version")}:
            continue
        value, inside, name = _value(field)
        again = name in seen
        yield f"{path}.{key}", value, field["description"] + (" Keys as above." if again else "")
        if name and not again:
            seen.add(name)
            yield from _rows(f"{path}.{key}{inside}", parts[name], parts, seen)


def _value(field: dict[str, Any]) -> tuple[str, str, str]:
    """What a field holds in words, how jq comes to the parts of it, and the definition of these."""
    if "anyOf" in field:
        (only,) = (one for one in field["anyOf"] if one.get("type") != "null")
        value, inside, name = _value(only)
        return f"{value} or null", inside, name
    if "$ref" in field:
        return "object", "", field["$ref"].rpartition("/")[2]
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"]), "", ""
    if "prefixItems" in field:
        return f"list of {len(field['prefixItems'])} {_several(_value(field['prefixItems'][0])[0])}", "[]", ""
    held = field.get("items", field.get("additionalProperties"))
    if isinstance(held, dict):
        value, inside, name = _value(held)
        return f"list of {_several(value)}" if field["type"] == "array" else f"by name: {value}", f"[]{inside}", name
    if "type" not in field:
        return "any", "", ""
    return ("number" if isinstance(field["type"], list) else _WORDS[field["type"]]), "", ""


def _several(value: str) -> str:
    return f"{value}s" if value in {"object", "text", "number", "whole number"} else value


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
