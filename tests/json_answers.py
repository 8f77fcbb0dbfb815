"""Answers of commands with `--json`, held against their schemas: no key more, none less, nothing but JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator

from robid.commands.answers import ANSWERS, schema_of


def check_answer(arguments: Sequence[str], out: str) -> None:
    """Holds what a command printed with `--json` against its schema; of an unknown command it is an error."""
    command = next((one for one in arguments if one in ANSWERS), "status")
    texts = out.splitlines() if "--stream" in arguments else [out]
    for text in texts:
        value = json.loads(text, parse_constant=_refuse)
        validator_of(command, value["type"]).validate(value)


@cache
def validator_of(command: str, kind: str) -> Draft202012Validator:
    """Validates one kind of answer, to which nothing may be added."""
    schema = closed(schema_of(command))
    classes = {made["properties"]["type"]["const"]: name for name, made in schema["$defs"].items() if _is_answer(made)}
    assert kind in classes, f"{command} prints no {kind}"
    return Draft202012Validator({"$defs": schema["$defs"], "$ref": f"#/$defs/{classes[kind]}"})


def closed(schema: Any) -> Any:
    """A schema that refuses keys which it does not name; a published one lets newer versions add some."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    inner = {key: closed(item) for key, item in schema.items()}
    return {**inner, "additionalProperties": False} if "properties" in schema else inner


def _is_answer(made: dict[str, Any]) -> bool:
    return "json_version" in made["properties"]


def _refuse(constant: str) -> None:
    message = f"{constant} is no JSON"
    raise ValueError(message)
