"""Rewriting a settings file of an older version; comments, order and layout stay as they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from robid.errors import SettingsError
from robid.settings.numbering import COUNTED, NEWEST
from robid.settings.yaml import parse_yaml

_VERSION = "schema_version"
_MERGE = "tag:yaml.org,2002:merge"


def upgraded(path: Path, text: str) -> str | None:
    """Returns the text of an experiment or robot file in the newest version; None where it is that already.

    Configurations of version 1 count from 0, those of version 2 from 1: each of their numbers is one more.

    Raises:
        SettingsError: If it is not YAML, or of a version that is not known.
    """
    version = parse_yaml(path, text).data.get(_VERSION)
    if version == NEWEST:
        return None
    if version != 1:
        found = "no `schema_version`" if version is None else f"the schema version {version}"
        remedy = f"state `schema_version: {NEWEST}` if it was written for this robid, else use the one that it was for"
        raise SettingsError(f"S536 has {found}, which nothing is known of", where=str(path), remedy=remedy)
    root = YAML(typ="rt").compose(text)
    numbers = (item for pattern in COUNTED for item in _numbers(root, pattern))
    changed = {item.start_mark.index: (item.end_mark.index, str(int(item.value) + 1)) for item in numbers}
    changed |= {
        value.start_mark.index: (value.end_mark.index, str(NEWEST))
        for key, value in _items(root)
        if key == _VERSION and isinstance(value, ScalarNode)
    }
    for start, (end, new) in sorted(changed.items(), reverse=True):
        text = text[:start] + new + text[end:]
    return text


def _items(node: Node) -> Iterator[tuple[str, Node]]:
    """Keys and values of a mapping, those that it merges counted."""
    if not isinstance(node, MappingNode):
        return
    for key, value in node.value:
        if key.tag == _MERGE or key.value == "<<":
            for merged in value.value if isinstance(value, SequenceNode) else [value]:
                yield from _items(merged)
        else:
            yield str(key.value), value


def _numbers(node: Node, pattern: tuple[str, ...]) -> Iterator[ScalarNode]:
    """Numbers of configurations below a node."""
    if pattern:
        for key, value in _items(node):
            if pattern[0] in (key, "*"):
                yield from _numbers(value, pattern[1:])
    elif isinstance(node, SequenceNode):
        yield from (item for item in node.value if isinstance(item, ScalarNode) and item.value.lstrip("+-").isdigit())
