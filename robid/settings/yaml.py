"""YAML files as plain values that know the line they stand on."""

from __future__ import annotations

import datetime
import difflib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.scalarbool import ScalarBoolean

from robid.errors import SettingsError
from robid.files import read_regular
from robid.settings.bounded_yaml import MOST_BYTES, compose, tagged
from robid.settings.other_files import refuse_binary, refuse_other_text, unreadable

FieldPath: TypeAlias = tuple[str | int, ...]

_ALIAS = re.compile(r"undefined alias '([^']+)'")
_ANCHOR = re.compile(r"(?<!\S)&([\w-]+)")


@dataclass(frozen=True)
class Document:
    """A YAML file."""

    path: Path  # The file, as the user named it
    data: dict[str, Any]  # Its content as plain dictionaries, lists, numbers, texts and None; merge keys are resolved
    tree: CommentedMap  # The same content as ruamel.yaml read it, for the line numbers

    def line(self, field: FieldPath) -> int:
        """Returns the line (from 1) of a key or list item, or of the nearest parent that is written."""
        node: Any = self.tree
        line = 0
        for part in field:
            found = _step(node, part)
            if found is None:
                break
            node, line = found
        return line + 1

    def origin(self, field: FieldPath) -> str:
        """Says where a value, or the section that lacks it, is written: alike for all places that use an anchor."""
        node: Any = self.tree
        for position, part in enumerate(field):
            found = _step(node, part)
            if found is None:
                return f"{_start(_first_merged(node))}.{'.'.join(map(str, field[position:]))}"
            above, node = node, found[0]
        if isinstance(node, CommentedMap | CommentedSeq):
            return _start(_first_merged(node))
        anchor = getattr(node, "anchor", None)
        if anchor is not None and anchor.value:
            return f"&{anchor.value}"
        return f"{_start(_holder(above, field[-1]))}.{field[-1]}" if field else _start(node)


def _start(node: CommentedMap | CommentedSeq) -> str:
    return f"{node.lc.line}:{node.lc.col}"


def _first_merged(node: Any) -> Any:  # noqa: ANN401
    """The section that repeats another one's mistakes: what that lacks or has, this one does too."""
    merged = getattr(node, "merge", None)
    return _first_merged(merged[0]) if merged else node


def _holder(node: Any, part: str | int) -> Any:  # noqa: ANN401
    """The section that a key is written in: this one, or one that it merges."""
    if not isinstance(node, CommentedMap) or part in (node.lc.data or {}):
        return node
    return next((_holder(parent, part) for parent in node.merge if part in parent), node)


def load_yaml(path: Path) -> Document:
    """Reads a YAML file whose root is a mapping.

    Raises:
        SettingsError: If it cannot be read, is not YAML, repeats a key, is larger or deeper than settings are, or holds
            other than plain values.
    """
    return parse_yaml(path, read_text(path))


def read_text(path: Path) -> str:
    """Reads the text of a settings file.

    Raises:
        SettingsError: If it cannot be read.
    """
    try:
        content = read_regular(path, MOST_BYTES)
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        refuse_binary(path, content)
        return content.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise SettingsError("S334 is not a UTF-8 text file", where=str(path), remedy="save it as UTF-8") from error


def parse_yaml(path: Path, text: str) -> Document:
    """Reads the text of a YAML file, see `load_yaml`."""
    refuse_other_text(path, text)
    try:
        yaml, node = compose(path, text)
        tree = None if node is None else yaml.constructor.construct_document(node)
    except YAMLError as error:
        raise _syntax_error(path, error, text) from error
    if not isinstance(tree, CommentedMap):
        found = "S335 is empty" if tree is None else "S336 must hold `key: value` lines, not a list or a single value"
        remedy = "`robid init NAME --example drive` writes a robot and an experiment to begin with"
        raise SettingsError(found, where=f"{path}:1", remedy=remedy)
    return Document(path, _mapping(path, tree), tree)


def _step(node: Any, part: str | int) -> tuple[Any, int] | None:  # noqa: ANN401
    """Goes one key or index down: the value there and its line from 0, or None where nothing is written."""
    if isinstance(node, CommentedSeq):
        if isinstance(part, int) and 0 <= part < len(node):
            return node[part], node.lc.item(part)[0]
        return None
    if not isinstance(node, CommentedMap) or part not in node:
        return None
    if part in (node.lc.data or {}):
        return node[part], node.lc.key(part)[0]
    merged = (_step(parent, part) for parent in node.merge)
    return next((found for found in merged if found is not None), None)


def _syntax_error(path: Path, error: YAMLError, text: str) -> SettingsError:
    mark, remedy = None, "correct the line, or the one above it"
    problem = str(error).splitlines()[0]
    if isinstance(error, MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        start = f" (line {error.context_mark.line + 1})" if error.context_mark else ""
        problem = ": ".join(
            text for text in (f"{error.context}{start}" if error.context else "", error.problem) if text
        )
    alias = _ALIAS.search(problem)
    if alias is not None:
        close = difflib.get_close_matches(alias[1], _ANCHOR.findall(text), n=1, cutoff=0.5)
        remedy = f"did you mean `*{close[0]}`?" if close else f"name what it stands for by `&{alias[1]}`, further up"
    where = f"{path}:{mark.line + 1}" if mark is not None else str(path)
    return SettingsError(f"S338 is not valid YAML: {problem}", where=where, remedy=remedy)


def _mapping(path: Path, node: CommentedMap) -> dict[str, Any]:
    plain = {}
    for key, item in node.items():
        found = _step(node, key)
        line = found[1] if found else node.lc.line
        if not isinstance(key, str):
            point = "write numbers with a decimal point; if it is a name, " if isinstance(key, int | float) else ""
            what, remedy = f"S339 the key `{key}` must be a text", f"{point}put it in quotes"
            raise SettingsError(what, where=f"{path}:{line + 1}", remedy=remedy)
        plain[str(key)] = _value(path, item, line)
    return plain


def _value(path: Path, node: Any, line: int) -> Any:  # noqa: ANN401
    if isinstance(node, CommentedMap):
        return _mapping(path, node)
    if isinstance(node, CommentedSeq):
        return [_value(path, item, node.lc.item(index)[0]) for index, item in enumerate(node)]
    if node is None or isinstance(node, bool):
        return node
    if isinstance(node, ScalarBoolean):
        return bool(node)
    if isinstance(node, datetime.date):
        return node.isoformat()
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    raise tagged(path, line)
