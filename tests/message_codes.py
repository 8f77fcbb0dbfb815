"""Codes of messages as they stand in the sources of the package."""

import ast
import functools
import re
from collections import Counter
from pathlib import Path

from robid.errors import codes_in
from robid.results.finding import CAUSES

CODED = re.compile(r"([SDAB]\d{3}) \S")


@functools.cache
def sources():
    """Every file of the package and its syntax tree."""
    files = sorted((Path(__file__).parents[1] / "robid").rglob("*.py"))
    return [(file, ast.parse(file.read_text())) for file in files]


def literals(tree):
    """Beginning of every text that a source holds, f-strings up to their first value; docstrings are none."""
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr) and node.values and isinstance(node.values[0], ast.Constant):
            yield node, str(node.values[0].value) + "{}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            yield node, node.value


@functools.cache
def codes_written():
    """How often each code begins a message or is that of a cause."""
    found = Counter(match[1] for _, tree in sources() for _, text in literals(tree) if (match := CODED.match(text)))
    found.update(code for words in CAUSES.values() for code in codes_in(words))
    return found
